"""The operator's controls of the drive: its services, its parameters, /cam/rpm."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from cam_rig.errors import RefusedError, RunError
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.live.drive import DriveProgram, OperatorCommands
from cam_rig.messages import topics
from cam_rig.nodes.common.clock_source import ClockSource
from cam_rig.simulation.schedule import CamState
from cam_rig.units import RPM


class DriveControls:
    """Passes operator commands on to the drive's program, and saves them for a successor at once.

    Parameters
    ----------
    node : the drive's, which offers the services and has the parameters
    send : sends a state that cannot wait
    set_pacing : takes the parameter of that name
    kept : where the commands are saved
    """

    def __init__(
        self,
        node: ClockSource,
        program: DriveProgram,
        send: Callable[[CamState], None],
        set_pacing: Callable[[str], None],
        kept: Checkpoint,
    ) -> None:
        self._node, self._program, self._send, self._kept = node, program, send, kept
        self._set_pacing = set_pacing
        node.add_on_set_parameters_callback(self._refuse)
        node.subscribe(topics.CAM_RPM, self._on_rpm)
        node.add_post_set_parameters_callback(self._on_parameters)
        for service in (self.start, self.stop, self.reset, self.emergency_stop):
            node.serve(service.__name__, service)

    def start(self) -> str:
        """Turn, or continue to turn."""
        if self._program.halted:
            raise RunError("emergency stop: allowed: reset, then start")
        self._program.run(True)
        self.save()
        self._node.turn()
        return "the cam turns"

    def stop(self) -> str:
        """Hold after the present tick; rig time stands with the cam."""
        self._program.run(False)
        self.save()
        return f"stopped after {self._program.sent} states"

    def reset(self) -> str:
        """Back to the beginning of the scene, stopped; rig time and θ continue."""
        self._program.reset()
        self._node.set_parameters([Parameter("rpm", value=0.0)])
        return "at the beginning of the scene"

    def emergency_stop(self) -> str:
        """Stand still at the end of the present tick, until a reset."""
        if (state := self._program.halt()) is not None:
            self._send(state)
        self.save()
        return "the cam stands; reset, then start, to go on"

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "rpm":
                self._program.command(parameter.value * RPM)
            elif parameter.name == "pacing":
                self._set_pacing(parameter.value)
        self.save()

    def mounted(self, cam: str) -> None:
        """The law server has mounted a cam."""
        self._program.mounted(cam)
        self.save()

    def save(self) -> None:
        """Save the commands as they are now."""
        program, pacing = self._program, self._node.get_parameter("pacing").value
        self._kept.save(OperatorCommands(program.schedule.state, program.running, pacing))

    def _refuse(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse a speed whose ticks would have too few or too many samples."""
        try:
            for parameter in (p for p in parameters if p.name == "rpm"):
                self._program.require_speed(parameter.value * RPM)
        except RefusedError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_rpm(self, message: Any) -> None:
        command = [Parameter("rpm", value=float(message.data))]
        result = self._node.set_parameters(command)[0]
        if not result.successful:
            raise RefusedError(f"{topics.CAM_RPM.name}: is {message.data:g}: {result.reason}")

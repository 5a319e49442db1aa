"""The drive: turns the cam through the scene's speeds, no faster than the slowest consumer."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future

from cam_rig.dynamics.kinetostatic import shaft_torque
from cam_rig.errors import RefusedError, RunError
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.live.drive import DriveProgram, OperatorCommands
from cam_rig.live.law_server import require_own_law
from cam_rig.live.queues import RepeatBudget
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, decode_law
from cam_rig.nodes.clock_source import ClockSource
from cam_rig.nodes.convert import ERROR, OK, WARN, Activity, Diagnostics
from cam_rig.nodes.rig_node import RigNode
from cam_rig.runner.node_table import held_by
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import RPM

# The operator's controls of the drive: its services, its parameters, /cam/rpm.


class DriveControls:
    """Passes operator commands on to the drive's program; ``kept`` saves them for a successor."""

    def __init__(self, node: CamDrive, kept: Checkpoint) -> None:
        self._node, self._program, self._kept = node, node.program, kept
        node.check(rpm=lambda rpm: node.program.require_speed(rpm * RPM))
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
            self._node.send(state)
        self.save()
        return "the cam stands; reset, then start, to go on"

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "rpm":
                self._program.command(parameter.value * RPM)
            elif parameter.name == "pacing":
                self._node.set_pacing(parameter.value)
        self.save()

    def mounted(self, cam: str) -> None:
        """The law server has mounted a cam."""
        self._program.mounted(cam)
        self.save()

    def save(self) -> None:
        """Save the commands as they are now."""
        program, pacing = self._program, self._node.get_parameter("pacing").value
        self._kept.save(OperatorCommands(program.schedule.state, program.running, pacing))

    def _on_rpm(self, message: Any) -> None:
        command = [Parameter("rpm", value=float(message.data))]
        result = self._node.set_parameters(command)[0]
        if not result.successful:
            raise RefusedError(f"{topics.CAM_RPM.name}: is {message.data:g}: {result.reason}")


# The law server as the drive sees it: requests for cams, and reports of mounted ones.

#: Of the drive's own namespace.
LAW_SERVER = "law_server"


class LawServerClient:
    """Calls the law server; ``refused`` takes a cam that it refuses, and the reason."""

    def __init__(self, node: RigNode, refused: Callable[[str, str], None]) -> None:
        self._node, self._refused = node, refused
        self._client = AsyncParameterClient(node, LAW_SERVER)

    def request(self, cam: str) -> bool:
        """Request a cam; False while the law server's services are not there."""
        if not self._client.services_are_ready():
            return False
        future = self._client.set_parameters([Parameter("cam", value=cam)])
        future.add_done_callback(lambda done: self._on_reply(cam, done))
        return True

    def _on_reply(self, cam: str, future: Future) -> None:
        response = future.result()
        if response is not None and not response.results[0].successful:
            self._refused(cam, response.results[0].reason)

    def on_mounted(self, expected: Callable[[str], bool], mounted: Callable[[str], None]) -> None:
        """Call ``mounted`` with each cam that is mounted from now on, as requested or overridden.

        Any program can publish a parameter event. One that is not ``expected`` counts only when the
        law server itself confirms it.
        """
        server = f"{self._node.get_namespace().rstrip('/')}/{LAW_SERVER}"

        def on_event(event: ParameterEvent) -> None:
            if event.node == server:
                for changed in (p for p in event.changed_parameters if p.name == "cam"):
                    cam = str(parameter_value_to_python(changed.value))
                    if expected(cam):
                        mounted(cam)
                    else:
                        self._verify(cam, mounted)

        self._node.subscribe(topics.PARAMETER_EVENTS, on_event)

    def _verify(self, cam: str, mounted: Callable[[str], None]) -> None:
        def on_reply(future: Future) -> None:
            response = future.result()
            values = [] if response is None else [value.string_value for value in response.values]
            if values == [cam]:
                mounted(cam)
            else:
                words = f"{topics.PARAMETER_EVENTS.name}: {cam!r} is not mounted"
                self._node.refuse(RefusedError(words))

        if self._client.services_are_ready():
            self._client.get_parameters(["cam"]).add_done_callback(on_reply)


#: /clock of a paced run, Hz at least: so that a busy machine's has 100.
CLOCK_HZ = 125.0


class CamDrive(ClockSource):
    """Publishes /cam/state and /clock, and requests each cam from the law server in turn."""

    def __init__(self) -> None:
        super().__init__("cam_drive")
        self._loaded = open_scene(Path(self.given["scene"]))
        self._mechanics, self._repeats = self._loaded.follower, RepeatBudget()
        self._pace = Diagnostics(self.publisher(topics.DIAGNOSTICS), topics.PACE)
        self._between = self.every(1.0 / CLOCK_HZ, self._tell_time)
        checkpoints = self.restore()
        consumers = [*self.given["consumers"], LAW_SERVER]
        server = LawServerClient(self, self._on_refused)
        kept = Checkpoint(self.given["checkpoint"], "commands")
        commands = kept.newest()
        self.program = DriveProgram(
            self._loaded.scene, consumers, server.request, checkpoints, commands
        )
        if commands is not None:
            self.set_parameters([Parameter("pacing", value=commands.pacing)])
        self.set_pacing(self.get_parameter("pacing").value)
        if checkpoints:
            self._take_over(checkpoints[-1].state)
        if not checkpoints and commands is None:
            self.program.running = self.given["autostart"] and self.runs_before == 0
            self.program.command(self.given["rpm"] * RPM)
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        controls = DriveControls(self, kept)
        server.on_mounted(self.program.expects, controls.mounted)
        self.begin(consumers, self.program.flow)

    def set_pacing(self, pacing: str) -> None:
        """Set the pacing from the next state on."""
        self.program.pacing.set(pacing)
        factor = self.program.pacing.factor
        self.publish_factor(factor)
        if factor is None:
            self._between.cancel()
        else:
            self._between.reset()

    def _take_over(self, last: CamState) -> None:
        """Go on from a predecessor's last state; /clock may have come close to the next one's."""
        self.newest_ns, self.clock_ns = last.time_ns, last.time_ns - 1
        following = self.program.schedule.next_state
        if self.program.pacing.factor is not None and following is not None:
            self.clock_ns = following.time_ns - 1

    def _tell_time(self) -> None:
        """Let rig time go on between two states."""
        time_ns = self.program.time_ns(time.monotonic())
        if time_ns is not None and not self.done.done():
            self.publish_time(time_ns)

    def _on_refused(self, cam: str, reason: str) -> None:
        self.program.refused(cam)
        self.refuse(RefusedError(f"cam {cam!r}: the law server refuses it ({reason})"))

    def _on_law(self, message: Any) -> None:
        law = decode_law(*array_of(message))
        require_own_law(self._loaded, law)
        self.program.laws[law.name] = law
        self.turn()

    def next_due(self) -> float:
        """Wall time (s) until the next state is due."""
        return self.program.wait(time.monotonic())

    def send_next(self) -> bool:
        """Send the next state, when it may go out now."""
        if (state := self.program.take(time.monotonic())) is None:
            return False
        self.send(state)
        return True

    def send(self, state: CamState) -> None:
        """Send a state for the first time."""
        self.save(self.program.checkpoint, state.time_ns)
        level, words = OK, "turning" if state.speed else "stands"
        if self.program.halted and state.speed == 0.0:
            level, words = ERROR, "emergency stop"
        self.health.report(state.time_ns, level, words)
        if late := self.program.pacing.late:
            self._pace.report(state.time_ns, WARN, "lagging", {"late_s": f"{late:.3g}"})
        elif self.program.pacing.factor is not None:
            self._pace.report(state.time_ns, OK, "on time")
        self._repeats.publish()
        self._publish(state)
        self.note_sent(state, self.program.sent - 1)

    def _publish(self, state: CamState) -> None:
        law = self.program.laws[state.cam]
        self.publish_state(state, shaft_torque(law, self._mechanics, state.angle, state.speed))
        if self.program.pacing.factor is not None:
            self._between.reset()  # /clock goes on by itself only where states are farther apart

    def resend(self) -> None:
        """Send the states in flight once more."""
        for state in self.program.unanswered():
            if self._repeats.repeat():
                self._publish(state)

    def is_done(self) -> bool:
        """Whether every state is sent and every tick acknowledged."""
        return self.program.done

    def is_idle(self) -> bool:
        """Whether no node is waited for: stopped, or held back by the pacing."""
        program = self.program
        stands = not program.running and program.flow.in_flight == 0
        return stands or self.next_due() > 0.0

    def get_parameter(self, name: str) -> Parameter:
        """The value that was set; of ``rpm``, the speed of the last state."""
        found: Parameter = super().get_parameter(name)
        return Parameter(name, value=round(self.speed.rpm, 9)) if name == "rpm" else found

    @property
    def is_commanded(self) -> bool:
        """Whether the cam turns at a commanded speed."""
        return self.program.schedule.state.speed is not None

    def activity(self) -> Activity:
        """What the node does now."""
        if self.program.halted:
            return Activity("emergency", (), "emergency stop, waiting for ~/reset")
        if self._awaited or self.program.running:
            return super().activity()
        return Activity("stopped", (), "stopped, waiting for ~/start")

    def stuck(self) -> str:
        """What is missing, in words."""
        program = self.program
        behind = held_by(program.flow.behind() or [LAW_SERVER])
        return f"{program.sent} of {program.ticks + 1} states from: {behind}"

"""The drive: turns the cam through the scene's speeds, no faster than the slowest listens."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import qos_profile_parameter_events

from cam_rig.bag import topics
from cam_rig.bag.codec import array_of, decode_law
from cam_rig.dynamics.torque import shaft_torque
from cam_rig.errors import RefusedError, RunError
from cam_rig.experiment.drive import DriveProgram
from cam_rig.experiment.handover import TICKS_IN_FLIGHT
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import open_stage
from cam_rig.nodes.app import run
from cam_rig.nodes.diagnostics import ERROR, OK, WARN, Diagnostics
from cam_rig.nodes.pacemaker import Pacemaker

RPM = math.pi / 30.0
#: Of the drive's own namespace.
LAW_SERVER = "law_server"


class CamDrive(Pacemaker):
    """Publishes /cam/state and /clock, and asks the law server for each cam in turn."""

    def __init__(self) -> None:
        super().__init__("cam_drive")
        stage = open_stage(Path(self.given["scene"]))
        self._mechanics = stage.follower
        self._pace = Diagnostics(self.publisher(topics.DIAGNOSTICS), topics.PACE)
        self._law_server = AsyncParameterClient(self, LAW_SERVER)
        left = self.handover.all()
        memories = [memory for memory, _ in left]
        if left:  # a diagnosis may have died with its speaker: the last states' are said again
            _, self.health.said = left[0]
        waits = list(self.given["consumers"])
        self._program = DriveProgram(stage.scene, waits, TICKS_IN_FLIGHT, self._ask_for, memories)
        self._program.pacing.set(self.given["pacing"])
        if not memories:
            self._program.running = self.given["autostart"]
            self._program.command(self.given["rpm"] * RPM)
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        self.subscribe(topics.RPM, self._on_rpm)
        events = qos_profile_parameter_events
        self.create_subscription(ParameterEvent, "/parameter_events", self._on_event, events)
        self.add_post_set_parameters_callback(self._on_parameters)
        for service in (self.start, self.stop, self.reset, self.emergency_stop):
            self.serve(service.__name__, service)
        self.set_going(waits, self._program.credit, alone=not memories)

    def start(self) -> str:
        """Turn, or go on turning."""
        if self._program.table.place.halted:
            raise RunError("emergency stop: allowed: reset, then start")
        self._program.run(True)
        self.turn()
        return "the cam turns"

    def stop(self) -> str:
        """Hold after the present tick; rig time stands with the cam."""
        self._program.run(False)
        return f"stopped after {self._program.sent} states"

    def reset(self) -> str:
        """Back to the beginning of the scene, stopped; rig time and θ go on."""
        self._program.reset()
        self.set_parameters([Parameter("rpm", value=0.0)])
        return "at the beginning of the scene"

    def emergency_stop(self) -> str:
        """Stand still at the end of the present tick, until a reset."""
        if (state := self._program.halt()) is not None:
            self._send(state)
        return "the cam stands; reset, then start, to go on"

    def _ask_for(self, cam: str) -> bool:
        if not self._law_server.services_are_ready():
            return False
        self._law_server.set_parameters([Parameter("cam", value=cam)])
        return True

    def _on_event(self, event: ParameterEvent) -> None:
        """Somebody mounted a cam by hand, or the law server did as asked."""
        if event.node == f"{self.get_namespace().rstrip('/')}/{LAW_SERVER}":
            for changed in (p for p in event.changed_parameters if p.name == "cam"):
                self._program.mounted(str(parameter_value_to_python(changed.value)))

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "rpm":
                self._program.command(parameter.value * RPM)
            elif parameter.name == "pacing":
                self._program.pacing.set(parameter.value)

    def _on_rpm(self, message: Any) -> None:
        result = self.set_parameters([Parameter("rpm", value=float(message.data))])[0]
        if not result.successful:
            raise RefusedError(f"{topics.RPM.name}: is {message.data:g}: {result.reason}")

    def _on_law(self, message: Any) -> None:
        self._program.add_law(decode_law(*array_of(message)))
        self.turn()

    def next_due(self) -> float:
        """Wall time (s) until the next state is due."""
        return self._program.wait(time.monotonic())

    def send_next(self) -> bool:
        """Send the next state, when it may go out now."""
        if (state := self._program.take(time.monotonic())) is None:
            return False
        self._send(state)
        return True

    def _send(self, state: CamState) -> None:
        self.handover.keep((self._program.memory, self.health.said), state.time_ns)
        level, words = OK, "turning" if state.speed else "stands"
        if self._program.table.place.halted and state.speed == 0.0:
            level, words = ERROR, "emergency stop"
        self.health.report(state.time_ns, level, words)
        if late := self._program.pacing.late:
            self._pace.report(state.time_ns, WARN, "lagging", {"late_s": f"{late:.3g}"})
        elif self._program.pacing.factor is not None:
            self._pace.report(state.time_ns, OK, "on time")
        self._publish(state)
        self.note_sent(state, self._program.sent - 1)

    def _publish(self, state: CamState) -> None:
        law = self._program.laws[state.cam]
        self.publish_state(state, shaft_torque(law, self._mechanics, state.angle, state.speed))

    def say_again(self) -> None:
        """Send the states in flight once more."""
        for state in self._program.unanswered():
            self._publish(state)

    def is_done(self) -> bool:
        """Whether every state is sent and every tick dealt with."""
        return self._program.done

    def is_idle(self) -> bool:
        """Whether nobody is waited for: stopped, or held by the pace."""
        program = self._program
        stands = not program.running and program.credit.in_flight == 0
        return stands or self.next_due() > 0.0

    def stuck(self) -> str:
        """What is missing, in words."""
        program = self._program
        return (
            f"{program.sent} of {program.ticks + 1} states from: {', '.join(program.waits_for())}"
        )


def main() -> None:
    """Entry point of the executable."""
    run(CamDrive)


if __name__ == "__main__":
    main()

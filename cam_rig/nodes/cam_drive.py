"""The drive: turns the cam through the scene's speeds, no faster than the slowest listens."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from rclpy.parameter import Parameter

from cam_rig.dynamics.kinetostatic import shaft_torque
from cam_rig.errors import RefusedError
from cam_rig.live.cam_check import require_own_law
from cam_rig.live.checkpoint import TICKS_IN_FLIGHT, Handover
from cam_rig.live.drive import DriveProgram
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, decode_law
from cam_rig.nodes.common.clock_source import Pacemaker
from cam_rig.nodes.common.diagnostics import ERROR, OK, WARN, Diagnostics
from cam_rig.nodes.common.drive_controls import Controls
from cam_rig.nodes.common.law_server_client import LAW_SERVER, LawServerClient
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import RPM


class CamDrive(Pacemaker):
    """Publishes /cam/state and /clock, and asks the law server for each cam in turn."""

    def __init__(self) -> None:
        super().__init__("cam_drive")
        self._loaded = open_scene(Path(self.given["scene"]))
        self._mechanics = self._loaded.follower
        self._pace = Diagnostics(self.publisher(topics.DIAGNOSTICS), topics.PACE)
        left = self.handover.all()
        memories = [memory for memory, _ in left]
        self.clock_ns = memories[-1].state.time_ns if memories else -1
        if left:  # a diagnosis may have died with its speaker: the last states' are said again
            _, self.health.said = left[0]
        waits = [*self.given["consumers"], LAW_SERVER]
        server = LawServerClient(self, self._on_refused)
        given = Handover(self.given["handover"], "orders")
        orders = given.newest()
        self._program = DriveProgram(
            self._loaded.scene, waits, TICKS_IN_FLIGHT, server.ask_for, memories, orders
        )
        if orders is not None:
            asked = {"rpm": orders.rpm, "pacing": orders.pacing}
            self.set_parameters([Parameter(name, value=value) for name, value in asked.items()])
        self._program.pacing.set(self.get_parameter("pacing").value)
        if not memories and orders is None:
            self._program.running = self.given["autostart"]
            self._program.command(self.given["rpm"] * RPM)
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        controls = Controls(self, self._program, self._send, given)
        server.tell(self._program.expects, controls.mounted)
        self.set_going(waits, self._program.credit)

    def _on_refused(self, cam: str, reason: str) -> None:
        self._program.refused(cam)
        self.refuse(RefusedError(f"cam {cam!r}: the law server has none ({reason})"))

    def _on_law(self, message: Any) -> None:
        law = decode_law(*array_of(message))
        require_own_law(self._loaded, law)
        self._program.add_law(law)
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
        if self._program.halted and state.speed == 0.0:
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

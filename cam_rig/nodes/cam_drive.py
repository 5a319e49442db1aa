"""The drive: turns the cam through the scene's speeds, no faster than the slowest listens."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from typing import Any

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rosgraph_msgs.msg import Clock

from cam_rig.bag import topics
from cam_rig.bag.codec import array_of, decode_law
from cam_rig.dynamics.torque import shaft_torque
from cam_rig.errors import CamRigError, ConfigError, RunError
from cam_rig.experiment.drive import DriveProgram
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import open_stage
from cam_rig.nodes.app import RigNode, run
from cam_rig.nodes.convert import stamp_ns, to_header, to_joint_state, to_time
from cam_rig.nodes.parameters import declare_flag, declare_names, declare_number, declare_scene

#: Who may be waited for, and the stamped topic that shows how far each is.
ACKNOWLEDGES = {
    "follower": topics.FOLLOWER_STATE,
    "microphone": topics.PRESSURE,
    "recorder": topics.RECORDED,
}


class CamDrive(RigNode):
    """Publishes /cam/state and /clock, and asks the law server for each cam in turn."""

    def __init__(self) -> None:
        super().__init__("cam_drive")
        stage = open_stage(declare_scene(self))
        consumers = declare_names(self, "consumers", list(ACKNOWLEDGES), "nodes to wait for")
        self._talk = declare_flag(self, "report_progress", False, "a JSON line a tick on stdout")
        self._patience = declare_number(
            self, "patience", 20.0, "wall time without progress before giving up, s"
        )
        self._mechanics = stage.follower
        self._moved = time.monotonic()
        self._clock_out, self._state_out = map(self.publisher, (topics.CLOCK, topics.CAM_STATE))
        self._law_server = AsyncParameterClient(self, "law_server")
        self._program = DriveProgram(stage.scene, consumers, topics.TICKS_IN_FLIGHT, self._mount)
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        unknown = set(consumers) - set(ACKNOWLEDGES)
        if unknown:
            raise ConfigError(
                f"consumers: has {', '.join(sorted(unknown))}; allowed: {', '.join(ACKNOWLEDGES)}"
            )
        for name in consumers:
            self.subscribe(ACKNOWLEDGES[name], self._on_acknowledge(name))
        self.create_timer(0.1, self._turn)

    def _mount(self, cam: str) -> bool:
        if not self._law_server.services_are_ready():
            return False
        self._law_server.set_parameters([Parameter("cam", value=cam)])
        return True

    def _on_law(self, message: Any) -> None:
        try:
            law = decode_law(*array_of(message))
        except CamRigError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        self._program.laws[law.name] = law
        self._turn()

    def _on_acknowledge(self, name: str) -> Callable[[Any], None]:
        def acknowledge(message: Any) -> None:
            header = message.header if hasattr(message, "header") else message
            self._program.credit.acknowledge(name, stamp_ns(header.stamp))
            self._moved = time.monotonic()
            self._turn()

        return acknowledge

    def _turn(self) -> None:
        """Send what may be sent now."""
        self._require_one_drive()
        while not self.done.done() and (state := self._program.take()) is not None:
            self._send(state)
        if self._program.done:
            self.finish()
        elif time.monotonic() - self._moved > self._patience:
            self.fail(
                RunError(
                    f"no answer for {self._patience:g} s after {self._program.sent} of "
                    f"{self._program.ticks + 1} states from: "
                    f"{', '.join(self._program.waits_for())}; is it running?"
                )
            )

    def _send(self, state: CamState) -> None:
        law = self._program.laws[state.cam]
        torque = shaft_torque(law, self._mechanics, state.angle, state.speed)
        header = to_header(state.time_ns, state.cam)
        self._clock_out.publish(Clock(clock=to_time(state.time_ns)))
        self._state_out.publish(to_joint_state("cam", header, state.angle, state.speed, torque))
        self._moved = time.monotonic()
        if self._talk:
            done = {"tick": self._program.sent - 1, "cam": state.cam}
            print(json.dumps(done | {"rpm": state.speed * 30.0 / math.pi}), flush=True)

    def _require_one_drive(self) -> None:
        others = self.count_publishers(topics.CAM_STATE.name) - 1
        if others > 0:
            self.fail(
                RunError(
                    f"{others} more on {topics.CAM_STATE.name} in this ROS domain; allowed: one "
                    "drive; set ROS_DOMAIN_ID to another number"
                )
            )


def main() -> None:
    """Entry point of the executable."""
    run(CamDrive)


if __name__ == "__main__":
    main()

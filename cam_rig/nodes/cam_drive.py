"""The drive: turns the cam through the scene's speeds, no faster than the slowest listens."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from cam_rig.bag import topics
from cam_rig.bag.codec import array_of, decode_law
from cam_rig.dynamics import NS
from cam_rig.dynamics.torque import shaft_torque
from cam_rig.errors import RunError
from cam_rig.experiment.credit import Credit
from cam_rig.experiment.program import CamState, cam_states, tick_count
from cam_rig.experiment.stage import open_stage
from cam_rig.laws import Law
from cam_rig.nodes.app import RigNode, run
from cam_rig.nodes.convert import message_class, qos, to_header, to_joint_state, to_time
from cam_rig.nodes.parameters import declare_flag, declare_names, declare_scene

#: Who may be waited for, and the stamped topic that shows how far each is.
ACKNOWLEDGES = {
    "follower": topics.FOLLOWER_STATE,
    "microphone": topics.PRESSURE,
    "recorder": topics.RECORDED,
}
#: Wall time (s) without any progress after which the drive gives up.
PATIENCE = 20.0


class CamDrive(RigNode):
    """Publishes /cam/state and /clock, and asks the law server for each cam in turn."""

    def __init__(self) -> None:
        super().__init__("cam_drive")
        stage = open_stage(declare_scene(self))
        consumers = declare_names(self, "consumers", list(ACKNOWLEDGES), "nodes to wait for")
        self._talk = declare_flag(self, "report_progress", False, "a JSON line a tick on stdout")
        self._parameters, self._total = stage.follower, tick_count(stage.scene)
        self._states, self._next = cam_states(stage.scene), None
        self._credit = Credit(consumers, topics.TICKS_IN_FLIGHT)
        self._laws: dict[str, Law] = {}
        self._asked, self._count, self._moved = "", -1, time.monotonic()
        self._out = {
            topic: self.create_publisher(message_class(topic), topic.name, qos(topic))
            for topic in (topics.CLOCK, topics.CAM_STATE)
        }
        self._law_server = AsyncParameterClient(self, "law_server")
        law = topics.LAW_COEFFICIENTS
        self.create_subscription(Float64MultiArray, law.name, self._on_law, qos(law))
        for name in consumers:
            topic = ACKNOWLEDGES[name]
            self.create_subscription(
                message_class(topic), topic.name, self._on_acknowledge(name), qos(topic)
            )
        self.create_timer(0.1, self._turn)

    def _on_law(self, message: Float64MultiArray) -> None:
        law = decode_law(*array_of(message))
        self._laws[law.name] = law
        self._turn()

    def _on_acknowledge(self, name: str) -> Callable[[Any], None]:
        def acknowledge(message: Any) -> None:
            stamp = (message.header if hasattr(message, "header") else message).stamp
            self._credit.acknowledge(name, stamp.sec * NS + stamp.nanosec)
            self._moved = time.monotonic()
            self._turn()

        return acknowledge

    def _turn(self) -> None:
        """Send what may be sent: each state needs credit and the law of its cam."""
        while not self.done.done():
            self._next = self._next or next(self._states, None)
            if self._next is None:
                return self._wait_for_the_last()
            if not self._ready(self._next) or not self._credit.may_send():
                return self._check_patience()
            self._send(self._next)
            self._next = None

    def _ready(self, state: CamState) -> bool:
        """Whether the state's cam is mounted; a change of cam waits until all is dealt with."""
        if state.cam != self._asked:
            if self._credit.in_flight or not self._law_server.services_are_ready():
                return False
            self._law_server.set_parameters([Parameter("cam", value=state.cam)])
            self._asked = state.cam
        return state.cam in self._laws

    def _send(self, state: CamState) -> None:
        header = to_header(state.time_ns, state.cam)
        torque = shaft_torque(self._laws[state.cam], self._parameters, state.angle, state.speed)
        self._out[topics.CLOCK].publish(Clock(clock=to_time(state.time_ns)))
        self._out[topics.CAM_STATE].publish(
            to_joint_state("cam", header, state.angle, state.speed, torque)
        )
        self._credit.sent(state.time_ns)
        self._count, self._moved = self._count + 1, time.monotonic()
        if self._talk:
            line = {"tick": self._count, "ticks": self._total, "cam": state.cam}
            print(json.dumps(line | {"rpm": state.speed * 30 / 3.141592653589793}), flush=True)

    def _wait_for_the_last(self) -> None:
        if self._credit.in_flight == 0:
            self.finish()
        else:
            self._check_patience()

    def _check_patience(self) -> None:
        others = self.count_publishers(topics.CAM_STATE.name) - 1
        if others > 0:
            self.fail(
                RunError(
                    f"{others} more on {topics.CAM_STATE.name} in this ROS domain; allowed: one "
                    "drive; set ROS_DOMAIN_ID to another number"
                )
            )
        elif time.monotonic() - self._moved > PATIENCE:
            missing = ", ".join(self._credit.behind()) or "law_server"
            self.fail(
                RunError(
                    f"no answer for {PATIENCE:g} s at tick {self._count} of {self._total} "
                    f"from: {missing}; is it running?"
                )
            )


def main() -> None:
    """Entry point of the executable."""
    run(CamDrive)


if __name__ == "__main__":
    main()

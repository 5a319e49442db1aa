"""The follower: takes the cam's states, publishes how the follower moved between them."""

from __future__ import annotations

from collections import deque
from typing import Any

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from cam_rig.bag import topics
from cam_rig.bag.codec import array_of, decode_law, encode_block
from cam_rig.dynamics import Block, FollowerState
from cam_rig.errors import CamRigError
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import open_stage
from cam_rig.experiment.sweep import FollowerBench
from cam_rig.nodes.app import RigNode, run
from cam_rig.nodes.convert import (
    message_class,
    qos,
    to_array,
    to_cam_state,
    to_header,
    to_joint_state,
)
from cam_rig.nodes.parameters import declare_scene


class Follower(RigNode):
    """Publishes /follower/samples, /follower/contact and /follower/state for each tick."""

    def __init__(self) -> None:
        super().__init__("follower")
        self._bench = FollowerBench.of(open_stage(declare_scene(self)))
        self._bench.laws.clear()  # the law server's word counts, not the file
        self._waiting: deque[CamState] = deque()
        wanted = (topics.FOLLOWER_SAMPLES, topics.FOLLOWER_CONTACT, topics.FOLLOWER_STATE)
        self._out: dict[topics.Topic, Any] = {
            topic: self.create_publisher(message_class(topic), topic.name, qos(topic))
            for topic in wanted
        }
        law, state = topics.LAW_COEFFICIENTS, topics.CAM_STATE
        self.create_subscription(Float64MultiArray, law.name, self._on_law, qos(law))
        self.create_subscription(JointState, state.name, self._on_state, qos(state))

    def _on_law(self, message: Float64MultiArray) -> None:
        try:
            law = decode_law(*array_of(message))
        except CamRigError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
            return
        self._bench.laws[law.name] = law
        self._turn()

    def _on_state(self, message: JointState) -> None:
        self._waiting.append(to_cam_state(message))
        self._turn()

    def _turn(self) -> None:
        """Take all ticks whose cam is known, in order; law and state come on two topics."""
        while self._waiting and self._waiting[0].cam in self._bench.laws:
            state = self._waiting.popleft()
            turned = self._bench.turn_to(state)
            if turned is not None:
                self._publish(state, *turned)

    def _publish(self, end: CamState, state: FollowerState, block: Block) -> None:
        header = to_header(end.time_ns, "follower")
        self._out[topics.FOLLOWER_SAMPLES].publish(to_array(*encode_block(block.rows)))
        contact = WrenchStamped(header=header)
        contact.wrench.force.y = float(state.contact_force)
        self._out[topics.FOLLOWER_CONTACT].publish(contact)
        motion = (state.displacement, state.velocity, state.contact_force)
        self._out[topics.FOLLOWER_STATE].publish(to_joint_state("follower", header, *motion))


def main() -> None:
    """Entry point of the executable."""
    run(Follower)


if __name__ == "__main__":
    main()

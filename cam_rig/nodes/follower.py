"""The follower: takes the cam's states, publishes how the follower moved between them."""

from __future__ import annotations

import math
from collections import deque

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
from cam_rig.nodes.convert import to_array, to_cam_state, to_header, to_joint_state
from cam_rig.nodes.diagnostics import OK, WARN, Diagnostics
from cam_rig.nodes.parameters import declare_scene


class Follower(RigNode):
    """Publishes /follower/samples, /follower/contact and /follower/state for each tick."""

    def __init__(self) -> None:
        super().__init__("follower")
        self._bench = FollowerBench.of(open_stage(declare_scene(self)))
        self._bench.laws.clear()  # the law server's word counts, not the file
        self._waiting: deque[CamState] = deque()
        self._samples, self._contact, self._state = map(
            self.publisher,
            (topics.FOLLOWER_SAMPLES, topics.FOLLOWER_CONTACT, topics.FOLLOWER_STATE),
        )
        self._health = Diagnostics(self.publisher(topics.DIAGNOSTICS), "follower")
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        self.subscribe(topics.CAM_STATE, self._on_state)

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
            try:
                turned = self._bench.turn_to(state)
            except CamRigError as error:
                return self.fail(error)
            if turned is not None:
                self._publish(state, *turned)

    def _publish(self, end: CamState, state: FollowerState, block: Block) -> None:
        header = to_header(end.time_ns, "follower")
        self._samples.publish(to_array(*encode_block(block.rows)))
        contact = WrenchStamped(header=header)
        contact.wrench.force.y = float(state.contact_force)
        self._contact.publish(contact)
        motion = (state.displacement, state.velocity, state.contact_force)
        self._state.publish(to_joint_state("follower", header, *motion))
        lost = bool(block.events) or not state.in_contact
        values = {"rpm": f"{block.interval.speed * 30.0 / math.pi:.6g}"}
        words = "contact lost" if lost else "in contact"
        self._health.report(end.time_ns, WARN if lost else OK, words, values)


def main() -> None:
    """Entry point of the executable."""
    run(Follower)


if __name__ == "__main__":
    main()

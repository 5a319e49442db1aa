"""The follower: takes the cam's states, publishes the follower's motion between them."""

from __future__ import annotations

import time
from pathlib import Path

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from cam_rig.dynamics import Block, FollowerState
from cam_rig.errors import DynamicsError
from cam_rig.live.law_server import require_own_law
from cam_rig.live.playback import Tick
from cam_rig.live.queues import FollowerQueue
from cam_rig.live.state_validation import Admission
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, cam_state_of, decode_law, encode_block
from cam_rig.messages.motion import OF_FOLLOWER, MotionMessages
from cam_rig.nodes.convert import OK, WARN, ResendBuffer, to_array, to_header, to_joint_state
from cam_rig.nodes.motion_publisher import MotionPublisher
from cam_rig.nodes.rig_node import RigNode
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerSimulator
from cam_rig.units import to_rpm


class Follower(RigNode):
    """Publishes /follower/samples and /follower/state for each tick, and its motion for people."""

    waits_for = "cam_drive and law_server"

    def __init__(self) -> None:
        super().__init__("follower")
        self._loaded = open_scene(Path(self.given["scene"]))
        simulator = FollowerSimulator.of(self._loaded)
        simulator.laws.clear()  # the law that the law server publishes counts, not the file's
        predecessor = next(iter(self.restore()), None)
        self._ticks = FollowerQueue(simulator, self._loaded.scene, predecessor)
        self.save(self._ticks.checkpoint, -1)  # to go back to before the first tick
        out = (topics.FOLLOWER_SAMPLES, topics.FOLLOWER_STATE)
        self._out, self._sent = [self.publisher(topic) for topic in out], ResendBuffer()
        points = self.given["points_per_turn"] or self._loaded.scene.points_per_turn
        motion, rate = MotionMessages(self._loaded, points, OF_FOLLOWER), self.given["motion_rate"]
        self._motion, self._came = MotionPublisher(self, motion, points, rate), 0.0
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        self.subscribe(topics.CAM_STATE, self._on_state)
        self.get_logger().info(self.activity())

    def _on_law(self, message: Float64MultiArray) -> None:
        law = decode_law(*array_of(message))
        require_own_law(self._loaded, law)
        self._ticks.add_law(law)
        self._turn()

    def _on_state(self, message: JointState) -> None:
        state, self._came = cam_state_of(message), time.monotonic()
        if self._ticks.add_state(state) is Admission.SEEN:
            self._sent.resend(state.time_ns)
        self._turn()

    def _turn(self) -> None:
        try:
            for start, end, state, block in self._ticks.complete():
                self.ticks += 1
                self._motion.publish(Tick(start, end, block.rows), self._came)
                self._publish(end, state, block)
                self.save(self._ticks.checkpoint, end.time_ns)
        except DynamicsError as error:
            self.fail(error)

    def _publish(self, end: CamState, state: FollowerState, block: Block) -> None:
        lost = bool(block.events) or not state.in_contact
        values = {"rpm": f"{to_rpm(block.interval.speed):.6g}"}
        words = "contact lost" if lost else "in contact"
        self.health.report(end.time_ns, WARN if lost else OK, words, values)
        header = to_header(end.time_ns, "follower")
        motion = (state.displacement, state.velocity, state.contact_force)
        messages = (
            to_array(*encode_block(block.rows)),
            to_joint_state("follower", header, *motion),
        )
        self._sent.publish(end.time_ns, list(zip(self._out, messages, strict=True)))

    def close(self) -> None:
        """End with what is shown."""
        self._motion.close()

"""Follower node: computes the follower's motion and contact force in each tick."""

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
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, cam_state_of, decode_law, encode_block
from cam_rig.messages.motion import FOLLOWER_TOPICS, MotionMessages
from cam_rig.nodes.base.diagnostics import OK, WARN
from cam_rig.nodes.base.rig_node import RigNode
from cam_rig.nodes.convert import to_array, to_header, to_joint_state
from cam_rig.nodes.motion_publisher import MotionPublisher
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState, tick_count
from cam_rig.simulation.simulate import FollowerSimulator
from cam_rig.units import to_rpm


class Follower(RigNode):
    """Publishes the follower's samples, state and displayed motion for each tick.

    A tick is the time between two cam states.
    """

    waits_for = ("cam_drive", "law_server")

    def __init__(self) -> None:
        super().__init__("follower")
        self._loaded = open_scene(Path(self.settings["scene"]))
        self.total_ticks = tick_count(self._loaded.scene)
        simulator = FollowerSimulator.of(self._loaded)
        simulator.laws.clear()  # the simulator uses the laws that the law server publishes
        self._queue = FollowerQueue(simulator, self._loaded.scene)
        self._samples_publisher = self.advertise(topics.FOLLOWER_SAMPLES)
        self._state_publisher = self.advertise(topics.FOLLOWER_STATE)
        points = self.settings["samples_per_turn"] or self._loaded.scene.samples_per_turn
        prefix = self.settings["frame_prefix"]
        messages = MotionMessages(self._loaded, points, FOLLOWER_TOPICS, prefix)
        self._motion = MotionPublisher(self, messages, points, self.settings["visualization_rate"])
        self._state_received_at = 0.0
        self.subscribe(topics.LAW_COEFFICIENTS, self._on_law)
        self.subscribe(topics.CAM_STATE, self._on_state)
        self.get_logger().info(self.activity().text)

    def _on_law(self, message: Float64MultiArray) -> None:
        law = decode_law(*array_of(message))
        require_own_law(self._loaded, law)
        self._queue.add_law(law)
        self._process_ticks()

    def _on_state(self, message: JointState) -> None:
        self._state_received_at = time.monotonic()
        self._queue.add_state(cam_state_of(message))
        self._process_ticks()

    def _process_ticks(self) -> None:
        try:
            for start, end, state, block in self._queue.complete():
                self.ticks += 1
                self._motion.publish(Tick(start, end, block.rows), self._state_received_at)
                self._publish(end, state, block)
        except DynamicsError as error:
            self.fail(error)

    def _publish(self, end: CamState, state: FollowerState, block: Block) -> None:
        is_lost = bool(block.events) or not state.in_contact
        level, text = (WARN, "contact lost") if is_lost else (OK, "in contact")
        values = {"rpm": f"{to_rpm(block.interval.speed):.6g}"}
        self.diagnostics.report(end.time_ns, level, text, values)
        header = to_header(end.time_ns, "follower")
        motion = (state.displacement, state.velocity, state.contact_force)
        # samples first: the state acknowledges the tick to the drive
        self._samples_publisher.publish(to_array(*encode_block(block.rows)))
        self._state_publisher.publish(to_joint_state(header, follower=motion))

    def close(self) -> None:
        """Stop the playback of the motion."""
        self._motion.close()

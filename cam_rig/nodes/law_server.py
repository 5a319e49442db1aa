"""Law server node: mounts the cams and publishes their laws, contours and markers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import Point32, PolygonStamped
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cam_rig.laws import Law
from cam_rig.live.law_server import CamMounting, contour_of
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of, encode_law
from cam_rig.messages.motion import LAW_SERVER_TOPICS, MotionMessages
from cam_rig.nodes.base.diagnostics import OK
from cam_rig.nodes.base.rig_node import RigNode, progress_text
from cam_rig.nodes.convert import to_array, to_header
from cam_rig.schema import CamConfig
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState, tick_count
from cam_rig.units import TURN

#: Number of intervals per turn into which the law on /cam/law is sampled.
LAW_INTERVALS = 180


class LawServer(RigNode):
    """Mounts cams, and publishes law, contour and markers of the mounted cam.

    The topic /cam/law contains the motion over one turn at the present speed, and is published for
    each new speed. All topics are latched, so a node that subscribes later receives the mounted
    cam.
    """

    def __init__(self) -> None:
        super().__init__("law_server")
        self._law_publisher = self.advertise(topics.LAW)
        self._coefficients_publisher = self.advertise(topics.LAW_COEFFICIENTS)
        self._profile_publisher = self.advertise(topics.PROFILE)
        self._ack_publisher = self.advertise(topics.LAW_SERVER_ACK)
        self._loaded = open_scene(Path(self.settings["scene"]))
        self._states = tick_count(self._loaded.scene) + 1
        self._markers = MotionMessages(
            self._loaded, topics=LAW_SERVER_TOPICS, frame_prefix=self.settings["frame_prefix"]
        )
        self._marker_publishers = {t: self.advertise(t) for t in self._markers.topics}
        self._mounting = CamMounting(self._loaded, self.settings["cam"])
        self._publish_law()
        self.parameter_table.add_check("cam", self._mount)
        self.subscribe(topics.CAM_STATE, self._on_state)
        self.get_logger().info(self.activity().text)

    def summary(self) -> str:
        """Return the text that is logged when the node ends without an error."""
        return progress_text(self.ticks, self._states, self.ticks >= self._states, "states")

    def _mount(self, cam: Any) -> None:
        if self._mounting.request(str(cam)):
            self._publish_law()

    def _publish_law(self) -> None:
        self.get_logger().info(f"cam {self._mounting.cam} is mounted")
        law = self._mounting.law
        self._coefficients_publisher.publish(to_array(*encode_law(law)))
        self._profile_publisher.publish(to_polygon(self._loaded.cams[law.name], law))
        for topic, _, cdr in self._markers.of_cam(law.name):
            self._marker_publishers[topic].publish(cdr)

    def _on_state(self, message: JointState) -> None:
        state = cam_state_of(message)
        self._mounting.validator.validate(state)
        if (law := self._mounting.follow(state)) is not None:
            self._law_publisher.publish(to_trajectory(law, state))
        self.ticks += 1
        self.diagnostics.report(state.time_ns, OK, f"{state.cam} is mounted")
        self._ack_publisher.publish(to_header(state.time_ns))


def to_polygon(cam: CamConfig, law: Law) -> PolygonStamped:
    """Return the contour of a cam (m) in the frame of the cam.

    For conjugate cams this is the contour of the first cam.
    """
    message = PolygonStamped(header=to_header(0, law.name))
    message.polygon.points = [
        Point32(x=float(x), y=float(y), z=0.0) for x, y in contour_of(cam, law).T
    ]
    return message


def to_trajectory(law: Law, state: CamState) -> JointTrajectory:
    """Return lift (m), velocity (m/s) and acceleration (m/s²) over one cam turn.

    They are those of the law at the constant speed of `state`.
    """
    message = JointTrajectory(header=to_header(state.time_ns, law.name), joint_names=["follower"])
    angle = np.linspace(0.0, TURN, LAW_INTERVALS + 1)
    motion = np.stack([law(angle, order) * state.speed**order for order in range(3)])
    message.points = [
        JointTrajectoryPoint(
            positions=[float(s)],
            velocities=[float(v)],
            accelerations=[float(a)],
            time_from_start=Duration(seconds=float(theta / state.speed)).to_msg(),
        )
        for theta, s, v, a in zip(angle, *motion, strict=True)
    ]
    return message

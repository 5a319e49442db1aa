"""A law as pictures for people: its contour, and its course over one turn."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point32, PolygonStamped
from rclpy.duration import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cam_rig.laws import Law
from cam_rig.live.cam_check import contour_of
from cam_rig.nodes.common.convert import to_header
from cam_rig.schema import CamConfig
from cam_rig.simulation.schedule import CamState
from cam_rig.units import TURN

#: Intervals of the sampled law over one turn.
POINTS = 180


def to_polygon(cam: CamConfig, law: Law) -> PolygonStamped:
    """The cam's contour in its own frame; of conjugate cams the first."""
    message = PolygonStamped(header=to_header(0, law.name))
    message.polygon.points = [
        Point32(x=float(x), y=float(y), z=0.0) for x, y in contour_of(cam, law).T
    ]
    return message


def to_trajectory(law: Law, state: CamState) -> JointTrajectory:
    """The law over one turn at the cam's present speed."""
    message = JointTrajectory(header=to_header(state.time_ns, law.name), joint_names=["follower"])
    angle = np.linspace(0.0, TURN, POINTS + 1)
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

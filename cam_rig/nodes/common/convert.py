"""The core's types as ROS messages: stamps, states, arrays, laws."""

from __future__ import annotations

from array import array
from importlib import import_module
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point32, PolygonStamped
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cam_rig.laws import Law
from cam_rig.live.cam_check import contour_of
from cam_rig.messages.codec import CAM_JOINTS, Dimensions, cam_positions
from cam_rig.messages.topics import Topic
from cam_rig.schema import CamConfig
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN

#: Intervals of the sampled law over one turn.
LAW_POINTS = 180


def message_class(topic: Topic) -> Any:
    """The message class of a topic."""
    return getattr(import_module(f"{topic.package}.msg"), topic.message)


def qos(topic: Topic, publishers: int = 1) -> QoSProfile:
    """The one quality of service of a topic, for publishers and subscribers alike.

    ``publishers`` multiplies the depth, for the histories of so many at once.
    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        history=HistoryPolicy.KEEP_LAST,
        depth=topic.depth * publishers,
        durability=durability,
    )


def to_time(time_ns: int) -> Time:
    """Rig time in ns as a stamp."""
    return Time(sec=time_ns // NS, nanosec=time_ns % NS)


def to_header(time_ns: int, frame: str = "") -> Header:
    """A header with rig time in ns; without a frame where nothing has a place."""
    return Header(stamp=to_time(time_ns), frame_id=frame)


def to_joint_state(
    joint: str, header: Header, position: float, velocity: float, effort: float
) -> JointState:
    """One joint; floats are made plain, since rclpy does not check them."""
    return JointState(
        header=header,
        name=[joint],
        position=[float(position)],
        velocity=[float(velocity)],
        effort=[float(effort)],
    )


def to_cam_state(header: Header, state: CamState, torque: float) -> JointState:
    """The cam's state, its angle with all turns and within the turn; torque in N·m."""
    return JointState(
        header=header,
        name=list(CAM_JOINTS),
        position=[float(angle) for angle in cam_positions(state)],
        velocity=[float(state.speed)] * len(CAM_JOINTS),
        effort=[float(torque)] * len(CAM_JOINTS),
    )


def to_array(dimensions: Dimensions, data: NDArray[np.float64]) -> Float64MultiArray:
    """A labelled array as a message, without a copy an element."""
    message = Float64MultiArray()
    stride = data.size
    for label, size in dimensions:
        message.layout.dim.append(MultiArrayDimension(label=label, size=size, stride=stride))
        stride //= size
    values = array("d")
    values.frombytes(np.ascontiguousarray(data).tobytes())
    message.data = values
    return message


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
    angle = np.linspace(0.0, TURN, LAW_POINTS + 1)
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

"""Between the core's types and messages: units, stamps, layouts."""

from __future__ import annotations

from array import array
from importlib import import_module
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension

from cam_rig.messages.codec import CAM_JOINTS, Dimensions, cam_positions
from cam_rig.messages.topics import Topic
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS


def message_class(topic: Topic) -> Any:
    """The message class of a topic."""
    return getattr(import_module(f"{topic.package}.msg"), topic.message)


def qos(topic: Topic, publishers: int = 1) -> QoSProfile:
    """The one quality of service of a topic, for publishers and subscribers alike.

    ``publishers`` makes room for the histories of so many at once.
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


def to_header(time_ns: int, frame: str) -> Header:
    """A header with rig time in ns."""
    return Header(stamp=to_time(time_ns), frame_id=frame)


def to_joint_state(
    joint: str, header: Header, position: float, velocity: float, effort: float
) -> JointState:
    """One joint; floats are made plain, for rclpy does not check them."""
    return JointState(
        header=header,
        name=[joint],
        position=[float(position)],
        velocity=[float(velocity)],
        effort=[float(effort)],
    )


def to_cam_state(header: Header, state: CamState, torque: float) -> JointState:
    """The cam's state, its angle as people read it and within the turn; torque in N·m."""
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

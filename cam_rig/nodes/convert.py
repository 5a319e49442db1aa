"""Conversion of the package's data types to ROS messages, and QoS of topics."""

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

from cam_rig.errors import RefusedError
from cam_rig.messages.codec import Dimensions
from cam_rig.messages.topics import Topic
from cam_rig.units import NS


def message_class(topic: Topic) -> Any:
    """Return the message class of a topic."""
    package, _, name = topic.type.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def qos(topic: Topic, histories: int = 1) -> QoSProfile:
    """Return the QoS profile of a topic.

    The depth of a subscription has room for the histories of `histories` publishers.
    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        history=HistoryPolicy.KEEP_LAST,
        depth=topic.depth * histories,
        durability=durability,
    )


def require_length(topic: Topic, cdr: bytes) -> None:
    """Raise RefusedError if a serialized message is longer than its topic allows."""
    if len(cdr) > topic.max_bytes:
        raise RefusedError(
            f"{topic.name}: a message has at most {topic.max_bytes} bytes, got {len(cdr)}"
        )


def to_time(time_ns: int) -> Time:
    """Return a rig time in ns as a stamp."""
    return Time(sec=time_ns // NS, nanosec=time_ns % NS)


def to_header(time_ns: int, frame: str = "") -> Header:
    """Return a header with a rig time in ns.

    `frame` is empty for data without a location.
    """
    return Header(stamp=to_time(time_ns), frame_id=frame)


def to_joint_state(header: Header, **joints: tuple[float, float, float]) -> JointState:
    """Return a message with position, velocity and effort of each joint by name.

    The values are converted to float, because the message class does not check their type.
    """
    position, velocity, effort = (
        list(map(float, values)) for values in zip(*joints.values(), strict=True)
    )
    return JointState(
        header=header, name=list(joints), position=position, velocity=velocity, effort=effort
    )


def to_array(dimensions: Dimensions, data: NDArray[np.float64]) -> Float64MultiArray:
    """Return a message with an array and the label and size of each dimension.

    The data are copied as one block instead of element by element.
    """
    message = Float64MultiArray()
    stride = data.size
    for label, size in dimensions:
        message.layout.dim.append(MultiArrayDimension(label=label, size=size, stride=stride))
        stride //= size
    values = array("d")
    values.frombytes(np.ascontiguousarray(data).tobytes())
    message.data = values
    return message

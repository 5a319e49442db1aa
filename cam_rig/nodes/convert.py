"""The core's types as ROS messages: stamps, states, arrays, laws."""

from __future__ import annotations

import time
from array import array
from collections import deque
from collections.abc import Callable, Sequence
from functools import wraps
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point32, PolygonStamped
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cam_rig.errors import CamRigError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import MAX_TICKS_IN_FLIGHT
from cam_rig.live.law_server import contour_of
from cam_rig.live.queues import RepeatBudget
from cam_rig.messages.codec import Dimensions
from cam_rig.messages.topics import Topic
from cam_rig.schema import CamConfig
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN

if TYPE_CHECKING:
    from cam_rig.nodes.rig_node import RigNode

#: Intervals of the sampled law over one turn.
LAW_POINTS = 180


def message_class(topic: Topic) -> Any:
    """The message class of a topic."""
    package, _, name = topic.type.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def qos(topic: Topic, publishers: int = 1) -> QoSProfile:
    """The one quality of service of a topic; the depth is of the histories of so many at once."""
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


def to_joint_state(header: Header, **joints: tuple[float, float, float]) -> JointState:
    """Position, velocity and effort of each joint; plain floats, as rclpy does not check them."""
    position, velocity, effort = (list(map(float, of)) for of in zip(*joints.values(), strict=True))
    return JointState(
        header=header, name=list(joints), position=position, velocity=velocity, effort=effort
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


def weightings(quantity: str) -> list[Parameter]:
    """The parameters by which the microphone reads a quantity: LAF, LZS."""
    return [
        Parameter("frequency_weighting", value=quantity[1]),
        Parameter("time_weighting", value=quantity[2]),
    ]


# The state of a node on /diagnostics: when it changes, and once a second of rig time.

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def to_diagnosis(
    time_ns: int, name: str, level: bytes, words: str, values: dict[str, str]
) -> DiagnosticArray:
    """What a node, or a part of it, says of itself at a time."""
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    status = DiagnosticStatus(
        level=level, name=name, message=words, hardware_id="rig", values=pairs
    )
    return DiagnosticArray(header=to_header(time_ns), status=[status])


#: Wall time (s) after the last diagnosis before there is a heartbeat.
SILENT_S = 0.9
#: The last report: level, words, second, and the rig time (ns) up to which all is reported.
Reported = tuple[int, str, int, int]


class Diagnostics:
    """The state of one node.

    What is published depends on rig time alone, so it is the same in every run; ``reported`` is
    part of a checkpoint, so that a successor continues instead of starting over.
    """

    def __init__(self, publisher: Publisher, node: str) -> None:
        self._publisher, self.node = publisher, node
        #: Wall time (s) of the last message.
        self.published_at = -SILENT_S
        self.reported: Reported = (-1, "", -1, -1)

    def report(
        self, time_ns: int, level: bytes, words: str, values: dict[str, str] | None = None
    ) -> DiagnosticArray | None:
        """Report the node's state at a rig time; the message, if one was published."""
        *before, until = self.reported
        if time_ns <= until:
            return None
        now = (level[0], words, time_ns // NS)
        self.reported = (*now, time_ns)
        if now == tuple(before):
            return None
        message = to_diagnosis(time_ns, self.node, level, words, values or {})
        self._publisher.publish(message)
        self.published_at = time.monotonic()
        return message


class Activity(NamedTuple):
    """What a node does now: waiting, turning, stopped or emergency; for whom it waits; in words."""

    state: str
    waits_for: Sequence[str]
    words: str


# What a node takes: every message bounded and guarded, and at the end the rest of them.

#: What a message of the right type with impossible content may raise where it is read.
UNREADABLE = (ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RuntimeError)
#: Wall time (s) for messages still in transit at the end; after 10 s the runner kills the node.
MAX_DRAIN_S = 3.0


def guarded(node: RigNode, name: str, callback: Callable[..., Any]) -> Callable[..., Any]:
    """A callback for what comes under a name: what is impossible is refused, other errors end."""

    @wraps(callback)
    def safe(*message: Any) -> Any:
        try:
            return callback(*message)
        except RefusedError as error:
            node.refuse(error)
        except CamRigError as error:
            node.fail(error)
        except UNREADABLE as error:
            node.refuse(RefusedError(f"{name}: cannot be read ({error})"))

    return safe


def require_length(topic: Topic, cdr: bytes) -> None:
    """Refuse a serialized message, before it is read, that is longer than any of its topic."""
    if len(cdr) > topic.most_bytes:
        raise RefusedError(f"{topic.name}: {len(cdr)} bytes; allowed: {topic.most_bytes}")


def take_rest(spin_once: Callable[..., None], taken: Callable[[], int]) -> None:
    """Spin until nothing more is taken for a while, at most `MAX_DRAIN_S`."""
    quiet, deadline = 0, time.monotonic() + MAX_DRAIN_S
    while quiet < 5 and time.monotonic() < deadline:
        before = taken()
        spin_once(timeout_sec=0.02)
        quiet = quiet + 1 if taken() == before else 0


# What a node published for its last ticks, to be sent again to a node that did not get it.

#: A publisher and its message.
Published = tuple[Publisher, Any]


class ResendBuffer:
    """The messages of the ticks that may be in flight, each on topics of its own.

    The history of a subscription is bounded, so a flood from elsewhere may overflow it. The drive
    then sends its states again, and nodes that have answered them already answer again. A
    subscriber that did get the first answer knows the second by its stamp. What may be sent again
    is bounded, as the topics' histories are (`RepeatBudget`).
    """

    def __init__(self) -> None:
        self._ticks: deque[tuple[int, Sequence[Published]]] = deque(maxlen=MAX_TICKS_IN_FLIGHT + 1)
        self._budget = RepeatBudget()

    def publish(self, stamp_ns: int, messages: Sequence[Published]) -> None:
        """Publish all messages of a tick in their order, and remember them."""
        self._ticks.append((stamp_ns, messages))
        self._budget.publish()
        self._send(messages)

    def resend(self, stamp_ns: int) -> None:
        """Publish once more what was published for the tick that ends at a stamp."""
        for stamp, messages in self._ticks:
            if stamp == stamp_ns and self._budget.repeat():
                self._send(messages)

    def _send(self, messages: Sequence[Published]) -> None:
        for publisher, message in messages:
            publisher.publish(message)

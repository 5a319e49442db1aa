"""Table of the rig's topics: name, type, quality of service, publisher and rate.

The names are those of the root namespace. A rig in another namespace has it as a prefix.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Literal

from cam_rig.dynamics import COLUMNS
from cam_rig.errors import RunError
from cam_rig.live.flow_control import HISTORY_DEPTH
from cam_rig.live.state_validation import MAX_SAMPLES
from cam_rig.simulation.schedule import CamState

#: Smallest history depth (messages) of topics with one message per instant, a selected sample of
#: the motion. It covers several turns at the usual number of instants per turn, for slow
#: subscribers (see `motion_depth`).
MOTION_DEPTH = 1000
#: Topics that all namespaces share in ROS, so that they get no namespace.
GLOBAL_TOPICS = ("/parameter_events", "/tf", "/tf_static")


@dataclass(frozen=True)
class Topic:
    """Topic of the rig with reliable quality of service.

    Parameters
    ----------
    name, type
        Name in the root namespace, and message type.
    per
        Occasion of a message: each ``state`` of the cam, each ``tick`` (the time between two
        states), each ``instant`` (a selected sample of a tick, with its time as stamp), each
        mounted ``cam``, each ``speed``, or ``any`` time.
    latched
        True if late subscribers receive the history (durability transient local).
    depth
        Number of messages in the history.
    stamped
        True if the message has a stamp at its start.
    twin
        Stamped topic that the same node publishes equally often. The n-th message of the topic
        belongs to the stamp of the n-th message of its twin.
    owner
        The only node that may publish the topic, empty if several nodes may.
    max_bytes
        Maximum length in bytes. Longer messages are rejected before they are read.
    derived
        True if the recorder generates the messages from those of other topics. Live, a derived
        topic may be published only while it has subscribers, but a bag contains the same messages
        in every run.
    """

    name: str
    type: str
    per: Literal["state", "tick", "instant", "cam", "speed", "any"]
    latched: bool = True
    depth: int = HISTORY_DEPTH
    stamped: bool = True
    twin: str = ""
    owner: str = ""
    max_bytes: int = 1 << 20
    derived: bool = False

    @property
    def relative(self) -> str:
        """Name of the topic relative to a node's namespace.

        It is the absolute name for a global topic.
        """
        return self.name if self.name in GLOBAL_TOPICS else self.name.lstrip("/")

    def within(self, namespace: str) -> str:
        """Return the name of the topic in a namespace such as "/rig1", or "" for the root."""
        return self.name if self.name in GLOBAL_TOPICS else namespace + self.name


#: Topic of the rig time. A bag contains the time of each state. Live, a paced run also publishes
#: rig times between the states.
CLOCK = Topic(
    "/clock", "rosgraph_msgs/msg/Clock", "state", stamped=False, owner="cam_drive", derived=True
)
_law_server, _follower, _microphone = (
    partial(Topic, owner=node) for node in ("law_server", "follower", "microphone")
)
LAW = _law_server("/cam/law", "trajectory_msgs/msg/JointTrajectory", "speed")
LAW_COEFFICIENTS = _law_server(
    "/cam/law_coefficients", "std_msgs/msg/Float64MultiArray", "cam", stamped=False
)
PROFILE = _law_server("/cam/profile", "geometry_msgs/msg/PolygonStamped", "cam")
CAM_STATE = Topic("/cam/state", "sensor_msgs/msg/JointState", "state", owner="cam_drive")
FOLLOWER_STATE = _follower("/follower/state", "sensor_msgs/msg/JointState", "tick")
FOLLOWER_SAMPLES = _follower(
    "/follower/samples",
    "std_msgs/msg/Float64MultiArray",
    "tick",
    stamped=False,
    twin=FOLLOWER_STATE.name,
    max_bytes=MAX_SAMPLES * len(COLUMNS) * 8 + 1024,
)
# Topics of the motion, for viewers such as RViz and Foxglove.
_motion = partial(Topic, per="instant", latched=False, depth=MOTION_DEPTH, derived=True)
#: Topic of the joint positions. It has no owner, because nodes of other robots may publish joints
#: too.
JOINT_STATES = _motion("/joint_states", "sensor_msgs/msg/JointState")
FOLLOWER_CONTACT = _motion("/follower/contact", "geometry_msgs/msg/WrenchStamped", owner="follower")
FOLLOWER_MARKERS = _motion(
    "/follower/markers", "visualization_msgs/msg/MarkerArray", stamped=False, owner="follower"
)
_model = partial(Topic, per="cam", stamped=False, derived=True)
CAM_MARKERS = _model("/cam/markers", "visualization_msgs/msg/MarkerArray", owner="law_server")
#: Topic of the URDF. It has no owner, because robot_state_publisher publishes it too. Its depth is
#: that of ROS.
ROBOT_DESCRIPTION = _model("/robot_description", "std_msgs/msg/String", depth=1)
#: Topic of the fixed frames. In a live run robot_state_publisher publishes it, as well as /tf.
TF_STATIC = _model("/tf_static", "tf2_msgs/msg/TFMessage", depth=1)
TF = _motion("/tf", "tf2_msgs/msg/TFMessage", depth=100, stamped=False)
LEVEL = _microphone(
    "/microphone/level", "std_msgs/msg/Float64", "tick", stamped=False, twin="/microphone/pressure"
)
PRESSURE = _microphone("/microphone/pressure", "sensor_msgs/msg/FluidPressure", "tick")
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "any")
#: All topics of a bag, in their order. They are the topics defined above.
RECORDING = tuple(value for value in vars().values() if isinstance(value, Topic))
#: Topics that the recorder subscribes to. It generates the messages of the other topics of a bag.
RECEIVED = tuple(topic for topic in RECORDING if not topic.derived)
#: Nodes that publish on /diagnostics, in the order of their messages in a bag.
DIAGNOSED_NODES = ("cam_drive", "law_server", "follower", "microphone", "recorder")
#: Name of the status on /diagnostics by which the follower reports the playback of the motion in a
#: paced run. It depends on the wall clock.
SHOWN_MOTION = "follower: motion"
#: Name of the status on /diagnostics by which the drive reports its pacing. It depends on the wall
#: clock, so bags do not contain it.
PACE = "cam_drive: pace"
#: Key on /diagnostics of the quantity that the microphone measures, such as LAF or LZS.
QUANTITY = "quantity"
#: Suffix of a node's name on /diagnostics that marks a heartbeat. Heartbeats depend on the wall
#: clock.
HEARTBEAT = ": heartbeat"
#: Acknowledgement of the recorder: stamp of the newest tick (time between two cam states) of which
#: all messages are written.
RECORDER_ACK = Topic("/recorder/ack", "std_msgs/msg/Header", "tick", owner="recorder")
#: Acknowledgement of the law server: stamp of the newest cam state that it has processed.
LAW_SERVER_ACK = Topic("/law_server/ack", "std_msgs/msg/Header", "state", owner="law_server")
#: Acknowledgement of the viewer: stamp of the newest tick (time between two cam states) that it has
#: drawn.
VIEWER_ACK = Topic("/viewer/ack", "std_msgs/msg/Header", "tick")
_event = partial(Topic, per="any", stamped=False)
#: Topic of the message at the end of a run: its outcome (level, message), number of ticks (times
#: between two cam states) and rig time.
FINISHED = _event("/rig/finished", "diagnostic_msgs/msg/DiagnosticStatus", owner="cam_drive")
#: State of the rig for supervisors: activity, cam, speed, progress and, at the end, the outcome.
RIG_STATE = _event("/rig/state", "diagnostic_msgs/msg/DiagnosticStatus", depth=1, owner="cam_drive")
#: Path of the folder of the bag that the recorder has closed. It is not latched, because it is
#: valid for one run.
CLOSED = _event("/recorder/closed", "std_msgs/msg/String", latched=False, owner="recorder")
#: Name and scene of a node that is ready to receive messages. The recorder sends it after opening
#: its file.
READY = _event("/rig/ready", "std_msgs/msg/String")
#: Real-time factor (rig seconds per wall-clock second), 0 for a free run.
REAL_TIME_FACTOR = _event(
    "/rig/real_time_factor", "std_msgs/msg/Float64", depth=1, owner="cam_drive"
)
#: Command to the drive: cam speed (rpm) from the next cam state on, 0 for the scene's speeds.
CAM_RPM = _event("/cam/rpm", "std_msgs/msg/Float64", latched=False)
#: Command of a ros2_control controller to the drive: velocity (rad/s) of the joint ``cam`` from the
#: next cam state on, 0 to stop.
JOINT_COMMANDS = _event("/joint_commands", "sensor_msgs/msg/JointState", latched=False)
#: Parameter changes of all nodes. Those of the law server report the mounted cam.
PARAMETER_EVENTS = Topic(
    "/parameter_events", "rcl_interfaces/msg/ParameterEvent", "any", latched=False, depth=1000
)
#: All topics of the rig, in the order of the table of topics.
TOPICS = tuple(value for value in vars().values() if isinstance(value, Topic))


def motion_depth(samples_per_turn: int) -> int:
    """Return the history depth of a topic with a message per instant: four turns.

    The messages of a tick are published together in a free run, and a tick may be a whole turn. A
    tick is the time between two cam states.
    """
    return max(MOTION_DEPTH, 4 * (samples_per_turn + 2))


@lru_cache(maxsize=1024)
def recorded_topic(name: str) -> Topic | None:
    """Return the topic of the rig that has the name of a recorded topic, or None.

    The recorded name may begin with any namespace.
    """
    return next((t for t in RECORDING if name == t.name or name.endswith(t.name)), None)


def occasions(before: CamState | None, state: CamState) -> set[str]:
    """Return the values of `Topic.per` for which a message is due at a cam state.

    These are the occasions of messages, such as each state or each new speed. `before` is the
    previous state, None for the first.
    """
    previous = None if before is None else (before.cam, before.speed)
    result = {"state"}
    if before is None or before.cam != state.cam:
        result.add("cam")
    if state.speed > 0.0 and previous != (state.cam, state.speed):
        result.add("speed")
    if before is not None and before.turns_until(state):
        result.add("tick")
    return result


# Detection of second publishers: a recording contains only the messages of a topic's owner.


class Publishers:
    """Publishers of the messages of each node, identified by their gid.

    A gid is the identifier of a publisher in the middleware. It is compared as a whole. It is
    unique per publisher with every RMW. Only RTPS defines the meaning of its parts, and some RMWs
    report another gid in the graph than with a message.

    Parameters
    ----------
    find_publishers : callable
        Returns the full node name of each publisher of a topic by gid, for error messages.
    """

    def __init__(
        self, find_publishers: Callable[[Topic], Mapping[bytes, str]] = lambda _topic: {}
    ) -> None:
        self._find_publishers = find_publishers
        self._gids: dict[tuple[str, str], bytes] = {}  # by node and topic

    def require(self, node: str, topic: Topic, gid: bytes) -> None:
        """Raise RunError if a topic of a node has a second publisher.

        `gid` is that of the publisher of a message. An empty `gid` is the recorder itself.
        """
        if not gid:
            return
        first = self._gids.setdefault((node, topic.name), gid)
        if gid == first:
            return
        names = self._find_publishers(topic)
        foreign = [name for name in names.values() if name.split("/")[-1] != node]
        # A publisher of another name is the foreign publisher, even if it was first.
        both = [names[each] for each in (gid, first) if each in names]
        other = next((name for name in both if name in foreign), None)
        raise second_publisher(topic, node, other or ", ".join(foreign or both[:1]) or gid.hex())


def second_publisher(topic: Topic, node: str, other: str) -> RunError:
    """Return the error of a run in which two publishers publish one node's topic.

    `node` is the node to which `topic` belongs, and `other` the name of the other publisher's node.
    """
    return RunError(
        f"{topic.name}: has a second publisher, {other}; only this rig's {node} may publish it; "
        "end the other program, or set ROS_DOMAIN_ID to another number"
    )

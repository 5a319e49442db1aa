"""The one table of topics: name, type, quality of service, publisher, and how many per tick.

The names are those of the root namespace; a rig in another one has its namespace before each.
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

#: Messages of an instant that are kept for a slow subscriber: several turns of them at the usual
#: number of points a turn (`motion_depth`).
MOTION_DEPTH = 1000
#: Topics of which ROS has one for all namespaces.
OF_ALL = ("/parameter_events", "/tf", "/tf_static")


@dataclass(frozen=True)
class Topic:
    """One topic. All are reliable.

    ``per`` says when it is published: for each ``state`` of the cam, each ``tick`` (the time
    between two states), each ``instant`` (some samples of a tick, stamped with their own time),
    each ``cam`` mounted, each ``speed``, or at ``any`` time. ``twin`` names the stamped topic that
    the same node publishes as often: the n-th message of the one belongs to the stamp of the n-th
    of the other. ``owner`` is the node that publishes it, and no other may; empty where several do.
    A message of more than ``most_bytes`` is refused before it is read. A ``derived`` topic follows
    from others, and the recorder makes its messages by itself: of what is published when somebody
    can see it, a bag holds the same in every run.
    """

    name: str
    type: str
    per: Literal["state", "tick", "instant", "cam", "speed", "any"]
    latched: bool = True
    depth: int = HISTORY_DEPTH
    stamped: bool = True
    twin: str = ""
    owner: str = ""
    most_bytes: int = 1 << 20
    derived: bool = False

    @property
    def relative(self) -> str:
        """The name within a node's namespace, or that of all namespaces."""
        return self.name if self.name in OF_ALL else self.name.lstrip("/")

    def within(self, namespace: str) -> str:
        """The name in a namespace such as "/rig1"; empty for the root."""
        return self.name if self.name in OF_ALL else namespace + self.name


#: A bag holds the time of each state; a paced run's rig time goes on between them.
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
    most_bytes=MAX_SAMPLES * len(COLUMNS) * 8 + 1024,
)
#: The motion for people.
_motion = partial(Topic, per="instant", latched=False, depth=MOTION_DEPTH, derived=True)
#: Other robots' nodes may publish joints too: this topic has no owner.
JOINT_STATES = _motion("/joint_states", "sensor_msgs/msg/JointState")
FOLLOWER_CONTACT = _motion("/follower/contact", "geometry_msgs/msg/WrenchStamped", owner="follower")
FOLLOWER_MARKERS = _motion(
    "/follower/markers", "visualization_msgs/msg/MarkerArray", stamped=False, owner="follower"
)
_looks = partial(Topic, per="cam", stamped=False, derived=True)
CAM_MARKERS = _looks("/cam/markers", "visualization_msgs/msg/MarkerArray", owner="law_server")
#: robot_state_publisher publishes it too, so this topic has no owner; its depth is the usual one.
ROBOT_DESCRIPTION = _looks("/robot_description", "std_msgs/msg/String", depth=1)
#: Live these two are robot_state_publisher's.
TF_STATIC = _looks("/tf_static", "tf2_msgs/msg/TFMessage", depth=1)
TF = _motion("/tf", "tf2_msgs/msg/TFMessage", depth=100, stamped=False)
LEVEL = _microphone(
    "/microphone/level", "std_msgs/msg/Float64", "tick", stamped=False, twin="/microphone/pressure"
)
PRESSURE = _microphone("/microphone/pressure", "sensor_msgs/msg/FluidPressure", "tick")
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "any")
#: What a bag holds: all of the above, in this order.
RECORDING = tuple(value for value in vars().values() if isinstance(value, Topic))
#: What the recorder receives; the rest of a bag it makes itself.
RECEIVED = tuple(topic for topic in RECORDING if not topic.derived)
#: The nodes that report on /diagnostics, in the order of a bag.
DIAGNOSED_NODES = ("cam_drive", "law_server", "follower", "microphone", "recorder")
#: The name there of what the follower shows at a run's own pace; of wall time too.
SHOWN_MOTION = "follower: motion"
#: The name there of the drive's pacing. It depends on the wall clock, so bags do not hold it.
PACE = "cam_drive: pace"
#: The key there of what the microphone reads, a level's letter symbol: LAF, LZS.
QUANTITY = "quantity"
#: The end of a node's name there, for what it says on wall time while nothing turns.
HEARTBEAT = ": heartbeat"
#: The recorder's acknowledgement: the stamp of the newest tick whose messages are all written.
RECORDED = Topic("/recorder/written", "std_msgs/msg/Header", "tick", owner="recorder")
#: The law server's acknowledgement: the stamp of the newest state that it has processed.
FOLLOWED = Topic("/law_server/followed", "std_msgs/msg/Header", "state", owner="law_server")
#: The viewer's acknowledgement: the stamp of the newest tick that it has drawn.
SHOWN = Topic("/viewer/shown", "std_msgs/msg/Header", "tick")
_event = partial(Topic, per="any", stamped=False)
#: The run is over: how it ended (level, message), after how many ticks and at which rig time.
FINISHED = _event("/rig/finished", "diagnostic_msgs/msg/DiagnosticStatus", owner="cam_drive")
#: The bag's folder, once the recorder has closed it; not latched, so of the present run alone.
CLOSED = _event("/recorder/closed", "std_msgs/msg/String", latched=False, owner="recorder")
#: The node of this name takes messages; the recorder once its file is open.
READY = _event("/rig/ready", "std_msgs/msg/String")
#: Rig seconds a wall second of a run that is paced; 0: as fast as its nodes answer.
REAL_TIME_FACTOR = _event(
    "/rig/real_time_factor", "std_msgs/msg/Float64", depth=1, owner="cam_drive"
)
#: A command to the drive: the cam's speed in rpm from the next tick on, 0 as the scene says.
CAM_RPM = _event("/cam/rpm", "std_msgs/msg/Float64", latched=False)
#: Every node's, of its parameters; the law server's report which cam is mounted.
PARAMETER_EVENTS = Topic(
    "/parameter_events", "rcl_interfaces/msg/ParameterEvent", "any", latched=False, depth=1000
)
#: The whole table, in its order.
TOPICS = tuple(value for value in vars().values() if isinstance(value, Topic))


def motion_depth(points_per_turn: int) -> int:
    """Messages of an instant that a publisher keeps: four turns, as they come a tick at once."""
    return max(MOTION_DEPTH, 4 * (points_per_turn + 2))


@lru_cache(maxsize=1024)
def recorded_topic(name: str) -> Topic | None:
    """The topic of a rig that a recorded name is of, in whatever namespace; None for others."""
    return next((t for t in RECORDING if name == t.name or name.endswith(t.name)), None)


def occasions(before: CamState | None, state: CamState) -> set[str]:
    """Topics of which ``per`` have a message at a state's time, by the state before it."""
    was = None if before is None else (before.cam, before.speed)
    found = {"state"}
    if before is None or before.cam != state.cam:
        found.add("cam")
    if state.speed > 0.0 and was != (state.cam, state.speed):
        found.add("speed")
    if before is not None and before.turns_until(state):
        found.add("tick")
    return found


# One publisher per topic: the node that owns it, whose messages alone a recording contains.


class Publishers:
    """Publishers of the messages of each node, identified by their gid.

    A gid is compared as a whole. It is unique per publisher with every RMW, but only RTPS defines
    the meaning of its parts, and some RMWs report another gid in the graph than with a message.

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
        """Raise RunError if a second publisher publishes the messages of a node on a topic.

        An empty `gid` is the recorder itself.
        """
        if not gid:
            return
        first = self._gids.setdefault((node, topic.name), gid)
        if gid == first:
            return
        names = self._find_publishers(topic)
        foreign = [name for name in names.values() if name.split("/")[-1] != node]
        # A publisher without the node's name is the foreign one, even if it was first.
        known = [names[each] for each in (gid, first) if each in names]
        other = next((name for name in known if name in foreign), None)
        raise second_publisher(topic, node, other or ", ".join(foreign or known[:1]) or gid.hex())


def second_publisher(topic: Topic, node: str, other: str) -> RunError:
    """Return the error of a run in which two publishers publish as one node."""
    return RunError(
        f"{topic.name}: has a second publisher, {other}; allowed: one, this rig's {node}; end the "
        "other, or set ROS_DOMAIN_ID to another number"
    )

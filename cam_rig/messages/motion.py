"""The motion as standard messages, at the instants of each tick: for people and their viewers.

They follow from what else is published: the follower sends them while somebody subscribes, and the
recorder makes the same bytes by itself. A further topic is a further `MotionPart`; those of the
robot are in `cam_rig.messages.motion`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Set
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import Samples
from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.messages import topics
from cam_rig.messages.cdr_template import TYPES, CdrTemplate, example_header
from cam_rig.messages.frames import CAM, Robot, Vector
from cam_rig.messages.markers import FollowerMarkers, cam_markers, header, new, serialize
from cam_rig.messages.topics import Topic
from cam_rig.messages.urdf import urdf
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN, FloatArray

# The instants of a tick at which its motion is published for people: few, but every peak.

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Instants:
    """The motion at some samples of one tick: arrays ``(n,)`` in the order of time.

    ``law`` is the mounted cam's and bears its name; ``index`` counts the tick's samples from 0.
    ``time_ns`` is rig time, to the nanosecond that the sample falls in. ``angle`` (rad) of the cam
    has all its turns, ``angle_in_turn`` those since the tick began; ``speed`` in rad/s, ``torque``
    of the shaft in N·m: contact force times ds/dθ. ``lift``, ``velocity`` and contact ``force`` in
    m, m/s and N are the samples' own.
    """

    law: Law
    index: Indices
    time_ns: Indices
    angle: FloatArray
    angle_in_turn: FloatArray
    speed: FloatArray
    torque: FloatArray
    lift: FloatArray
    velocity: FloatArray
    force: FloatArray


def instants_of(
    law: Law,
    start: CamState,
    end: CamState,
    rows: FloatArray,
    sample_rate: int,
    shown: int | Indices,
) -> Instants:
    """The instants of the tick between two states of the cam.

    Parameters
    ----------
    law : of the cam that is mounted at the start
    rows : the tick's samples, ``(6, n)`` as in `COLUMNS`, at ``sample_rate`` (Hz)
    shown : how many instants, see `choose`; or the indices of their samples
    """
    samples, interval = Samples(rows), start.until(end)
    grid = interval.grid(sample_rate)
    if grid.count != rows.shape[1]:
        raise RefusedError(
            f"follower samples: {rows.shape[1]}; allowed: the {grid.count} of the tick that begins "
            f"at {start.time_ns / NS:.6f} s"
        )
    index = choose(samples.lift, samples.force, shown) if isinstance(shown, int) else shown
    since, force = grid.offset + index / sample_rate, samples.force[index]
    in_turn = interval.angle + since * (interval.speed + 0.5 * interval.acceleration * since)
    seconds, rest = np.divmod(grid.first + index, sample_rate)
    return Instants(
        law=law,
        index=index,
        time_ns=seconds * NS + rest * NS // sample_rate,
        angle=interval.unwrapped(since),
        angle_in_turn=in_turn,
        speed=interval.speed + interval.acceleration * since,
        torque=force * law(in_turn, 1),
        lift=samples.lift[index],
        velocity=samples.velocity[index],
        force=force,
    )


def choose(lift: FloatArray, force: FloatArray, count: int) -> Indices:
    """Indices of the samples that are shown of a tick's ``(n,)``, rising.

    The tick is divided evenly into ``count`` bins, each with one sample at least, and the first of
    each is taken. In a bin that has the tick's largest lift, its largest or its least force, these
    are taken instead; they are two or three instants where they fall into one bin.

    Examples
    --------
    >>> import numpy as np
    >>> lift = np.array([0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, 0.0])
    >>> choose(lift, 10.0 - lift, 4)
    array([0, 3, 4, 6])
    """
    bins = np.arange(min(count, lift.size)) * lift.size // min(count, lift.size)
    peaks = np.unique([lift.argmax(), force.argmax(), force.argmin()])
    taken = np.unique(np.searchsorted(bins, peaks, side="right") - 1)
    return np.union1d(np.delete(bins, taken), peaks)


#: The joints of /joint_states, as the robot's description names them.
JOINTS = ("cam", "follower")


class DerivedMessage(NamedTuple):
    """A serialized message that follows from others, and its rig time (ns)."""

    topic: Topic
    time_ns: int
    cdr: bytes


class MotionPart(Protocol):
    """Derived messages of one topic or a few."""

    @property
    def topics(self) -> tuple[Topic, ...]:
        """What it makes; in the table each is ``derived``."""

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """The messages of a cam that is mounted from a state on."""

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """The messages of a tick, in the order of time."""


class JointStates:
    """/joint_states: θ with all its turns, ω, shaft torque; lift, velocity, contact force."""

    topics = (topics.JOINT_STATES,)

    def __init__(self) -> None:
        self._template = CdrTemplate(topics.JOINT_STATES.type, _joint_state, 6)

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """None."""
        return ()

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """One for each instant."""
        i = instants
        columns = i.angle, i.lift, i.speed, i.velocity, i.torque, i.force
        return each_instant(topics.JOINT_STATES, i, self._template.fill(i.time_ns, *columns))


class ContactForce:
    """/follower/contact: the force of the cam on the follower, along its way."""

    topics = (topics.FOLLOWER_CONTACT,)

    def __init__(self) -> None:
        self._template = CdrTemplate(topics.FOLLOWER_CONTACT.type, _contact, 1)

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """None."""
        return ()

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """One for each instant."""
        found = self._template.fill(instants.time_ns, instants.force)
        return each_instant(topics.FOLLOWER_CONTACT, instants, found)


class MotionMessages:
    """All derived messages of a run.

    Parameters
    ----------
    loaded : the scene; a cam mounted by an operator is in it by the time it turns
    points_per_turn : instants a turn; 0: as the scene says
    further : what is made besides joint states and contact force; at one instant in this order
    """

    def __init__(
        self,
        loaded: LoadedScene,
        points_per_turn: int = 0,
        further: tuple[MotionPart, ...] = (),
    ) -> None:
        self._loaded, self._rate = loaded, int(loaded.scene.sample_rate.si)
        self._points = points_per_tick(
            points_per_turn or loaded.scene.points_per_turn, loaded.scene.program.ticks_per_turn
        )
        self._parts: tuple[MotionPart, ...] = (JointStates(), ContactForce(), *further)

    @property
    def topics(self) -> tuple[Topic, ...]:
        """What is made."""
        return tuple(topic for part in self._parts for topic in part.topics)

    @property
    def sample_rate(self) -> int:
        """Of the ticks' samples, Hz."""
        return self._rate

    def mounted(self, state: CamState) -> list[DerivedMessage]:
        """The messages of a cam that is mounted from a state on."""
        if state.cam not in self._loaded.laws:
            return []
        return [message for part in self._parts for message in part.mounted(state)]

    def moved(
        self,
        start: CamState,
        end: CamState,
        rows: FloatArray,
        wanted: Set[Topic] | None = None,
        shown: Indices | None = None,
    ) -> list[DerivedMessage]:
        """The messages of the tick between two states in the order of time.

        Parameters
        ----------
        rows : the tick's samples, ``(6, n)``
        wanted : the topics to make; None makes all
        shown : indices of the samples; None: as many as the run has points a turn
        """
        parts = [p for p in self._parts if wanted is None or not wanted.isdisjoint(p.topics)]
        if not parts or start.cam not in self._loaded.laws:
            return []
        law = self._loaded.laws[start.cam]
        instants = instants_of(
            law, start, end, rows, self._rate, self._points if shown is None else shown
        )
        found = [message for part in parts for message in part.moved(instants)]
        if wanted is not None:
            found = [message for message in found if message.topic in wanted]
        return sorted(found, key=attrgetter("time_ns"))


def points_per_tick(points_per_turn: int, ticks_per_turn: int) -> int:
    """How many bins of a tick give ``points_per_turn`` instants a turn; one at least."""
    return max(1, round(points_per_turn / ticks_per_turn))


def each_instant(topic: Topic, instants: Instants, found: list[bytes]) -> Iterator[DerivedMessage]:
    """A topic's serialized messages of the instants, one for each."""
    for time_ns, cdr in zip(instants.time_ns.tolist(), found, strict=True):
        yield DerivedMessage(topic, time_ns, cdr)


def _joint_state(*numbers: float) -> Any:
    header = example_header("base_link")
    pairs = np.array(numbers).reshape(3, 2)
    return TYPES.types[topics.JOINT_STATES.type](header, list(JOINTS), *pairs)


def _contact(force: float) -> Any:
    vector = TYPES.types["geometry_msgs/msg/Vector3"]
    wrench = TYPES.types["geometry_msgs/msg/Wrench"]
    value = wrench(force=vector(0.0, force, 0.0), torque=vector(0.0, 0.0, 0.0))
    return TYPES.types[topics.FOLLOWER_CONTACT.type](example_header("follower"), value)


# /tf and /tf_static as robot_state_publisher makes them of /joint_states and the URDF.

Quaternion = tuple[float, float, float, float]

#: Numbers of a joint that moves: x, y, and the quaternion's z and w.
_NUMBERS = 4


class Transforms:
    """The serialized transforms of a robot.

    Examples
    --------
    >>> from pathlib import Path
    >>> from cam_rig.simulation.scene import open_scene
    >>> robot = Robot.of(open_scene(Path("config/scenes/quick.yaml")))
    >>> stamps, angle, lift = np.array([0, 10]), np.array([1.0, 1.2]), np.array([0.002, 0.003])
    >>> len(Transforms(robot).moving(stamps, angle, lift))
    2
    """

    def __init__(self, robot: Robot) -> None:
        self._joints, self._fixed = robot.moving, robot.fixed
        count = _NUMBERS * len(self._joints)
        self._template = CdrTemplate("tf2_msgs/msg/TFMessage", self._example, count)

    def moving(self, stamps: NDArray[np.int64], angle: FloatArray, lift: FloatArray) -> list[bytes]:
        """A message of /tf at each of ``(n,)`` stamps (ns); cam angle in rad, lift in m."""
        columns = list[FloatArray]()
        for joint in self._joints:
            position = angle if joint.name == CAM else lift * (joint.follows or 1.0)
            x, y, yaw = joint.pose(position)
            half = 0.5 * (np.remainder(yaw + math.pi, TURN) - math.pi)
            columns += [x, y, np.sin(half), np.cos(half)]
        return self._template.fill(stamps, *columns)

    def fixed(self, stamp_ns: int) -> bytes:
        """The message of /tf_static, of rig time in ns."""
        transforms = [
            _transform(
                header(stamp_ns, joint.parent), joint.child, joint.xyz, quaternion(joint.rpy)
            )
            for joint in self._fixed
        ]
        return serialize(new("tf2_msgs/TFMessage", transforms))

    def _example(self, *numbers: float) -> Any:
        transforms = []
        for i, joint in enumerate(self._joints):
            x, y, z, w = numbers[_NUMBERS * i : _NUMBERS * (i + 1)]
            place, turn = (x, y, 0.0), (0.0, 0.0, z, w)
            transforms.append(_transform(example_header(joint.parent), joint.child, place, turn))
        return new("tf2_msgs/TFMessage", transforms)


def quaternion(rpy: Vector) -> Quaternion:
    """x, y, z, w of roll, pitch and yaw (rad) about the parent's axes, in this order.

    Examples
    --------
    >>> quaternion((0.0, 0.0, 0.0))
    (0.0, 0.0, 0.0, 1.0)
    """
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(0.5 * a), math.cos(0.5 * a)) for a in rpy)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _transform(of_parent: Any, child: str, place: Vector, turn: Quaternion) -> Any:
    translation, rotation = (
        new("geometry_msgs/Vector3", *place),
        new("geometry_msgs/Quaternion", *turn),
    )
    transform = new("geometry_msgs/Transform", translation, rotation)
    return new("geometry_msgs/TransformStamped", of_parent, child, transform)


# The robot's messages among those derived: from a mounted cam, and from a tick's instants.


def motion_of_follower(loaded: LoadedScene, points_per_turn: int = 0) -> MotionMessages:
    """What the follower publishes while somebody subscribes."""
    return MotionMessages(loaded, points_per_turn, (ContactMarkers(loaded),))


def motion_of_bag(loaded: LoadedScene, points_per_turn: int = 0) -> MotionMessages:
    """What a bag holds besides what the recorder receives.

    Live, robot_state_publisher publishes /tf and /tf_static, and the law server the mounted cam.
    """
    further = ContactMarkers(loaded), RobotTransforms(loaded), MountedCam(loaded)
    return MotionMessages(loaded, points_per_turn, further)


class ContactMarkers:
    """/follower/markers."""

    topics = (topics.FOLLOWER_MARKERS,)

    def __init__(self, loaded: LoadedScene) -> None:
        self._of = cache(lambda cam: FollowerMarkers(Robot.of(loaded, cam)))

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """None."""
        return ()

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """One for each instant."""
        i = instants
        found = self._of(i.law.name).at(i.time_ns, i.angle_in_turn, i.lift, i.force)
        return each_instant(topics.FOLLOWER_MARKERS, i, found)


class RobotTransforms:
    """/tf and /tf_static."""

    topics = (topics.TF_STATIC, topics.TF)

    def __init__(self, loaded: LoadedScene) -> None:
        self._of = cache(lambda cam: Transforms(Robot.of(loaded, cam)))

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """Of the links that stay where they are."""
        cdr = self._of(state.cam).fixed(state.time_ns)
        return (DerivedMessage(topics.TF_STATIC, state.time_ns, cdr),)

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """One for each instant."""
        i = instants
        found = self._of(i.law.name).moving(i.time_ns, i.angle_in_turn, i.lift)
        return each_instant(topics.TF, i, found)


class MountedCam:
    """/robot_description and /cam/markers."""

    topics = (topics.ROBOT_DESCRIPTION, topics.CAM_MARKERS)

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded

    def messages(self, cam: str) -> list[tuple[Topic, bytes]]:
        """The serialized messages of a mounted cam of the scene."""
        robot = Robot.of(self._loaded, cam)
        description = serialize(new("std_msgs/String", urdf(robot)))
        return [(topics.ROBOT_DESCRIPTION, description), (topics.CAM_MARKERS, cam_markers(robot))]

    def mounted(self, state: CamState) -> Iterable[DerivedMessage]:
        """Both."""
        found = self.messages(state.cam)
        return [DerivedMessage(topic, state.time_ns, cdr) for topic, cdr in found]

    def moved(self, instants: Instants) -> Iterable[DerivedMessage]:
        """None."""
        return ()

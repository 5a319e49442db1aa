"""The motion as standard messages, at the instants of each tick: for people and their viewers.

They follow from what else is published: the follower sends them while somebody subscribes, and the
recorder makes the same bytes by itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Set
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import Samples
from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.messages import topics
from cam_rig.messages.frames import CAM, Robot, Vector
from cam_rig.messages.markers import FollowerMarkers, cam_markers
from cam_rig.messages.serialization import CdrTemplate, example_header, header, new, serialize
from cam_rig.messages.topics import Topic
from cam_rig.messages.urdf import urdf
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN, FloatArray

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

    ``rows`` are its samples, ``(6, n)``, at ``sample_rate`` (Hz); ``shown`` is how many instants,
    see `choose`, or the indices of their samples.
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
        angle=interval.unwrapped_at(since),
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
    """
    bins = np.arange(min(count, lift.size)) * lift.size // min(count, lift.size)
    peaks = np.unique([lift.argmax(), force.argmax(), force.argmin()])
    taken = np.unique(np.searchsorted(bins, peaks, side="right") - 1)
    return np.union1d(np.delete(bins, taken), peaks)


class Transforms:
    """The serialized /tf and /tf_static of a robot, as robot_state_publisher makes them."""

    def __init__(self, robot: Robot) -> None:
        self._joints, self._fixed = robot.moving, robot.fixed
        self._template = CdrTemplate("tf2_msgs/msg/TFMessage", self._example, 4 * len(self._joints))

    def moving(self, stamps: Indices, angle: FloatArray, lift: FloatArray) -> list[bytes]:
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
        for joint, (x, y, z, w) in zip(self._joints, np.reshape(numbers, (-1, 4)), strict=True):
            place, turn = (x, y, 0.0), (0.0, 0.0, z, w)
            transforms.append(_transform(example_header(joint.parent), joint.child, place, turn))
        return new("tf2_msgs/TFMessage", transforms)


def quaternion(rpy: Vector) -> tuple[float, float, float, float]:
    """x, y, z, w of roll, pitch and yaw (rad) about the parent's axes, in this order."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(0.5 * a), math.cos(0.5 * a)) for a in rpy)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _transform(
    of_parent: Any, child: str, place: Vector, turn: tuple[float, float, float, float]
) -> Any:
    pose = new("geometry_msgs/Vector3", *place), new("geometry_msgs/Quaternion", *turn)
    transform = new("geometry_msgs/Transform", *pose)
    return new("geometry_msgs/TransformStamped", of_parent, child, transform)


# What makes the serialized messages of each topic, for a robot with a cam mounted.

#: Of a tick's instants, one for each.
InstantMaker = Callable[[Instants], list[bytes]]


def joint_states(_robot: Robot) -> InstantMaker:
    """/joint_states: θ with all its turns, ω, shaft torque; lift, velocity, contact force."""

    def example(*numbers: float) -> Any:
        pairs = np.array(numbers).reshape(3, 2)
        return new("sensor_msgs/JointState", example_header("base_link"), list(JOINTS), *pairs)

    template = CdrTemplate(topics.JOINT_STATES.type, example, 6)
    return lambda i: template.fill(
        i.time_ns, i.angle, i.lift, i.speed, i.velocity, i.torque, i.force
    )


def contact_force(_robot: Robot) -> InstantMaker:
    """/follower/contact: the force of the cam on the follower, along its way."""

    def example(force: float) -> Any:
        vectors = (new("geometry_msgs/Vector3", 0.0, y, 0.0) for y in (force, 0.0))
        wrench = new("geometry_msgs/Wrench", *vectors)
        return new("geometry_msgs/WrenchStamped", example_header("follower"), wrench)

    template = CdrTemplate(topics.FOLLOWER_CONTACT.type, example, 1)
    return lambda i: template.fill(i.time_ns, i.force)


def follower_markers(robot: Robot) -> InstantMaker:
    """/follower/markers."""
    made = FollowerMarkers(robot)
    return lambda i: made.at(i.time_ns, i.angle_in_turn, i.lift, i.force)


def transforms(robot: Robot) -> InstantMaker:
    """/tf."""
    made = Transforms(robot)
    return lambda i: made.moving(i.time_ns, i.angle_in_turn, i.lift)


#: The joints of /joint_states, as the robot's description names them.
JOINTS = ("cam", "follower")
#: At one instant in this order.
EACH_INSTANT = {
    topics.JOINT_STATES: joint_states,
    topics.FOLLOWER_CONTACT: contact_force,
    topics.FOLLOWER_MARKERS: follower_markers,
    topics.TF: transforms,
}
#: Of a cam as it is mounted at a rig time (ns).
EACH_CAM: dict[Topic, Callable[[Robot, int], bytes]] = {
    topics.TF_STATIC: lambda robot, time_ns: Transforms(robot).fixed(time_ns),
    topics.ROBOT_DESCRIPTION: lambda robot, _: serialize(new("std_msgs/String", urdf(robot))),
    topics.CAM_MARKERS: lambda robot, _: cam_markers(robot),
}
#: Who publishes what live; robot_state_publisher does the rest.
OF_FOLLOWER = (topics.JOINT_STATES, topics.FOLLOWER_CONTACT, topics.FOLLOWER_MARKERS)
OF_LAW_SERVER = (topics.ROBOT_DESCRIPTION, topics.CAM_MARKERS)


class DerivedMessage(NamedTuple):
    """A serialized message that follows from others, and its rig time (ns)."""

    topic: Topic
    time_ns: int
    cdr: bytes


class MotionMessages:
    """Derived messages of a run, of some topics, at some instants a turn; 0: the scene's."""

    def __init__(
        self,
        loaded: LoadedScene,
        points_per_turn: int = 0,
        topics: tuple[Topic, ...] = (*EACH_INSTANT, *EACH_CAM),
    ) -> None:
        self.topics, self.sample_rate = topics, int(loaded.scene.sample_rate.si)
        self._loaded, scene = loaded, loaded.scene
        points = (points_per_turn or scene.points_per_turn) / scene.program.ticks_per_turn
        self._points = max(1, round(points))  # a tick
        self._robot = cache(lambda cam: Robot.of(loaded, cam))
        self._maker = cache(lambda topic, cam: EACH_INSTANT[topic](self._robot(cam)))

    def mounted(self, cam: str, time_ns: int = 0) -> list[DerivedMessage]:
        """The messages of a cam that is mounted from a rig time (ns) on."""
        if cam not in self._loaded.laws:
            return []
        return [
            DerivedMessage(topic, time_ns, EACH_CAM[topic](self._robot(cam), time_ns))
            for topic in self.topics
            if topic in EACH_CAM
        ]

    def moved(
        self,
        start: CamState,
        end: CamState,
        rows: FloatArray,
        wanted: Set[Topic] | None = None,
        shown: Indices | None = None,
    ) -> list[DerivedMessage]:
        """Messages of a tick in order of time, of all topics or ``wanted``, or at ``shown``."""
        made = [t for t in self.topics if t in EACH_INSTANT and (wanted is None or t in wanted)]
        if not made or start.cam not in self._loaded.laws:
            return []
        law, points = self._loaded.laws[start.cam], self._points if shown is None else shown
        instants = instants_of(law, start, end, rows, self.sample_rate, points)
        found = [
            DerivedMessage(topic, time_ns, cdr)
            for topic in made
            for time_ns, cdr in zip(
                instants.time_ns.tolist(), self._maker(topic, start.cam)(instants), strict=True
            )
        ]
        return sorted(found, key=attrgetter("time_ns"))

"""Messages on the rig's motion in standard types, for RViz, Foxglove and others.

The messages are derived from other messages, at selected instants of each tick. The follower
publishes them while they have subscribers. The recorder generates the same bytes itself.
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
    """Motion at selected samples of one tick, in the order of time.

    Parameters
    ----------
    index
        Indices of the samples within the tick. All arrays have shape (n,).
    time_ns
        Rig time in ns, rounded down.
    angle
        Cam angle with all turns, in rad.
    angle_in_turn
        Cam angle without the full turns before the tick, in rad.
    speed
        Cam speed in rad/s.
    torque
        Shaft torque in N·m: contact force times ds/dθ.
    lift, velocity, force
        Lift (m), velocity (m/s) and contact force (N) of the samples.
    """

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
    selection: int | Indices,
) -> Instants:
    """Return the motion at selected instants of the tick between two states.

    Parameters
    ----------
    law : Law
        Law of the mounted cam.
    start, end : CamState
        Cam states at the start and the end of the tick.
    rows : ndarray, shape (6, n)
        Samples of the tick.
    sample_rate : int
        Sample rate in Hz.
    selection : int or ndarray of int
        Number of instants, see `select_samples`, or the indices of their samples.

    Raises
    ------
    RefusedError
        If the number of samples is not that of the tick.
    """
    samples, interval = Samples(rows), start.until(end)
    grid = interval.grid(sample_rate)
    if grid.count != rows.shape[1]:
        raise RefusedError(
            f"follower samples: the tick that starts at {start.time_ns / NS:.6f} s has "
            f"{grid.count}, got {rows.shape[1]}"
        )
    index = selection
    if isinstance(index, int):
        index = select_samples(samples.lift, samples.force, index)
    since, force = grid.offset + index / sample_rate, samples.force[index]
    in_turn = interval.angle + since * (interval.speed + 0.5 * interval.acceleration * since)
    seconds, remainder = np.divmod(grid.first + index, sample_rate)
    return Instants(
        index=index,
        time_ns=seconds * NS + remainder * NS // sample_rate,
        angle=interval.unwrapped_at(since),
        angle_in_turn=in_turn,
        speed=interval.speed + interval.acceleration * since,
        torque=force * law(in_turn, 1),
        lift=samples.lift[index],
        velocity=samples.velocity[index],
        force=force,
    )


def select_samples(lift: FloatArray, force: FloatArray, count: int) -> Indices:
    """Return the rising indices of about `count` samples of a tick, with its extremes.

    The tick is divided into `count` bins of equal size with at least one sample each. The first
    sample of each bin is selected, except in the bins that contain the largest lift, the largest
    force and the smallest force of the tick. In these bins the extremes are selected instead. The
    result has up to two more samples than `count` if several extremes are in one bin. A tick is the
    time between two cam states.
    """
    bins = np.arange(min(count, lift.size)) * lift.size // min(count, lift.size)
    extremes = np.unique([lift.argmax(), force.argmax(), force.argmin()])
    replaced = np.unique(np.searchsorted(bins, extremes, side="right") - 1)
    return np.union1d(np.delete(bins, replaced), extremes)


class Transforms:
    """Transforms of a robot as serialized messages of /tf and /tf_static.

    They are equal to those that robot_state_publisher computes from the URDF.
    """

    def __init__(self, robot: Robot) -> None:
        self._joints, self._fixed = robot.moving, robot.fixed
        self._prefix = robot.frame_prefix
        self._template = CdrTemplate("tf2_msgs/msg/TFMessage", self._example, 4 * len(self._joints))

    def moving(self, stamps: Indices, angle: FloatArray, lift: FloatArray) -> list[bytes]:
        """Return a serialized message of /tf for each stamp (ns).

        Cam angle (rad) and lift (m) have shape (n,).
        """
        columns = list[FloatArray]()
        for joint in self._joints:
            position = angle if joint.name == CAM else lift * (joint.follows or 1.0)
            x, y, yaw = joint.pose(position)
            half = 0.5 * (np.remainder(yaw + math.pi, TURN) - math.pi)
            columns += [x, y, np.sin(half), np.cos(half)]
        return self._template.fill(stamps, *columns)

    def fixed(self, stamp_ns: int) -> bytes:
        """Return the serialized message of /tf_static at a rig time (ns)."""
        transforms = [
            _transform(
                header(stamp_ns, self._prefix + joint.parent),
                self._prefix + joint.child,
                joint.xyz,
                quaternion(joint.rpy),
            )
            for joint in self._fixed
        ]
        return serialize(new("tf2_msgs/TFMessage", transforms))

    def _example(self, *numbers: float) -> Any:
        transforms = []
        for joint, (x, y, z, w) in zip(self._joints, np.reshape(numbers, (-1, 4)), strict=True):
            head, child = example_header(self._prefix + joint.parent), self._prefix + joint.child
            transforms.append(_transform(head, child, (x, y, 0.0), (0.0, 0.0, z, w)))
        return new("tf2_msgs/TFMessage", transforms)


def quaternion(rpy: Vector) -> tuple[float, float, float, float]:
    """Convert roll, pitch and yaw (rad) to a quaternion x, y, z, w.

    The rotations are about the parent's axes, in this order.
    """
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(0.5 * a), math.cos(0.5 * a)) for a in rpy)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _transform(
    head: Any, child: str, translation: Vector, rotation: tuple[float, float, float, float]
) -> Any:
    pose = new("geometry_msgs/Vector3", *translation), new("geometry_msgs/Quaternion", *rotation)
    transform = new("geometry_msgs/Transform", *pose)
    return new("geometry_msgs/TransformStamped", head, child, transform)


# Functions that make the serialized messages of each topic, for a robot with its mounted cam.

#: Function that returns a message for each of the instants (selected samples) of a tick, the time
#: between two cam states.
InstantMaker = Callable[[Instants], list[bytes]]


def joint_states(robot: Robot) -> InstantMaker:
    """Return a function that makes the messages of /joint_states.

    The joint ``cam`` has angle with all turns, speed and shaft torque. The joint ``follower`` has
    lift, velocity and contact force.
    """

    def example(*numbers: float) -> Any:
        pairs = np.array(numbers).reshape(3, 2)
        head = example_header(robot.frame_prefix + "base_link")
        return new("sensor_msgs/JointState", head, list(JOINTS), *pairs)

    template = CdrTemplate(topics.JOINT_STATES.type, example, 6)
    return lambda i: template.fill(
        i.time_ns, i.angle, i.lift, i.speed, i.velocity, i.torque, i.force
    )


def contact_force(robot: Robot) -> InstantMaker:
    """Return a function that makes the messages of /follower/contact.

    The force is that of the cam on the follower, along its travel.
    """

    def example(force: float) -> Any:
        vectors = (new("geometry_msgs/Vector3", 0.0, y, 0.0) for y in (force, 0.0))
        wrench = new("geometry_msgs/Wrench", *vectors)
        head = example_header(robot.frame_prefix + "follower")
        return new("geometry_msgs/WrenchStamped", head, wrench)

    template = CdrTemplate(topics.FOLLOWER_CONTACT.type, example, 1)
    return lambda i: template.fill(i.time_ns, i.force)


def follower_markers(robot: Robot) -> InstantMaker:
    """Return a function that makes the messages of /follower/markers."""
    markers = FollowerMarkers(robot)
    return lambda i: markers.messages(i.time_ns, i.angle_in_turn, i.lift, i.force)


def transforms(robot: Robot) -> InstantMaker:
    """Return a function that makes the messages of /tf."""
    robot_transforms = Transforms(robot)
    return lambda i: robot_transforms.moving(i.time_ns, i.angle_in_turn, i.lift)


#: Names of the joints in /joint_states, the same as in the URDF.
JOINTS = ("cam", "follower")
#: Functions that create the messages of the topics with one message per instant, in the order of
#: the topics at one instant. An instant is a selected sample of the motion.
INSTANT_MAKERS = {
    topics.JOINT_STATES: joint_states,
    topics.FOLLOWER_CONTACT: contact_force,
    topics.FOLLOWER_MARKERS: follower_markers,
    topics.TF: transforms,
}
#: Functions that create the message of the topics with one message per mounted cam. Their arguments
#: are the robot and the rig time (ns) of the mounting.
CAM_MAKERS: dict[Topic, Callable[[Robot, int], bytes]] = {
    topics.TF_STATIC: lambda robot, time_ns: Transforms(robot).fixed(time_ns),
    topics.ROBOT_DESCRIPTION: lambda robot, _: serialize(new("std_msgs/String", urdf(robot))),
    topics.CAM_MARKERS: lambda robot, _: cam_markers(robot),
}
#: Topics that the follower publishes. robot_state_publisher publishes /tf and /tf_static.
FOLLOWER_TOPICS = (topics.JOINT_STATES, topics.FOLLOWER_CONTACT, topics.FOLLOWER_MARKERS)
#: Topics that the law server publishes.
LAW_SERVER_TOPICS = (topics.ROBOT_DESCRIPTION, topics.CAM_MARKERS)


class DerivedMessage(NamedTuple):
    """Serialized message that is computed from messages of other topics.

    ``time_ns`` is its rig time.
    """

    topic: Topic
    time_ns: int
    cdr: bytes


class MotionMessages:
    """Generator of the derived messages of a run.

    Parameters
    ----------
    loaded : LoadedScene
    samples_per_turn : int
        Number of instants per turn (default 0: that of the scene).
    topics : tuple of Topic
        Topics of the messages (default: all derived topics except /clock).
    frame_prefix : str
        Text before the names of the frames, such as "rig1/" (default: none, as in bags).
    """

    def __init__(
        self,
        loaded: LoadedScene,
        samples_per_turn: int = 0,
        topics: tuple[Topic, ...] = (*INSTANT_MAKERS, *CAM_MAKERS),
        frame_prefix: str = "",
    ) -> None:
        self.topics, self.sample_rate = topics, int(loaded.scene.sample_rate.si)
        self._loaded, scene = loaded, loaded.scene
        points = (samples_per_turn or scene.samples_per_turn) / scene.schedule.ticks_per_turn
        self._points = max(1, round(points))  # per tick
        self._robot = cache(lambda cam: Robot.of(loaded, cam, frame_prefix))
        self._maker = cache(lambda topic, cam: INSTANT_MAKERS[topic](self._robot(cam)))

    def of_cam(self, cam: str, time_ns: int = 0) -> list[DerivedMessage]:
        """Return the messages that are derived from a cam when it is mounted.

        They are, for example, its markers and the URDF. ``time_ns`` is the rig time of the
        mounting.
        """
        if cam not in self._loaded.laws:
            return []
        return [
            DerivedMessage(topic, time_ns, CAM_MAKERS[topic](self._robot(cam), time_ns))
            for topic in self.topics
            if topic in CAM_MAKERS
        ]

    def of_tick(
        self,
        start: CamState,
        end: CamState,
        rows: FloatArray,
        wanted: Set[Topic] | None = None,
        selection: Indices | None = None,
    ) -> list[DerivedMessage]:
        """Return the derived messages of a tick in the order of time.

        Parameters
        ----------
        start, end : CamState
            Cam states at the start and the end of the tick.
        rows : ndarray, shape (6, n)
            Samples of the tick.
        wanted : set of Topic, optional
            Topics of the messages (default: all topics of this object).
        selection : ndarray of int, optional
            Indices of the samples (default: the instants of `select_samples`).
        """
        chosen = [t for t in self.topics if t in INSTANT_MAKERS and (wanted is None or t in wanted)]
        if not chosen or start.cam not in self._loaded.laws:
            return []
        law, points = self._loaded.laws[start.cam], self._points if selection is None else selection
        instants = instants_of(law, start, end, rows, self.sample_rate, points)
        messages = [
            DerivedMessage(topic, time_ns, cdr)
            for topic in chosen
            for time_ns, cdr in zip(
                instants.time_ns.tolist(), self._maker(topic, start.cam)(instants), strict=True
            )
        ]
        return sorted(messages, key=attrgetter("time_ns"))

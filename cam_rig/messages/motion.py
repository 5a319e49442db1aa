"""The motion as standard messages, at the instants of each tick: for people and their viewers.

They follow from what else is published: the follower sends them while somebody subscribes, and the
recorder makes the same bytes by itself. A further topic is a further `MotionPart`; those of the
robot are in `cam_rig.robot.derived`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set
from operator import attrgetter
from typing import Any, NamedTuple, Protocol

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.messages import topics
from cam_rig.messages.cdr_template import TYPES, CdrTemplate, example_header
from cam_rig.messages.instants import Indices, Instants, instants_of
from cam_rig.messages.topics import Topic
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState

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

        Raises
        ------
        RefusedError : the samples are not the tick's
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

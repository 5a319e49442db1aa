"""Two recordings of one run, number by number."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cam_rig.bag.reader import messages, raw_messages
from cam_rig.dynamics import COLUMNS
from cam_rig.errors import BagError
from cam_rig.messages import topics
from cam_rig.messages.codec import block_of, cam_state_of, stamp_ns
from cam_rig.messages.serialization import read_message
from cam_rig.messages.topics import Topic
from cam_rig.show.result import Column, Records, Result
from cam_rig.simulation.schedule import CamState
from cam_rig.units import FloatArray

#: What the follower and the microphone publish for each tick; the rest follows from it.
COMPARED = tuple(topic for topic in topics.RECEIVED if topic.per == "tick")


@dataclass
class Difference:
    """The largest difference of one quantity between two recordings, and its largest value."""

    topic: str
    quantity: str
    count: int = 0
    difference: float = 0.0
    largest: float = 0.0

    @property
    def relative(self) -> float:
        """The largest difference over the largest value."""
        if self.difference == 0.0:
            return 0.0
        return self.difference / self.largest if self.largest > 0.0 else float("inf")


@dataclass(frozen=True, repr=False)
class ReplayResult(Result):
    """A bag's recorded numbers against replayed ones; off where one differs beyond a tolerance."""

    schema = "cam_rig.replay.1"
    columns: ClassVar = {
        "differences": (
            Column("topic"),
            Column("quantity"),
            Column("count", "", "d", "numbers"),
            Column("difference", "", ".3g", doc="the largest, in the quantity's unit"),
            Column("relative", "", ".2g", doc="the largest difference over the largest value"),
        )
    }

    bag: Path
    differences: tuple[Difference, ...]
    tolerance: float

    @property
    def worst(self) -> Difference:
        """The quantity that is farthest off."""
        return max(self.differences, key=lambda entry: entry.relative)

    @property
    def exit_code(self) -> int:  # type: ignore[override]
        """1 where a number is off."""
        return 0 if self.worst.relative <= self.tolerance else 1

    def tables(self) -> list[Records]:
        """A row a quantity."""
        return [self.table("differences", "Recorded against replayed", self.differences)]

    def summary(self) -> list[str]:
        """What is off, if anything."""
        worst = self.worst
        words = (
            f"{self.bag}: {worst.topic} {worst.quantity} differs by {worst.difference:.3g}, "
            f"{worst.relative:.3g} of its largest value; allowed: {self.tolerance:g}"
        )
        return [words] if self.exit_code else []


def compare(one: Path, other: Path) -> list[Difference]:
    """The differences of all that follower and microphone published in two recordings."""
    found: dict[tuple[str, str], Difference] = {}
    for topic in COMPARED:
        pairs = zip_longest(_quantities(one, topic), _quantities(other, topic))
        for number, (here, there) in enumerate(pairs):
            if here is None or there is None:
                short = one if here is None else other
                raise BagError(f"{short}: {topic.name} has {number} messages, the other bag more")
            for name, value in here.items():
                entry = found.setdefault((topic.name, name), Difference(topic.name, name))
                _note(entry, value, there[name], f"{one}: {topic.name} message {number}")
    return list(found.values())


def _note(entry: Difference, one: FloatArray, other: FloatArray, where: str) -> None:
    if one.shape != other.shape:
        raise BagError(f"{where}: has {one.size} numbers, in the other bag {other.size}")
    entry.count += one.size
    away = float(np.abs(one - other).max(initial=0.0))
    entry.difference = max(entry.difference, away) if np.isfinite(away) else float("inf")
    entry.largest = max(entry.largest, float(np.abs(one).max(initial=0.0)))


def _quantities(bag: Path, topic: Topic) -> Iterator[dict[str, FloatArray]]:
    for _, _, message in messages(bag, (topic,)):
        yield {name: np.atleast_1d(value) for name, value in _numbers(topic, message)}


def _numbers(topic: Topic, message: Any) -> Iterator[tuple[str, Any]]:
    if topic.stamped:
        yield "stamp [ns]", np.array([stamp_ns(message.header.stamp)])
    if topic is topics.FOLLOWER_SAMPLES:
        yield from zip(COLUMNS, block_of(message), strict=True)
    elif topic is topics.FOLLOWER_STATE:
        yield "lift [m]", message.position
        yield "velocity [m/s]", message.velocity
        yield "contact_force [N]", message.effort
    elif topic is topics.PRESSURE:
        yield "pressure [Pa]", message.fluid_pressure
    else:
        yield "value", message.data


# A recorded drive's and law server's messages, to be published again.

#: In the order in which they go out at one rig time.
PLAYED = (topics.LAW_COEFFICIENTS, topics.PROFILE, topics.LAW, topics.CLOCK, topics.CAM_STATE)
#: Decoded, not only passed on.
READ = (topics.CAM_STATE, topics.DIAGNOSTICS)
#: A level's letter symbol; a bag's maker may have written anything there.
SYMBOL = re.compile("L[ACZ][FS]")


@dataclass(frozen=True)
class Played:
    """A state, all serialized messages up to it, and what the microphone read then, if known."""

    state: CamState
    messages: tuple[tuple[Topic, bytes], ...]
    quantity: str = ""


def played(bag: Path) -> Iterator[Played]:
    """The messages state by state; what a bag holds after its last state is left out."""
    by_name = {t.name: t for t in (*PLAYED, topics.DIAGNOSTICS)}
    waiting: list[tuple[Topic, bytes]] = []
    last: Played | None = None
    for connection, _, data in raw_messages(bag, set(by_name)):
        topic = by_name[connection.topic]
        message = read_message(topic, bytes(data))[0] if topic in READ else None
        if topic is topics.DIAGNOSTICS:
            last = last and replace(last, quantity=quantity_of(message) or last.quantity)
            continue
        if topic is topics.LAW and last is not None:  # written after its state
            last = replace(last, messages=(*last.messages, (topic, bytes(data))))
            continue
        waiting.append((topic, bytes(data)))
        if topic is topics.CAM_STATE:
            if last is not None:
                yield last
            last = Played(cam_state_of(message), tuple(waiting))
            waiting.clear()
    if last is not None:
        yield last


def quantity_of(diagnostic: Any) -> str:
    """What the microphone reads, by its diagnostics; empty by another node's."""
    for status in diagnostic.status:
        values = {pair.key: pair.value for pair in status.values}
        if status.name == "microphone" and SYMBOL.fullmatch(values.get(topics.QUANTITY, "")):
            return str(values[topics.QUANTITY])
    return ""

"""Comparison of two recordings of one run, number by number."""

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

#: Topics of follower and microphone that are compared: those with one message per tick, the time
#: between two cam states. All other results follow from them.
COMPARED = tuple(topic for topic in topics.RECEIVED if topic.per == "tick")


@dataclass
class Difference:
    """Largest difference of one quantity between two recordings.

    `difference` is the largest absolute difference and `largest` the largest absolute value, both
    in the unit of the quantity. `count` is the number of compared values.
    """

    topic: str
    quantity: str
    count: int = 0
    difference: float = 0.0
    largest: float = 0.0

    @property
    def relative(self) -> float:
        """Largest difference of a quantity, relative to the largest value of the quantity."""
        if self.difference == 0.0:
            return 0.0
        return self.difference / self.largest if self.largest > 0.0 else float("inf")


@dataclass(frozen=True, repr=False)
class ReplayResult(Result):
    """Differences between the recorded numbers of a bag and the replayed numbers.

    `tolerance` is the largest allowed relative difference.
    """

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
        """Quantity with the largest relative difference between recording and replay."""
        return max(self.differences, key=lambda entry: entry.relative)

    @property
    def exit_code(self) -> int:  # type: ignore[override]
        """Exit code of the command: 1 if a quantity exceeds the tolerance, else 0."""
        return 0 if self.worst.relative <= self.tolerance else 1

    def tables(self) -> list[Records]:
        """Return the table of differences between recording and replay.

        It has one row per quantity.
        """
        return [self.table("differences", "Recorded against replayed", self.differences)]

    def summary(self) -> list[str]:
        """Return a line on the largest difference between recording and replay.

        The list is empty if the difference is within the tolerance.
        """
        worst = self.worst
        text = (
            f"{self.bag}: {worst.topic} {worst.quantity} differs by {worst.difference:.3g}, "
            f"{worst.relative:.3g} of its largest value, more than {self.tolerance:g}"
        )
        return [text] if self.exit_code else []


def compare(first: Path, second: Path) -> list[Difference]:
    """Return the differences of all messages per tick of two recordings.

    These are the messages of the follower and the microphone. Raises BagError if the bags have
    different numbers of messages or of values. A tick is the time between two cam states. `first`
    and `second` are the bags of the recordings.
    """
    differences: dict[tuple[str, str], Difference] = {}
    for topic in COMPARED:
        pairs = zip_longest(_quantities(first, topic), _quantities(second, topic))
        for number, (values, other_values) in enumerate(pairs):
            if values is None or other_values is None:
                shorter = first if values is None else second
                raise BagError(
                    f"{shorter}: {topic.name} has {number} messages, fewer than the other bag"
                )
            for name, value in values.items():
                entry = differences.setdefault((topic.name, name), Difference(topic.name, name))
                _add_values(
                    entry, value, other_values[name], f"{first}: {topic.name} message {number}"
                )
    return list(differences.values())


def _add_values(entry: Difference, values: FloatArray, others: FloatArray, label: str) -> None:
    if values.shape != others.shape:
        raise BagError(f"{label}: has {values.size} values, in the other bag {others.size}")
    entry.count += values.size
    difference = float(np.abs(values - others).max(initial=0.0))
    entry.difference = (
        max(entry.difference, difference) if np.isfinite(difference) else float("inf")
    )
    entry.largest = max(entry.largest, float(np.abs(values).max(initial=0.0)))


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


# Messages of a recorded drive and law server, to be published again.

#: Topics whose recorded messages a replay publishes, in their order at one rig time.
REPLAYED_TOPICS = (
    topics.LAW_COEFFICIENTS,
    topics.PROFILE,
    topics.LAW,
    topics.CLOCK,
    topics.CAM_STATE,
)
#: Topics whose messages a replay decodes. The messages of all other topics are passed on as bytes.
READ = (topics.CAM_STATE, topics.DIAGNOSTICS)
#: Pattern of the letter symbol of a sound level, such as LAF. It is checked because the bag may
#: contain any text.
SYMBOL = re.compile("L[ACZ][FS]")


@dataclass(frozen=True)
class ReplayStep:
    """Step of a replay: a cam state, and the messages since the previous state.

    `messages` contains topic and serialized message. `quantity` is the quantity that the microphone
    measures, such as LAF, empty if unknown.
    """

    state: CamState
    messages: tuple[tuple[Topic, bytes], ...]
    quantity: str = ""


def replay_steps(bag: Path) -> Iterator[ReplayStep]:
    """Yield the messages of a bag, grouped by cam state.

    Messages after the last state are left out.
    """
    by_name = {t.name: t for t in (*REPLAYED_TOPICS, topics.DIAGNOSTICS)}
    pending: list[tuple[Topic, bytes]] = []
    group: ReplayStep | None = None
    for connection, _, data in raw_messages(bag, set(by_name)):
        topic = by_name[connection.topic]
        message = read_message(topic, bytes(data))[0] if topic in READ else None
        if topic is topics.DIAGNOSTICS:
            group = group and replace(group, quantity=quantity_of(message) or group.quantity)
            continue
        if topic is topics.LAW and group is not None:  # recorders write a law after its state
            group = replace(group, messages=(*group.messages, (topic, bytes(data))))
            continue
        pending.append((topic, bytes(data)))
        if topic is topics.CAM_STATE:
            if group is not None:
                yield group
            group = ReplayStep(cam_state_of(message), tuple(pending))
            pending.clear()
    if group is not None:
        yield group


def quantity_of(diagnostic: Any) -> str:
    """Return the quantity that the microphone measures, from a diagnostic message.

    The quantity is a letter symbol such as LAF. The result is empty for another node.
    """
    for status in diagnostic.status:
        values = {pair.key: pair.value for pair in status.values}
        if status.name == "microphone" and SYMBOL.fullmatch(values.get(topics.QUANTITY, "")):
            return str(values[topics.QUANTITY])
    return ""

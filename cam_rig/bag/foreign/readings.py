"""Readings of quantities from the topics of any ROS 2 bag, as signals."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Connection
from rosbags.typesys.store import Typestore

from cam_rig.acoustics import level_db
from cam_rig.bag.files import UNREADABLE, damaged
from cam_rig.bag.foreign.fields import number_at, only_field
from cam_rig.bag.foreign.topic_line import MappedField
from cam_rig.bag.foreign.turns import Counter, count_turns
from cam_rig.bag.foreign.types import integer_span, types_of
from cam_rig.bag.reader import CDR, encoding_of, readers, topic_list, topics_of
from cam_rig.errors import BagError, did_you_mean
from cam_rig.simulation.instruments import ReadingCount, Signal
from cam_rig.units import NS, FloatArray

#: Readings of one quantity, at most: each takes 24 bytes.
MAX_READINGS = 20_000_000


@dataclass
class _Readings:
    """Readings of one quantity in the order of the bag."""

    bag: Path
    source: MappedField
    values: array[float] = field(default_factory=lambda: array("d"))
    #: Stamps of the messages' headers, 0 without one, and log times, ns.
    stamps: array[int] = field(default_factory=lambda: array("q"))
    log_times: array[int] = field(default_factory=lambda: array("q"))
    messages: int = 0
    #: True if the header of any message of the topic has a time.
    has_stamps: bool = False
    #: Values of the integer type of the field; None if it is another type.
    values_of_type: int | None = None
    #: Why the first message without the number has none.
    first_error: str = ""

    def take(self, message: Any, log_time: int, types: Typestore) -> None:
        """Note the number of a message; without the joint or the field it is no reading."""
        ns = _stamp_ns(message)
        self.messages += 1
        self.has_stamps |= ns > 0
        try:
            path = self.source.field or only_field(message)
            value = number_at(message, path)
        except ValueError as error:
            self.first_error = self.first_error or f"[{message.__msgtype__}]: {error}"
            return
        if not self.values:
            self.values_of_type = integer_span(types, message.__msgtype__, path)
        if len(self.values) >= MAX_READINGS:
            raise BagError(
                f"{self.bag}: {self.source.quantity}: {self.source.topic} has more than "
                f"{MAX_READINGS} readings; allowed: {MAX_READINGS}, so cut the bag with: ros2 bag "
                "convert"
            )
        self.values.append(value)
        self.stamps.append(ns)
        self.log_times.append(log_time)

    @property
    def headed(self) -> bool:
        """True if the time is that of the message's header."""
        return self.has_stamps and not self.source.bag_time

    @property
    def counter(self) -> Counter | None:
        """The integers in which the quantity comes; None for other numbers."""
        if self.values_of_type is None:
            return None
        return Counter(abs(self.source.factor), self.values_of_type)

    def selected(self) -> tuple[NDArray[np.int64], FloatArray, list[str]]:
        """Return times (ns) and values in SI in the order of time, each time once; and notes."""
        what, notes = self.source.quantity, []
        if without := self.messages - len(self.values):
            name = self.source.field or "number"
            notes.append(f"{what}: {without} of {self.messages} messages have no {name}: skipped.")
        times = np.frombuffer(self.stamps if self.headed else self.log_times, dtype=np.int64)
        values = np.frombuffer(self.values, dtype=np.float64) * self.source.factor
        if self.source.unit == "Pa":
            with np.errstate(divide="ignore"):
                values = level_db(np.abs(values))
        timed = times > 0 if self.headed else np.ones(times.size, dtype=np.bool_)
        if untimed := int(np.count_nonzero(~timed)):
            notes.append(
                f"{what}: {untimed} of {times.size} readings have the stamp 0, which is no time: "
                "dropped."
            )
        finite = np.isfinite(values)
        if lost := int(np.count_nonzero(~finite)):
            notes.append(f"{what}: {lost} of {values.size} readings are not numbers: dropped.")
        times, values = times[timed & finite], values[timed & finite]
        if disordered := int(np.count_nonzero(np.diff(times) < 0)):
            notes.append(f"{what}: {disordered} stamps are before the last one: sorted.")
        order = np.argsort(times, kind="stable")
        times, values = times[order], values[order]
        first = np.append(True, np.diff(times) > 0)[: times.size]
        if doubled := int(np.count_nonzero(~first)):
            notes.append(f"{what}: {doubled} of the stamps are doubled: the first is kept.")
        return times[first], values[first], notes


def _stamp_ns(message: Any) -> int:
    """Return the time (ns) of a message by its header, or by its field stamp; 0 without one."""
    stamp = getattr(getattr(message, "header", message), "stamp", None)
    if stamp is None or not hasattr(stamp, "sec"):
        return 0
    return max(0, int(stamp.sec) * NS + int(stamp.nanosec))


@dataclass(frozen=True, eq=False)
class ForeignSignals:
    """Signals by quantity, the time (ns) from which theirs count, and what was done."""

    signals: dict[str, Signal]
    begin_ns: int
    counts: tuple[ReadingCount, ...]
    notes: tuple[str, ...]


def read_signals(bag: Path, mapping: dict[str, MappedField]) -> ForeignSignals:
    """Return the signals of a bag; the angle has all its turns and rises."""
    return _signals(bag, _read(bag, mapping))


def _read(bag: Path, mapping: dict[str, MappedField]) -> list[_Readings]:
    there = topics_of(bag)
    by_topic: dict[str, list[_Readings]] = {}
    for one in mapping.values():
        located = _located(bag, one, there)
        by_topic.setdefault(located.topic, []).append(_Readings(bag, located))
    known: dict[Any, Typestore] = {}
    try:
        for reader in readers(bag):
            wanted = [c for c in reader.connections if c.topic in by_topic and c.msgcount]
            for connection in wanted:
                _require_cdr(bag, by_topic[connection.topic][0].source, connection)
            for connection, log_time, data in reader.messages(wanted) if wanted else ():
                key = connection.msgtype, connection.msgdef
                if key not in known:
                    known[key] = types_of(bag, connection)
                message = known[key].deserialize_cdr(data, connection.msgtype)
                for readings in by_topic[connection.topic]:
                    readings.take(message, log_time, known[key])
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    return [one for found in by_topic.values() for one in found]


def _signals(bag: Path, found: list[_Readings]) -> ForeignSignals:
    selected = {one.source.quantity: one.selected() for one in found}
    for one in found:
        times, _, lines = selected[one.source.quantity]
        where = f"{bag}: {one.source.quantity}: {one.source.topic}"
        if one.first_error and not one.values:
            raise BagError(f"{where} {one.first_error}")
        if times.size < 2:
            raise BagError(
                f"{where} has {times.size} readings; allowed: two or more, at different times"
                + (f" ({' '.join(lines)})" if lines else "")
            )
    begin_ns = min(int(times[0]) for times, _, _ in selected.values())
    signals = {
        one.source.quantity: Signal(
            (selected[one.source.quantity][0] - begin_ns) / NS,
            selected[one.source.quantity][1],
            one.source.source,
        )
        for one in found
    }
    notes = {one.source.quantity: selected[one.source.quantity][2] for one in found}
    angle = next(one for one in found if one.source.quantity == "angle")
    counted = count_turns(signals["angle"], f"{bag}: {angle.source.source}", angle.counter)
    wrong = signals["angle"].time[counted.wrong]
    signals["angle"] = counted.signal
    for one in found:
        what = one.source.quantity
        same = one.source.topic == angle.source.topic and one.headed == angle.headed
        if same and what != "angle" and wrong.size:
            kept = ~np.isin(signals[what].time, wrong)
            if dropped := int(np.count_nonzero(~kept)):
                notes[what].append(
                    f"{what}: {dropped} readings are of messages with a wrong angle: dropped."
                )
            signal = signals[what]
            signals[what] = replace(signal, time=signal.time[kept], value=signal.value[kept])
    return ForeignSignals(
        signals,
        begin_ns,
        tuple(_count(one, signals[one.source.quantity]) for one in found),
        tuple(_sentences(found, signals, notes, counted.notes)),
    )


def _count(one: _Readings, signal: Signal) -> ReadingCount:
    return ReadingCount(one.source.quantity, one.source.source, signal.time.size, one.messages)


def _sentences(
    found: Iterable[_Readings],
    signals: dict[str, Signal],
    notes: dict[str, list[str]],
    turning: Iterable[str],
) -> list[str]:
    lines = []
    for one in found:
        what = one.source.quantity
        clock = "of the message's header" if one.headed else "of the bag"
        lines += notes[what]
        lines.append(
            f"{what}: {one.source.source}, {signals[what].time.size} readings, the time is that "
            f"{clock}."
        )
    return [*lines, *turning]


def _require_cdr(bag: Path, source: MappedField, connection: Connection) -> None:
    if (encoding := encoding_of(connection)) != CDR:
        raise BagError(
            f"{bag}: {source.quantity}: {connection.topic} has messages encoded as "
            f"{encoding or 'unknown'}; allowed: {CDR}, as of ROS 2, so name another topic"
        )


def _located(bag: Path, one: MappedField, there: dict[str, Connection]) -> MappedField:
    """Return the field with its topic's name: ``/lvdt/data`` may be the field data of /lvdt."""
    if one.topic in there:
        return one
    topic, _, last = one.topic.rpartition("/")
    if topic in there and not one.field:
        return replace(one, topic=topic, field=last)
    raise BagError(
        f"{bag}: {one.quantity}: no topic {one.topic}; allowed: {topic_list(bag)}"
        f"{did_you_mean(one.topic, there)}"
    )

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

#: Largest number of readings of one quantity. Each takes 24 bytes.
MAX_READINGS = 20_000_000


@dataclass
class _Readings:
    """Readings of one quantity in the order of the bag."""

    bag: Path
    source: MappedField
    values: array[float] = field(default_factory=lambda: array("d"))
    #: Stamps of the messages' headers (0 without a stamp) and log times, in ns.
    stamps: array[int] = field(default_factory=lambda: array("q"))
    log_times: array[int] = field(default_factory=lambda: array("q"))
    messages: int = 0
    #: True if the header of any message of the topic has a time.
    has_stamps: bool = False
    #: Number of values of the field's integer type, or None for another type.
    values_of_type: int | None = None
    #: Error of the first message without the number.
    first_error: str = ""

    def take(self, message: Any, log_time: int, types: Typestore) -> None:
        """Store the number of a message.

        A message without the joint or the field is only counted.
        """
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
        """Counter of an integer quantity, or None for other numbers."""
        if self.values_of_type is None:
            return None
        return Counter(abs(self.source.factor), self.values_of_type)

    def selected(self) -> tuple[NDArray[np.int64], FloatArray, list[str]]:
        """Return times (ns), values in SI, and notes.

        The readings are in the order of time, and each time occurs once.
        """
        name, notes = self.source.quantity, []
        if skipped := self.messages - len(self.values):
            path = self.source.field or "number"
            notes.append(f"{name}: {skipped} of {self.messages} messages have no {path}: skipped.")
        times = np.frombuffer(self.stamps if self.headed else self.log_times, dtype=np.int64)
        values = np.frombuffer(self.values, dtype=np.float64) * self.source.factor
        if self.source.unit == "Pa":
            with np.errstate(divide="ignore"):
                values = level_db(np.abs(values))
        timed = times > 0 if self.headed else np.ones(times.size, dtype=np.bool_)
        if untimed := int(np.count_nonzero(~timed)):
            notes.append(
                f"{name}: {untimed} of {times.size} readings have the stamp 0, which is no time: "
                "dropped."
            )
        finite = np.isfinite(values)
        if lost := int(np.count_nonzero(~finite)):
            notes.append(f"{name}: {lost} of {values.size} readings are not numbers: dropped.")
        times, values = times[timed & finite], values[timed & finite]
        if disordered := int(np.count_nonzero(np.diff(times) < 0)):
            notes.append(f"{name}: {disordered} stamps are before the last one: sorted.")
        order = np.argsort(times, kind="stable")
        times, values = times[order], values[order]
        first = np.append(True, np.diff(times) > 0)[: times.size]
        if repeated := int(np.count_nonzero(~first)):
            notes.append(f"{name}: {repeated} of the stamps are doubled: the first is kept.")
        return times[first], values[first], notes


def _stamp_ns(message: Any) -> int:
    """Return the time (ns) of a message by its header or its field stamp.

    Returns 0 without a stamp.
    """
    stamp = getattr(getattr(message, "header", message), "stamp", None)
    if stamp is None or not hasattr(stamp, "sec"):
        return 0
    return max(0, int(stamp.sec) * NS + int(stamp.nanosec))


@dataclass(frozen=True, eq=False)
class ForeignSignals:
    """Signals by quantity.

    `begin_ns` is the time (ns) from which their times count. `counts` contains the number of
    readings per quantity, and `notes` one sentence per change.
    """

    signals: dict[str, Signal]
    begin_ns: int
    counts: tuple[ReadingCount, ...]
    notes: tuple[str, ...]


def read_signals(bag: Path, mapping: dict[str, MappedField]) -> ForeignSignals:
    """Return the signals of a bag.

    The angle has all its turns and rises. Raises BagError for a quantity with fewer than two
    readings.
    """
    return _signals(bag, _read_topics(bag, mapping))


def _read_topics(bag: Path, mapping: dict[str, MappedField]) -> list[_Readings]:
    topics = topics_of(bag)
    by_topic: dict[str, list[_Readings]] = {}
    for mapped in mapping.values():
        located = _located(bag, mapped, topics)
        by_topic.setdefault(located.topic, []).append(_Readings(bag, located))
    types: dict[Any, Typestore] = {}
    try:
        for reader in readers(bag):
            connections = [c for c in reader.connections if c.topic in by_topic and c.msgcount]
            for connection in connections:
                _require_cdr(bag, by_topic[connection.topic][0].source, connection)
            for connection, log_time, data in reader.messages(connections) if connections else ():
                key = connection.msgtype, connection.msgdef
                if key not in types:
                    types[key] = types_of(bag, connection)
                message = types[key].deserialize_cdr(data, connection.msgtype)
                for readings in by_topic[connection.topic]:
                    readings.take(message, log_time, types[key])
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    return [readings for group in by_topic.values() for readings in group]


def _signals(bag: Path, readings: list[_Readings]) -> ForeignSignals:
    selected = {each.source.quantity: each.selected() for each in readings}
    for each in readings:
        times, _, quantity_notes = selected[each.source.quantity]
        where = f"{bag}: {each.source.quantity}: {each.source.topic}"
        if each.first_error and not each.values:
            raise BagError(f"{where} {each.first_error}")
        if times.size < 2:
            raise BagError(
                f"{where} has {times.size} readings; allowed: two or more, at different times"
                + (f" ({' '.join(quantity_notes)})" if quantity_notes else "")
            )
    begin_ns = min(int(times[0]) for times, _, _ in selected.values())
    signals = {
        each.source.quantity: Signal(
            (selected[each.source.quantity][0] - begin_ns) / NS,
            selected[each.source.quantity][1],
            each.source.source,
        )
        for each in readings
    }
    notes = {each.source.quantity: selected[each.source.quantity][2] for each in readings}
    angle = next(each for each in readings if each.source.quantity == "angle")
    counted = count_turns(signals["angle"], f"{bag}: {angle.source.source}", angle.counter)
    wrong = signals["angle"].time[counted.wrong]
    signals["angle"] = counted.signal
    for each in readings:
        name = each.source.quantity
        is_same_message = each.source.topic == angle.source.topic and each.headed == angle.headed
        if is_same_message and name != "angle" and wrong.size:
            is_kept = ~np.isin(signals[name].time, wrong)
            if dropped := int(np.count_nonzero(~is_kept)):
                notes[name].append(
                    f"{name}: {dropped} readings are of messages with a wrong angle: dropped."
                )
            signal = signals[name]
            signals[name] = replace(signal, time=signal.time[is_kept], value=signal.value[is_kept])
    return ForeignSignals(
        signals,
        begin_ns,
        tuple(_count(each, signals[each.source.quantity]) for each in readings),
        tuple(_notes(readings, signals, notes, counted.notes)),
    )


def _count(readings: _Readings, signal: Signal) -> ReadingCount:
    return ReadingCount(
        readings.source.quantity, readings.source.source, signal.time.size, readings.messages
    )


def _notes(
    readings: Iterable[_Readings],
    signals: dict[str, Signal],
    notes: dict[str, list[str]],
    angle_notes: Iterable[str],
) -> list[str]:
    lines = []
    for each in readings:
        name = each.source.quantity
        clock = "of the message's header" if each.headed else "of the bag"
        lines += notes[name]
        lines.append(
            f"{name}: {each.source.source}, {signals[name].time.size} readings, the time is that "
            f"{clock}."
        )
    return [*lines, *angle_notes]


def _require_cdr(bag: Path, source: MappedField, connection: Connection) -> None:
    if (encoding := encoding_of(connection)) != CDR:
        raise BagError(
            f"{bag}: {source.quantity}: {connection.topic} has messages encoded as "
            f"{encoding or 'unknown'}; allowed: {CDR}, as of ROS 2, so name another topic"
        )


def _located(bag: Path, mapped: MappedField, topics: dict[str, Connection]) -> MappedField:
    """Return the field with the name of an existing topic.

    If the bag has no topic ``/lvdt/data``, it may be the field data of the topic /lvdt.
    """
    if mapped.topic in topics:
        return mapped
    topic, _, last = mapped.topic.rpartition("/")
    if topic in topics and not mapped.field:
        return replace(mapped, topic=topic, field=last)
    raise BagError(
        f"{bag}: {mapped.quantity}: no topic {mapped.topic}; allowed: {topic_list(bag)}"
        f"{did_you_mean(mapped.topic, topics)}"
    )

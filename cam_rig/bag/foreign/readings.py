"""Conversion of the topics of any ROS 2 bag to measured signals."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys.store import Typestore

from cam_rig.acoustics import level_db
from cam_rig.bag.connection import CDR, Connection
from cam_rig.bag.files import UNREADABLE, error_text, read_error
from cam_rig.bag.foreign.fields import number_at, only_field
from cam_rig.bag.foreign.topic_line import MappedField
from cam_rig.bag.foreign.turns import MAX_TIMES, Counter, count_turns
from cam_rig.bag.foreign.types import integer_span, types_of
from cam_rig.bag.reader import readers, topic_list, topics_of
from cam_rig.errors import BagError, did_you_mean
from cam_rig.simulation.instruments import MeasuredRun, ReadingCount, Signal
from cam_rig.units import NS, FloatArray

#: Largest number of readings of one quantity that are read. Each reading takes 24 bytes.
MAX_READINGS = 20_000_000
#: Number of successive lift readings over which a running median is taken. Each reading is compared
#: with the median around it.
LIFT_WINDOW = 15
#: Deviation from the running median of the lift, as a multiple of the lift range, above which a
#: number is not a reading but a code such as -999. The lift of a bouncing follower deviates less.
SENTINEL_RATIO = 5.0
#: Fraction of the readings that is left out at each end when the range of the lift is determined.
#: Codes such as -999 are recognized if they are fewer than this fraction at each end.
MAX_SENTINELS = 0.01


@dataclass
class _Readings:
    """Readings of one quantity from its topic, in the order of the bag.

    `values` are in the unit of the messages. `messages` is the number of messages of the topic.
    """

    bag: Path
    source: MappedField
    values: array[float] = field(default_factory=lambda: array("d"))
    #: Stamps of the messages' headers (0 without a stamp) and log times, in ns.
    stamps: array[int] = field(default_factory=lambda: array("q"))
    log_times: array[int] = field(default_factory=lambda: array("q"))
    messages: int = 0
    #: True if the header of any message of the topic has a time.
    has_stamps: bool = False
    #: Number of values that the field's integer type can represent, None if the type is not an
    #: integer.
    values_of_type: int | None = None
    #: Error of the first message that lacks the joint or the field of the quantity, empty if there
    #: is none.
    first_error: str = ""

    def take(self, message: Any, log_time: int, types: Typestore) -> None:
        """Read the number from a message, and store it with its stamp and log time.

        A message without the joint or the field is counted, and its error is kept if it is the
        first.
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
                f"{self.bag}: {self.source.quantity}: {self.source.topic} must have at most "
                f"{MAX_READINGS} readings; shorten the bag with: ros2 bag convert"
            )
        self.values.append(value)
        self.stamps.append(ns)
        self.log_times.append(log_time)

    @property
    def headed(self) -> bool:
        """True if the time of the readings is the stamp in the message's header.

        Otherwise it is the log time of the bag.
        """
        return self.has_stamps and not self.source.bag_time

    @property
    def counter(self) -> Counter | None:
        """Integer counter of an encoder, or None if the field is not an integer."""
        if self.values_of_type is None:
            return None
        return Counter(abs(self.source.factor), self.values_of_type)

    def select(self) -> tuple[NDArray[np.int64], FloatArray, list[str]]:
        """Return times (ns), values in SI, and notes on the readings.

        The readings are sorted by time. Readings without a stamp, values that are not finite, and
        repeated times are dropped. There is one note per kind of change.
        """
        name, notes = self.source.quantity, []
        if skipped := self.messages - len(self.values):
            path = self.source.field or "number"
            notes.append(
                f"{name}: {skipped} of {self.messages} messages are skipped: they have no {path}."
            )
        times = np.frombuffer(self.stamps if self.headed else self.log_times, dtype=np.int64)
        values = np.frombuffer(self.values, dtype=np.float64) * self.source.factor
        if self.source.unit == "Pa":
            with np.errstate(divide="ignore"):
                values = level_db(np.abs(values))
        timed = times > 0 if self.headed else np.ones(times.size, dtype=np.bool_)
        if untimed := int(np.count_nonzero(~timed)):
            notes.append(
                f"{name}: {untimed} of {times.size} readings are dropped: their stamp is 0."
            )
        finite = np.isfinite(values)
        if lost := int(np.count_nonzero(~finite)):
            notes.append(
                f"{name}: {lost} of {values.size} readings are dropped: they are not numbers."
            )
        times, values = times[timed & finite], values[timed & finite]
        if disordered := int(np.count_nonzero(np.diff(times) < 0)):
            notes.append(
                f"{name}: sorted, because {disordered} stamps are before the previous one."
            )
        order = np.argsort(times, kind="stable")
        times, values = times[order], values[order]
        first = np.append(True, np.diff(times) > 0)[: times.size]
        if repeated := int(np.count_nonzero(~first)):
            notes.append(f"{name}: {repeated} readings are dropped: their stamp occurs before.")
        return times[first], values[first], notes


def _stamp_ns(message: Any) -> int:
    """Return the time (ns) in a message's header, or in its field ``stamp``.

    Returns 0 without a stamp.
    """
    stamp = getattr(getattr(message, "header", message), "stamp", None)
    if stamp is None or not hasattr(stamp, "sec"):
        return 0
    return max(0, int(stamp.sec) * NS + int(stamp.nanosec))


def read_signals(bag: Path, mapping: dict[str, MappedField], cam: str = "") -> MeasuredRun:
    """Return the signals of a bag as the measured run of one cam.

    `mapping` contains the field of each quantity, and `cam` is the name of the cam. Times are in s
    from the first reading. The angle increases over all turns, without steps where the encoder
    wraps. Raises BagError for a quantity with fewer than two readings.
    """
    readings = {each.source.quantity: each for each in _read_topics(bag, mapping)}
    selected = {name: _select(bag, each) for name, each in readings.items()}
    begin_ns = min(int(times[0]) for times, _, _ in selected.values())
    signals = {
        name: Signal((times - begin_ns) / NS, values, readings[name].source.source)
        for name, (times, values, _) in selected.items()
    }
    angle = readings["angle"]
    counted = count_turns(signals["angle"], f"{bag}: {angle.source.source}", angle.counter)
    wrong = signals["angle"].time[counted.wrong]
    signals["angle"] = counted.signal
    notes, counts = list[str](), list[ReadingCount]()
    for name, each in readings.items():
        notes += selected[name][2]
        if name == "lift":
            signals[name] = _drop_sentinels(signals[name], notes)
        is_same_message = each.source.topic == angle.source.topic and each.headed == angle.headed
        if is_same_message and name != "angle":
            signals[name], dropped = _drop_times(signals[name], wrong)
            if dropped:
                notes.append(f"{name}: {dropped} readings are dropped: their angle is wrong.")
        size, source = signals[name].time.size, each.source.source
        clock = "of the message's header" if each.headed else "of the bag"
        notes.append(f"{name}: {source}, {size} readings, the time is that {clock}.")
        counts.append(ReadingCount(name, source, size, each.messages))
    notes += counted.notes
    return MeasuredRun(
        bag, cam, **signals, notes=tuple(notes), begin_ns=begin_ns, counts=tuple(counts)
    )


def _read_topics(bag: Path, mapping: dict[str, MappedField]) -> list[_Readings]:
    topics = topics_of(bag)
    by_topic: dict[str, list[_Readings]] = {}
    for mapped in mapping.values():
        located = _locate(bag, mapped, topics)
        by_topic.setdefault(located.topic, []).append(_Readings(bag, located))
    types: dict[Any, Typestore] = {}
    begin_ns: int | None = None
    try:
        for reader in readers(bag):
            connections = [c for c in reader.connections if c.topic in by_topic and c.msgcount]
            for connection in connections:
                if connection.encoding != CDR:
                    raise BagError(
                        f"{bag}: {by_topic[connection.topic][0].source.quantity}: the encoding of "
                        f"{connection.topic} must be {CDR}, as in ROS 2, got "
                        f"{connection.encoding or 'unknown'}; name another topic"
                    )
            for connection, log_time, data in reader.messages(connections) if connections else ():
                key = connection.msgtype, connection.msgdef
                if key not in types:
                    types[key] = types_of(bag, connection)
                begin_ns = log_time if begin_ns is None else begin_ns
                try:
                    message = types[key].deserialize_cdr(data, connection.msgtype)
                except UNREADABLE as error:
                    raise BagError(
                        f"{bag}: the message of {connection.topic} at "
                        f"{(log_time - begin_ns) / NS:.6g} s is damaged or truncated "
                        f"({error_text(error)}); name another topic, or record it again"
                    ) from None
                for readings in by_topic[connection.topic]:
                    readings.take(message, log_time, types[key])
    except UNREADABLE as error:
        raise read_error(bag, error) from None
    return [readings for group in by_topic.values() for readings in group]


def _select(bag: Path, readings: _Readings) -> tuple[NDArray[np.int64], FloatArray, list[str]]:
    """Return times (ns), values (SI) and notes of the readings of one quantity.

    Raises BagError for fewer than two readings at different times.
    """
    times, values, notes = readings.select()
    where = f"{bag}: {readings.source.quantity}: {readings.source.topic}"
    if readings.first_error and not readings.values:
        raise BagError(f"{where} {readings.first_error}")
    if times.size < 2:
        raise BagError(
            f"{where} must have at least two readings at different times, got {times.size}"
            + (f" ({' '.join(notes)})" if notes else "")
        )
    return times, values, notes


def _drop_times(signal: Signal, wrong: FloatArray) -> tuple[Signal, int]:
    """Remove the readings at some times from a signal.

    Returns the signal, and the number of removed readings.
    """
    is_kept = ~np.isin(signal.time, wrong)
    kept = replace(signal, time=signal.time[is_kept], value=signal.value[is_kept])
    return kept, int(np.count_nonzero(~is_kept))


def _drop_sentinels(lift: Signal, notes: list[str]) -> Signal:
    """Return a lift without numbers such as -999 that a gauge reports instead of a reading.

    They are far from the readings next to them, compared with the range of the lift. A note with
    their times is added to `notes`.
    """
    from scipy.ndimage import median_filter

    smooth = median_filter(lift.value, min(LIFT_WINDOW, lift.value.size), mode="nearest")
    # The range is the larger of two estimates: the median hides the lift if a turn has few
    # readings, and the quantiles hide it if the cam was stopped for nearly all of the recording.
    low, high = np.quantile(lift.value, [MAX_SENTINELS, 1.0 - MAX_SENTINELS])
    span = max(float(high - low), float(np.ptp(smooth)))
    wrong = np.flatnonzero(np.abs(lift.value - smooth) > SENTINEL_RATIO * span)
    if not wrong.size or span == 0.0:
        return lift
    times = ", ".join(f"{time:.6g}" for time in lift.time[wrong[:MAX_TIMES]])
    more = f" and {wrong.size - MAX_TIMES} more" if wrong.size > MAX_TIMES else ""
    notes.append(
        f"lift: {wrong.size} wrong readings, at {times} s{more}, were dropped: they are more than "
        f"{SENTINEL_RATIO:g} times the lift away from the readings next to them."
    )
    return _drop_times(lift, lift.time[wrong])[0]


def _locate(bag: Path, mapped: MappedField, topics: dict[str, Connection]) -> MappedField:
    """Return a mapped field with the name that its topic has in the bag.

    The last part of a topic's name may be a field: ``/lvdt/data`` means the field data of the topic
    /lvdt if the bag has no topic /lvdt/data. Raises BagError if the bag has neither topic.
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

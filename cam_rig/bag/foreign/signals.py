"""Fields of standard messages of any ROS 2 bag, as signals."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from cam_rig.acoustics import level_db
from cam_rig.arrays import FloatArray
from cam_rig.bag.damage import UNREADABLE, damaged
from cam_rig.bag.foreign.message_fields import number_at
from cam_rig.bag.foreign.topic_map import MappedField
from cam_rig.bag.reader import readers
from cam_rig.errors import BagError, did_you_mean
from cam_rig.simulation.measured_run import Signal
from cam_rig.units import NS

#: Readings of one quantity that are taken, at most: each is 16 bytes, and is held.
MAX_READINGS = 20_000_000


@dataclass
class _Readings:
    """Readings of one quantity as they come."""

    source: MappedField
    stamps: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))
    headed: bool = False

    def take(self, message: Any, log_time: int) -> None:
        """Note the number of a message, at the stamp of its header if that is one."""
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        ns = 0 if stamp is None else int(stamp.sec) * NS + int(stamp.nanosec)
        self.headed = ns > 0 and not self.source.bag_time
        self.stamps.append(ns if self.headed else log_time)
        self.values.append(number_at(message, self.source.field))
        if len(self.values) > MAX_READINGS:
            raise ValueError(
                f"more than {MAX_READINGS} readings; allowed: as many, so cut it with: "
                "ros2 bag convert"
            )

    def signal(self, begin_ns: int) -> tuple[Signal, list[str]]:
        """The readings in the order of their time, each time once; and what was done."""
        what, notes = self.source.quantity, []
        source = f"{self.source.topic}.{self.source.field}".rstrip(".")
        stamps = np.frombuffer(self.stamps, dtype=np.int64)
        values = np.frombuffer(self.values, dtype=np.float64) * self.source.factor
        if self.source.unit == "Pa":
            with np.errstate(divide="ignore"):
                values = level_db(np.abs(values))
        finite = np.isfinite(values)
        if lost := int(np.count_nonzero(~finite)):
            notes.append(f"{what}: {lost} of {values.size} readings are not numbers: dropped.")
        stamps, values = stamps[finite], values[finite]
        if disordered := int(np.count_nonzero(np.diff(stamps) < 0)):
            notes.append(f"{what}: {disordered} stamps are before the last one: sorted.")
        order = np.argsort(stamps, kind="stable")
        stamps, values = stamps[order], values[order]
        first = np.append(True, np.diff(stamps) > 0)
        if doubled := int(np.count_nonzero(~first)):
            notes.append(f"{what}: {doubled} of the stamps are doubled: the first is kept.")
        time: FloatArray = (stamps[first] - begin_ns) / NS
        clock = "of the message's header" if self.headed else "of the bag"
        notes.append(f"{what}: {source}, {time.size} readings, the time is that {clock}.")
        return Signal(time, values[first], source), notes


def read_fields(
    bag: Path, mapping: dict[str, MappedField]
) -> tuple[dict[str, Signal], int, list[str]]:
    """Signals by quantity, the stamp (ns) that their times count from, and what was found.

    Raises
    ------
    BagError : the bag cannot be read, or has no such topic or field; it says what it has
    """
    there = topic_types(bag)
    types = get_typestore(Stores.ROS2_KILTED)
    by_topic: dict[str, list[_Readings]] = {}
    for one in mapping.values():
        found = _located(bag, one, there)
        if there[found.topic] not in types.fielddefs:
            raise BagError(
                f"{bag}: {found.topic} is {there[found.topic]}, which is not a standard message; "
                "allowed: those of std_msgs, sensor_msgs, geometry_msgs and the like"
            )
        by_topic.setdefault(found.topic, []).append(_Readings(found))
    try:
        for reader in readers(bag):
            wanted = [c for c in reader.connections if c.topic in by_topic]
            for connection, log_time, data in reader.messages(wanted) if wanted else ():
                message = types.deserialize_cdr(data, connection.msgtype)
                for readings in by_topic[connection.topic]:
                    _take(bag, readings, message, log_time)
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    return _signals(bag, [one for found in by_topic.values() for one in found])


def _take(bag: Path, readings: _Readings, message: Any, log_time: int) -> None:
    try:
        readings.take(message, log_time)
    except ValueError as error:
        kind = message.__msgtype__
        raise BagError(
            f"{bag}: {readings.source.quantity}: {readings.source.topic} [{kind}]: {error}"
        ) from None


def _signals(bag: Path, found: list[_Readings]) -> tuple[dict[str, Signal], int, list[str]]:
    for one in found:
        if len(one.values) < 2:
            raise BagError(
                f"{bag}: {one.source.quantity}: {one.source.topic} has {len(one.values)} readings; "
                "allowed: two or more"
            )
    begin_ns = min(min(one.stamps) for one in found)
    signals, notes = {}, []
    for one in found:
        signals[one.source.quantity], words = one.signal(begin_ns)
        if signals[one.source.quantity].time.size < 2:
            raise BagError(f"{bag}: {' '.join(words)} Allowed: two or more at times of their own")
        notes += words
    return signals, begin_ns, notes


def topic_types(bag: Path) -> dict[str, str]:
    """Type by name of the topics of a bag that have messages.

    Raises
    ------
    BagError : no such bag, or one that was not closed
    """
    found = {
        connection.topic: connection.msgtype
        for reader in readers(bag)
        for connection in reader.connections
        if connection.msgcount
    }
    return dict(sorted(found.items()))


def topic_list(bag: Path) -> str:
    """The topics of a bag with their types, for an error."""
    there = topic_types(bag)
    return ", ".join(f"{name} [{kind}]" for name, kind in there.items()) or "no messages"


def _located(bag: Path, one: MappedField, there: dict[str, str]) -> MappedField:
    """The field with its topic as it is called in the bag: ``/lvdt/data`` may mean /lvdt's data."""
    if one.topic in there:
        return one
    topic, _, last = one.topic.rpartition("/")
    if topic in there and not one.field:
        return replace(one, topic=topic, field=last)
    raise BagError(
        f"{bag}: {one.quantity}: no topic {one.topic}; allowed: {topic_list(bag)}"
        f"{did_you_mean(one.topic, there)}"
    )

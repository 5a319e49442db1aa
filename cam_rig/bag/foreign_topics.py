"""Fields of standard messages of any ROS 2 bag, as signals."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from cam_rig.acoustics import level_db
from cam_rig.bag.files import UNREADABLE, damaged
from cam_rig.bag.reader import readers
from cam_rig.errors import BagError, ConfigError, did_you_mean
from cam_rig.schema.quantity import UNITS
from cam_rig.simulation.instruments import Signal
from cam_rig.units import NS, TURN, FloatArray

# Which field of which topic is the cam angle, the lift, the force, the level: in one line.

#: What may be named, with its unit where none is given, and those that are allowed. An angle may
#: be in counts too, "turn/1024"; an r.m.s. sound pressure in Pa is taken as a level.
QUANTITIES: dict[str, dict[str, float]] = {
    "angle": UNITS["angle"],
    "lift": {**UNITS["length"], "um": 1e-6},
    "force": {**UNITS["force"], "kN": 1e3},
    "level": {**UNITS["level"], "Pa": 1.0},
}
#: A unit of an angle: so many counts a turn.
COUNTS = re.compile(r"turn/([1-9]\d{0,8})")
#: An item: quantity, sign, topic and field, unit, whose time.
ITEM = re.compile(
    r"(?P<quantity>\w+)=(?P<sign>-?)(?P<topic>/[\w/]+)(?:\.(?P<field>[\w.\[\]]+))?"
    r"(?::(?P<unit>[^@\s]+))?(?P<time>@bag)?"
)
EXAMPLE = "angle=/encoder.position[0]:deg lift=/lvdt.data:mm"


@dataclass(frozen=True)
class MappedField:
    """Where a quantity is read: in a field, by dotted names, of a topic; empty: its only number.

    ``unit`` is one of `QUANTITIES` or counts a turn; ``sign`` -1 of a sensor that counts the other
    way; with ``bag_time`` the time is that of the bag, and not of the message's header.
    """

    quantity: str
    topic: str
    field: str = ""
    unit: str = ""
    sign: float = 1.0
    bag_time: bool = False

    @property
    def factor(self) -> float:
        """From the numbers of the message to SI."""
        if counts := COUNTS.fullmatch(self.unit):
            return self.sign * TURN / int(counts[1])
        return self.sign * QUANTITIES[self.quantity][self.unit]


def parse_topics(line: str) -> dict[str, MappedField]:
    """The fields of a line of ``quantity=topic.field:unit``, by quantity."""
    found: dict[str, MappedField] = {}
    for item in line.split():
        one = _parsed(item)
        if one.quantity in found:
            raise ConfigError(f"--topics: {one.quantity} is named twice; allowed: once")
        found[one.quantity] = one
    if "angle" not in found or len(found) == 1:
        named = ", ".join(found) or "nothing"
        raise ConfigError(
            f"--topics: names {named}; allowed: the angle and at least one of "
            f"{', '.join(list(QUANTITIES)[1:])}, as in '{EXAMPLE}'"
        )
    return found


def _parsed(item: str) -> MappedField:
    match = ITEM.fullmatch(item)
    if match is None:
        raise ConfigError(
            f"--topics: {item!r} is not QUANTITY=/TOPIC.FIELD:UNIT; an example: '{EXAMPLE}'"
        )
    quantity = match["quantity"]
    if quantity not in QUANTITIES:
        raise ConfigError(
            f"--topics: unknown quantity {quantity!r}; allowed: {', '.join(QUANTITIES)}"
            f"{did_you_mean(quantity, QUANTITIES)}"
        )
    units = QUANTITIES[quantity]
    unit = match["unit"] or next(iter(units))
    if unit not in units and not (quantity == "angle" and COUNTS.fullmatch(unit)):
        counts = ", turn/1024 (counts)" if quantity == "angle" else ""
        raise ConfigError(
            f"--topics: {quantity} has unit {unit!r}; allowed: {', '.join(units)}{counts}"
            f"{did_you_mean(unit, units)}"
        )
    sign = -1.0 if match["sign"] else 1.0
    return MappedField(
        quantity, match["topic"], match["field"] or "", unit, sign, match["time"] is not None
    )


# A number of a message by the path of its field: ``wrench.force.z``, ``position[0]``.

#: Fields that are named in an error, at most.
MAX_NAMED = 24
PART = re.compile(r"(?P<name>\w+)(?:\[(?P<index>\w+)\])?")


def number_at(message: Any, path: str) -> float:
    """The number at a path, by a joint's name too; an empty one is that of the only number."""
    path = path or _only(message)
    value = message
    for part in path.split("."):
        match, there = PART.fullmatch(part), getattr(value, "__dataclass_fields__", {})
        if match is None or match["name"] not in there or match["name"].startswith("_"):
            raise ValueError(_unknown(message, path))
        owner, value = value, getattr(value, match["name"])
        if match["index"] is not None:
            value = _entry(owner, value, match["name"], match["index"])
    if isinstance(value, np.ndarray | list):
        raise ValueError(f"{path!r} holds {len(value)} numbers; allowed: one, as {path}[0]")
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.number):
        raise ValueError(_unknown(message, path))
    return float(value)


def _entry(owner: Any, values: Any, name: str, index: str) -> Any:
    """An entry of an array, by its number or by the joint it is of."""
    if not hasattr(values, "__len__"):
        raise ValueError(f"{name!r} is one value; allowed: without [{index}]")
    names = list(getattr(owner, "name", []))
    if not index.isdigit():
        if index not in names:
            raise ValueError(
                f"{name!r} has no entry {index!r}; allowed: numbers from 0 on"
                + (f", or {', '.join(names)}" if names else "")
                + did_you_mean(index, names)
            )
        index = str(names.index(index))
    if int(index) >= len(values):
        raise ValueError(f"{name!r} has {len(values)} entries; allowed: less than [{index}]")
    return values[int(index)]


def numeric_fields(message: Any, before: str = "") -> Iterator[str]:
    """The paths of all numbers of a message, without those of its header."""
    for name in getattr(message, "__dataclass_fields__", {}):
        value, path = getattr(message, name), f"{before}{name}"
        if name.startswith("_") or path == "header":
            continue
        if hasattr(value, "__dataclass_fields__"):
            yield from numeric_fields(value, f"{path}.")
        elif isinstance(value, np.ndarray):
            yield from (f"{path}[{i}]" for i in range(min(len(value), MAX_NAMED)))
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield path


def _only(message: Any) -> str:
    """The path of the number that a message with one number has; or its measured value."""
    found = list(numeric_fields(message))
    if len(found) == 1:
        return found[0]
    for usual in ("range", "fluid_pressure", "temperature"):  # beside limits and variances
        if usual in found:
            return usual
    raise ValueError(f"no field is named, and there are {_named(found)}")


def _unknown(message: Any, path: str) -> str:
    found = list(numeric_fields(message))
    return f"no number {path!r}; allowed: {_named(found)}{did_you_mean(path, found)}"


def _named(found: list[str]) -> str:
    more = len(found) - MAX_NAMED
    return ", ".join(found[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "") or "none"


#: Readings of one quantity that are taken, at most: each is 16 bytes, and is held.
MAX_READINGS = 20_000_000


@dataclass
class _Readings:
    """Readings of one quantity as they come."""

    bag: Path
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
        try:
            self.values.append(number_at(message, self.source.field))
            if len(self.values) > MAX_READINGS:
                raise ValueError(
                    f"more than {MAX_READINGS} readings; allowed: as many, so cut it with: "
                    "ros2 bag convert"
                )
        except ValueError as error:
            where = f"{self.source.quantity}: {self.source.topic} [{message.__msgtype__}]"
            raise BagError(f"{self.bag}: {where}: {error}") from None

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
    """Signals by quantity, the stamp (ns) that their times count from, and what was found."""
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
        by_topic.setdefault(found.topic, []).append(_Readings(bag, found))
    try:
        for reader in readers(bag):
            wanted = [c for c in reader.connections if c.topic in by_topic]
            for connection, log_time, data in reader.messages(wanted) if wanted else ():
                message = types.deserialize_cdr(data, connection.msgtype)
                for readings in by_topic[connection.topic]:
                    readings.take(message, log_time)
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    return _signals(bag, [one for found in by_topic.values() for one in found])


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
    """Type by name of the topics of a bag that have messages."""
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


# The cam angle of an encoder: its whole turns counted, and turning forwards.

#: An angle within one turn may exceed it by so much of it: rounding.
WITHIN = 1.0 + 1e-6


def forward_turns(angle: Signal, where: str) -> tuple[Signal, list[str]]:
    """The angle with all its turns, rising; and what was done, a sentence each."""
    notes = []
    value = angle.value
    inside = bool(np.ptp(value) <= TURN * WITHIN and np.abs(np.diff(value)).max() > 0.5 * TURN)
    if inside:
        steps = np.abs(np.remainder(np.diff(value) + 0.5 * TURN, TURN) - 0.5 * TURN)
        if np.median(steps) > 0.4 * TURN:
            raise BagError(
                f"{where}: the angle steps by {np.degrees(np.median(steps)):.0f}° from reading to "
                "reading; allowed: less than half a turn, else its turns cannot be counted, so "
                "record more readings"
            )
        value = np.unwrap(value)
        notes.append("The angle is given within one turn: its turns were counted.")
        if len(angle.gaps()):
            notes.append("Whole turns within a gap of the angle are not known.")
    if value[-1] < value[0]:
        value = -value
        notes.append("The angle falls: it was turned over, so the cam turns the other way.")
    turned = value[-1] - value[0]
    if turned < 0.5 * float(np.abs(np.diff(value)).sum()) or turned <= 0.0:
        raise BagError(
            f"{where}: the angle goes from {np.degrees(value[0]):.6g}° to "
            f"{np.degrees(value[-1]):.6g}° and not one way; allowed: a cam that turns"
        )
    return replace(angle, value=value), notes

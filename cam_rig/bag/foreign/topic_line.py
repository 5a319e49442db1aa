"""The line of --topics: which field of which topic is the cam angle, lift, force or level."""

from __future__ import annotations

import re
from dataclasses import dataclass

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.schema.quantity import UNITS
from cam_rig.units import TURN

#: The quantities, each with its units and their factors to SI; the first is the default. An angle
#: may be in counts too, "turn/1024"; an r.m.s. sound pressure in Pa is taken as a level.
QUANTITIES: dict[str, dict[str, float]] = {
    "angle": UNITS["angle"],
    "lift": {**UNITS["length"], "um": 1e-6},
    "force": {**UNITS["force"], "kN": 1e3},
    "level": {**UNITS["level"], "Pa": 1.0},
}
#: A unit of an angle: counts per turn.
COUNTS = re.compile(r"turn/([1-9]\d{0,8})")
#: An item: quantity, sign, topic and field, unit, clock.
ITEM = re.compile(
    r"(?P<quantity>\w+)=(?P<sign>-?)(?P<topic>/[\w/]+)(?:\.(?P<field>[\w.\[\]/-]+))?"
    r"(?::(?P<unit>[^@\s]+))?(?P<time>@bag)?"
)
EXAMPLE = "angle=/encoder.position[0]:deg lift=/lvdt.data:mm"


@dataclass(frozen=True)
class MappedField:
    """The field of a topic in which a quantity is read.

    ``field``: dotted names, empty for the only number of the message. ``unit``: one of
    `QUANTITIES`, or counts per turn. ``sign``: -1 for a sensor that counts the other way.
    ``bag_time``: the time is that of the bag, not of the message's header.
    """

    quantity: str
    topic: str
    field: str = ""
    unit: str = ""
    sign: float = 1.0
    bag_time: bool = False

    @property
    def source(self) -> str:
        """Topic and field as text."""
        return f"{self.topic}.{self.field}".rstrip(".")

    @property
    def factor(self) -> float:
        """Factor from the numbers of the message to SI."""
        if counts := COUNTS.fullmatch(self.unit):
            return self.sign * TURN / int(counts[1])
        return self.sign * QUANTITIES[self.quantity][self.unit]


def parse_topics(line: str) -> dict[str, MappedField]:
    """Return the fields of a line of ``quantity=topic.field:unit``, by quantity."""
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

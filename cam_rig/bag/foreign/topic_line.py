"""Parser of the option --topics: the topic fields of angle, lift, force and level."""

from __future__ import annotations

import re
from dataclasses import dataclass

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.schema.quantity import UNITS
from cam_rig.units import TURN

#: Accepted units of each quantity, with their factors to SI. The first unit is the default. An
#: angle may also be in counts (turn/1024). An r.m.s. sound pressure in Pa is converted to a level.
QUANTITIES: dict[str, dict[str, float]] = {
    "angle": UNITS["angle"],
    "lift": {**UNITS["length"], "um": 1e-6},
    "force": {**UNITS["force"], "kN": 1e3},
    "level": {**UNITS["level"], "Pa": 1.0},
}
#: Pattern of the unit of an angle in counts per turn.
COUNTS = re.compile(r"turn/([1-9]\d{0,8})")
#: Pattern of one item of the option --topics: quantity, sign, topic and field, unit, clock.
ITEM = re.compile(
    r"(?P<quantity>\w+)=(?P<sign>-?)(?P<topic>/[\w/]+)(?:\.(?P<field>[\w.\[\]/-]+))?"
    r"(?::(?P<unit>[^@\s]+))?(?P<time>@bag)?"
)
#: Example of the option --topics, for error messages.
EXAMPLE = "angle=/encoder.position[0]:deg lift=/lvdt.data:mm"


@dataclass(frozen=True)
class MappedField:
    """Field of a topic from which a quantity is read.

    `field` contains dotted names. It is empty for the only number of the message. `unit` is a key
    of `QUANTITIES`, or counts per turn. `sign` is -1 for a sensor with the opposite direction.
    `bag_time` is True if the time is the log time of the bag instead of the time in the message's
    header.
    """

    quantity: str
    topic: str
    field: str = ""
    unit: str = ""
    sign: float = 1.0
    bag_time: bool = False

    @property
    def source(self) -> str:
        """Topic and field of a quantity as text."""
        return f"{self.topic}.{self.field}".rstrip(".")

    @property
    def factor(self) -> float:
        """Factor from the values of a message field to SI, with the sign of the sensor."""
        if counts := COUNTS.fullmatch(self.unit):
            return self.sign * TURN / int(counts[1])
        return self.sign * QUANTITIES[self.quantity][self.unit]


def parse_topics(line: str) -> dict[str, MappedField]:
    """Parse the value of --topics, and return the field of each quantity.

    The items have the form ``quantity=topic.field:unit``. Raises ConfigError if the angle or all
    other quantities are missing, or if an item is invalid.
    """
    fields: dict[str, MappedField] = {}
    for item in line.split():
        mapped = _parse_item(item)
        if mapped.quantity in fields:
            raise ConfigError(f"--topics: {mapped.quantity} must occur once, got it twice")
        fields[mapped.quantity] = mapped
    if "angle" not in fields or len(fields) == 1:
        named = ", ".join(fields) or "nothing"
        raise ConfigError(
            "--topics must name the angle and at least one of "
            f"{', '.join(list(QUANTITIES)[1:])}, as in '{EXAMPLE}', got {named}"
        )
    return fields


def _parse_item(item: str) -> MappedField:
    match = ITEM.fullmatch(item)
    if match is None:
        raise ConfigError(
            f"--topics: an item must be QUANTITY=/TOPIC.FIELD:UNIT, as in '{EXAMPLE}', got {item!r}"
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

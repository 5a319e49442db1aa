"""What a design may ask for: quantities, where they are taken, and limits on them, as text.

``peak_acceleration<=start``, ``lift@90deg>=30mm``, ``residual_vibration@200-400rpm<=1um``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.units import RPM

# The quantities of a law that a design or a campaign may ask for.

Sense = Literal["<=", ">="]


@dataclass(frozen=True)
class DesignQuantity:
    """A quantity of a law.

    Parameters
    ----------
    title : in words
    unit : of tables and pictures
    units : unit of a request to SI
    where : what it is taken at: a speed or an angle, a range of them, an event's number, or nothing
    senses : the limits that can be kept; a goal minimises where ``<=`` is, else maximises
    goal : whether it may be one
    below : what a limit on it has to be less than, SI
    """

    title: str
    unit: str
    units: dict[str, float]
    where: Literal["", "rpm", "deg", "event"] = ""
    senses: tuple[Sense, ...] = ("<=",)
    goal: bool = True
    below: float = math.inf

    @property
    def shown(self) -> float:
        """One of ``unit`` in SI."""
        return self.units[self.unit]


def _per_rad(power: int) -> dict[str, float]:
    over = "/rad" if power == 1 else f"/rad^{power}"
    return {f"mm{over}": 1e-3, f"m{over}": 1.0, f"um{over}": 1e-6}


_LENGTH = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "µm": 1e-6, "cm": 1e-2}

_FORCE, SPEED_UNITS = {"N": 1.0, "kN": 1e3}, {"rpm": RPM, "rad/s": 1.0}

ANGLE_UNITS = {"deg": math.pi / 180.0, "rad": 1.0}

_TORQUE = {"N*m": 1.0, "Nm": 1.0, "N·m": 1.0, "mN*m": 1e-3}

_BOTH: tuple[Sense, ...] = ("<=", ">=")

QUANTITIES = {
    "jump_speed": DesignQuantity("jump speed from rest", "rpm", SPEED_UNITS, senses=(">=",)),
    "jump_speed_steady": DesignQuantity(
        "jump speed in steady state", "rpm", SPEED_UNITS, senses=(">=",)
    ),
    "jump_speed_rigid": DesignQuantity(
        "jump speed of one rigid mass", "rpm", SPEED_UNITS, senses=(">=",)
    ),
    "residual_vibration": DesignQuantity("residual vibration of one event", "um", _LENGTH, "rpm"),
    "peak_velocity": DesignQuantity("peak |s′|", "mm/rad", _per_rad(1)),
    "peak_acceleration": DesignQuantity("peak |s″|", "mm/rad^2", _per_rad(2)),
    "peak_jerk": DesignQuantity("peak |s‴|", "mm/rad^3", _per_rad(3)),
    "rms_acceleration": DesignQuantity("r.m.s. of s″", "mm/rad^2", _per_rad(2)),
    "peak_contact_force_rigid": DesignQuantity(
        "peak contact force of one rigid mass", "N", _FORCE, "rpm"
    ),
    "least_contact_force_rigid": DesignQuantity(
        "least contact force of one rigid mass", "N", _FORCE, "rpm", (">=",)
    ),
    "shaft_torque": DesignQuantity("peak |shaft torque|", "N*m", _TORQUE, "rpm"),
    "sound_level_rigid": DesignQuantity("sound level of one rigid mass", "dB", {"dB": 1.0}, "rpm"),
    "sound_level_with_jumps": DesignQuantity(
        "sound level with landings, mean power over speeds", "dB", {"dB": 1.0}, "rpm"
    ),
    "pressure_angle": DesignQuantity("pressure angle", "deg", ANGLE_UNITS, below=0.5 * math.pi),
    "radius_of_curvature": DesignQuantity(
        "least radius of curvature", "mm", _LENGTH, senses=(">=",)
    ),
    "event_angle": DesignQuantity(
        "span of event", "deg", ANGLE_UNITS, "event", _BOTH, goal=False, below=2.0 * math.pi
    ),
    "lift": DesignQuantity("lift", "mm", _LENGTH, "deg", _BOTH, goal=False),
    "velocity": DesignQuantity("s′", "mm/rad", _per_rad(1), "deg", _BOTH, goal=False),
    "acceleration": DesignQuantity("s″", "mm/rad^2", _per_rad(2), "deg", _BOTH, goal=False),
}

#: Quantities of either sign, or zero.
SIGNED = (
    "lift",
    "velocity",
    "acceleration",
    "least_contact_force",
    "least_contact_force_rigid",
    "sound_level",
    "sound_level_rigid",
    "sound_level_with_jumps",
    "lift_offs",
)

#: What `velocity`, ... are the derivatives of.
ORDERS = {"lift": 0, "velocity": 1, "acceleration": 2}

#: The limit that a quantity's own value of the start law sets.
START = "start"

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"

_TERM = re.compile(
    rf"(?P<name>\w+)\s*(?:@\s*(?P<low>{_NUMBER})(?:\s*-\s*(?P<high>{_NUMBER}))?\s*(?P<unit>\w+)?)?"
)

_LIMIT = re.compile(r"(?P<term>[^<>=]+?)\s*(?P<sense><=|>=|≤|≥)\s*(?P<value>.+)")

_VALUE = re.compile(rf"(?P<number>{_NUMBER})\s*(?P<unit>\S+)?")


@dataclass(frozen=True)
class Term:
    """A quantity and where it is taken: angles in rad or speeds in rad/s, low and high.

    Of an event low and high are its number, from 1.
    """

    name: str
    low: float = math.nan
    high: float = math.nan
    known: Mapping[str, DesignQuantity] = field(
        default_factory=lambda: QUANTITIES, repr=False, compare=False
    )

    @property
    def quantity(self) -> DesignQuantity:
        """What is known of it."""
        return self.known[self.name]

    @property
    def event(self) -> int:
        """The number of its event, from 1."""
        return int(self.low)

    @property
    def words(self) -> str:
        """As a table says it."""
        where = self.quantity.where
        if not where:
            return self.quantity.title
        if where == "event":
            return f"{self.quantity.title} {self.event}"
        factor = RPM if where == "rpm" else math.pi / 180.0
        low, high = (f"{value / factor:.6g}" for value in (self.low, self.high))
        at = low if low == high else f"{low} to {high}"
        return f"{self.quantity.title} at {at}{' rpm' if where == 'rpm' else '°'}"

    @property
    def key(self) -> str:
        """As it is asked for."""
        where = self.quantity.where
        if not where:
            return self.name
        if where == "event":
            return f"{self.name}@{self.event}"
        factor = RPM if where == "rpm" else math.pi / 180.0
        low, high = (f"{value / factor:.12g}" for value in (self.low, self.high))
        return f"{self.name}@{low}{'' if low == high else f'-{high}'}{where}"


@dataclass(frozen=True)
class Limit:
    """A limit on a quantity; ``value`` in SI, None is that of the start law."""

    term: Term
    sense: Sense
    value: float | None

    @property
    def words(self) -> str:
        """As a table says it."""
        return f"{self.term.words} {'≤' if self.sense == '<=' else '≥'} {self._value}"

    @property
    def _value(self) -> str:
        if self.value is None:
            return "the start's"
        return f"{self.value / self.term.quantity.shown:.4g} {self.term.quantity.unit}".rstrip()


def parse_term(text: str, known: Mapping[str, DesignQuantity] = QUANTITIES) -> Term:
    """A quantity among those known, such as ``residual_vibration@200-400rpm``.

    Examples
    --------
    >>> parse_term("residual_vibration@200-400rpm").words
    'residual vibration of one event at 200 to 400 rpm'
    """
    match = _TERM.fullmatch(text.strip())
    name = match["name"] if match else text.strip()
    if match is None or name not in known:
        raise ConfigError(
            f"{text.strip()!r} is not a quantity{did_you_mean(name, known)}; known: "
            f"{', '.join(known)}"
        )
    where, low = known[name].where, match["low"]
    if not where:
        if low is not None:
            raise ConfigError(f"{name}: is taken at {text.strip()!r}; allowed: {name} alone")
        return Term(name, known=known)
    if where == "event":
        return _of_event(name, text.strip(), match)
    example = f"{name}@{'200-400rpm' if where == 'rpm' else '90deg'}"
    if low is None:
        what = "a speed or a range of speeds" if where == "rpm" else "an angle or a range"
        raise ConfigError(f"{name}: is not said at what; needed: {what}, such as {example}")
    units = {"rpm": SPEED_UNITS, "deg": ANGLE_UNITS}[where]
    unit = match["unit"] or where
    if unit not in units:
        raise ConfigError(f"{text.strip()!r}: unit is {unit!r}; allowed: {', '.join(units)}")
    first = float(low) * units[unit]
    last = first if match["high"] is None else float(match["high"]) * units[unit]
    if not 0.0 <= first <= last or (where == "rpm" and first == 0.0):
        raise ConfigError(f"{text.strip()!r}: allowed: a rising range from above 0")
    if where == "deg" and last > 2.0 * math.pi * (1.0 + 1e-12):
        raise ConfigError(f"{text.strip()!r}: allowed: angles of one turn, 0 to 360deg")
    return Term(name, first, last, known)


def _of_event(name: str, text: str, match: re.Match[str]) -> Term:
    """A quantity of one event."""
    number = float(match["low"] or "nan")
    if match["high"] or match["unit"] or not (number >= 1.0 and number.is_integer()):
        raise ConfigError(f"{text!r}: allowed: the number of one event, such as {name}@1")
    return Term(name, number, number)


def parse_limit(text: str, known: Mapping[str, DesignQuantity] = QUANTITIES) -> Limit:
    """A limit, such as ``peak_acceleration<=start`` or ``lift@90deg>=30mm``.

    Examples
    --------
    >>> parse_limit("lift@90deg>=30mm").words
    'lift at 90° ≥ 30 mm'
    """
    match = _LIMIT.fullmatch(text.strip())
    if match is None:
        raise ConfigError(
            f"limit {text!r}: allowed: quantity<=value or quantity>=value, such as "
            "peak_acceleration<=start"
        )
    term = parse_term(match["term"], known)
    sense: Sense = "<=" if match["sense"] in ("<=", "≤") else ">="
    quantity = term.quantity
    if sense not in quantity.senses:
        raise ConfigError(
            f"limit {text!r}: allowed: {term.name}{quantity.senses[0]}value; the other side is "
            "not convex, so no bound could be given"
        )
    if match["value"].strip() == START:
        return Limit(term, sense, None)
    value = _VALUE.fullmatch(match["value"].strip())
    unit = (value["unit"] or "") if value else ""
    if value is None or unit not in quantity.units:
        raise ConfigError(
            f"limit {text!r}: value is {match['value'].strip()!r}; allowed: a number with one of "
            f"{', '.join(quantity.units)}, or start"
        )
    found = float(value["number"]) * quantity.units[unit]
    if term.name not in SIGNED and not 0.0 < found < quantity.below:
        most = (
            "" if math.isinf(quantity.below) else f" and below {quantity.below / quantity.shown:g}"
        )
        raise ConfigError(f"limit {text!r}: allowed: a value above 0{most}")
    return Limit(term, sense, found)


def parse_goal(text: str) -> Term:
    """A goal: a quantity that may be one."""
    term = parse_term(text)
    if not term.quantity.goal:
        goals = [name for name, quantity in QUANTITIES.items() if quantity.goal]
        raise ConfigError(f"{term.name} is a limit, not a goal; goals: {', '.join(goals)}")
    return term


def parse_second(text: str) -> Term:
    """The other quantity of a front: what may be a goal, or an event's span."""
    term = parse_term(text)
    return term if term.name == "event_angle" else parse_goal(text)


# Limits and goals as rows of a program: those that are linear, and mean squares.

PEAKS = {"peak_velocity": 1, "peak_acceleration": 2, "peak_jerk": 3}

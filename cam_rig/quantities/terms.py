"""Parser of texts that state a quantity, its speeds or angles, and a limit on it.

A quantity with its speed or angle is called a term. Examples are ``peak_acceleration<=start``,
``lift@90deg>=30mm`` and ``residual_vibration@200-400rpm<=1um``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.units import RPM

if TYPE_CHECKING:
    from cam_rig.quantities.values import Subject

#: Sense of a limit: upper limit ("<=") or lower limit (">=").
Sense = Literal["<=", ">="]
#: Units of a speed and their factors to rad/s.
SPEED_UNITS = {"rpm": RPM, "rad/s": 1.0}
#: Units of an angle and their factors to rad.
ANGLE_UNITS = {"deg": math.pi / 180.0, "rad": 1.0}
#: Text in place of the number of a limit: the limit is then the value of the law with which a
#: design starts.
START = "start"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"

_TERM = re.compile(
    rf"(?P<name>\w+)\s*(?:@\s*(?P<low>{_NUMBER})(?:\s*-\s*(?P<high>{_NUMBER}))?\s*(?P<unit>\w+)?)?"
)

_LIMIT = re.compile(r"(?P<term>[^<>=]+?)\s*(?P<sense><=|>=|≤|≥)\s*(?P<value>.+)")
_VALUE = re.compile(rf"(?P<number>{_NUMBER})\s*(?P<unit>\S+)?")
#: Translation of the characters of a unit for tables, such as m/s² for m/s^2.
_TYPESET = str.maketrans({"*": "·", "^": ""}) | str.maketrans("23", "²³")


def sign_of(sense: Sense) -> float:
    """Return 1 for an upper limit ("<=") and −1 for a lower limit (">=").

    Multiplied by this sign, a better value of the limited quantity is always the smaller number.
    """
    return 1.0 if sense == "<=" else -1.0


@dataclass(frozen=True, eq=False)
class LawQuantity:
    """Definition of a quantity of a law on a rig, such as the peak contact force.

    Parameters
    ----------
    name, title : str
        Key, and title for tables.
    unit : str
        Unit in tables, a key of ``units``.
    units : mapping of str to float
        Accepted units and their factors to SI (dB for a level).
    value : callable
        Function that returns the value (SI) for a subject (law and rig), a term and the sense of a
        limit. For a range of angles or speeds it is the value that decides if the limit is kept.
    where : {'', 'rpm', 'deg', 'event'}
        Domain in which it is evaluated: a speed, a cam angle, the number of an event (motion
        between two dwells), or none (empty).
    senses : tuple of Sense
        Limits that a design can keep.
    goal : bool
        True if a design can minimise it, or maximise it if ``<=`` is not among ``senses``.
    signed : bool
        True if limits may be zero or negative.
    below : float
        Upper bound of its limits (SI), not included.
    order : int
        Order of the derivative of s to which it belongs.
    campaign : bool
        True if a campaign can measure it.
    rigid : bool
        True for a jump speed of one rigid mass, which no resonance changes.
    of_run : bool
        True if it is measured in a run with the scene's follower model.
    ranges : bool
        True if a campaign can measure it over a range of speeds.
    """

    name: str
    title: str
    unit: str
    units: Mapping[str, float]
    value: Callable[[Subject, Term, Sense], float]
    where: Literal["", "rpm", "deg", "event"] = ""
    senses: tuple[Sense, ...] = ()
    goal: bool = True
    signed: bool = False
    below: float = math.inf
    order: int = 0
    campaign: bool = False
    rigid: bool = False
    of_run: bool = False
    ranges: bool = False

    @property
    def factor(self) -> float:
        """Factor from the display unit ``unit`` of the quantity to SI."""
        return self.units[self.unit]

    @property
    def typeset(self) -> str:
        """Display unit as tables print it, such as ° for deg and mm/rad² for mm/rad^2."""
        return {"deg": "°", "um": "µm"}.get(self.unit, self.unit.translate(_TYPESET))

    @property
    def si(self) -> str:
        """SI unit of the quantity, a key of ``units``."""
        return next(unit for unit, factor in self.units.items() if factor == 1.0)


@dataclass(frozen=True)
class Term:
    """Quantity with the domain in which it is evaluated, such as ``lift@90deg``.

    The domain is a cam angle, a speed, a range of either, the number of an event (motion between
    two dwells), or none. ``low`` and ``high`` are the ends of the range, angles in rad or speeds in
    rad/s. They are equal for a single angle or speed. Both are the number of an event, or 0 without
    a domain.
    """

    quantity: LawQuantity  #: definition of the quantity
    low: float = 0.0  #: lowest angle (rad) or speed (rad/s), or number of the event
    high: float = 0.0  #: highest angle (rad) or speed (rad/s), or number of the event

    @property
    def name(self) -> str:
        """Key of the quantity, without its domain."""
        return self.quantity.name

    @property
    def event(self) -> int:
        """Number of the event (motion between two dwells) in the turn, from 1."""
        return int(self.low)

    @property
    def words(self) -> str:
        """Title of the quantity with its domain for tables, such as "lift at 90°"."""
        title, where = self.quantity.title, self.quantity.where
        if where in ("", "event"):
            return f"{title} {self.event}" if where else title
        low, high = self._ends(".6g")
        domain = low if low == high else f"{low} to {high}"
        return f"{title} at {domain}{' rpm' if where == 'rpm' else '°'}"

    @property
    def key(self) -> str:
        """Quantity and domain as text that `parse_term` reads, such as ``lift@90deg``."""
        where = self.quantity.where
        if where in ("", "event"):
            return f"{self.name}@{self.event}" if where else self.name
        low, high = self._ends(".12g")
        return f"{self.name}@{low}{'' if low == high else f'-{high}'}{where}"

    def _ends(self, style: str) -> tuple[str, str]:
        factor = (SPEED_UNITS | ANGLE_UNITS)[self.quantity.where]
        return f"{self.low / factor:{style}}", f"{self.high / factor:{style}}"


@dataclass(frozen=True)
class Limit:
    """Upper or lower limit on a quantity.

    A limit without a value is the value of the law with which a design starts.
    """

    term: Term  #: quantity and its domain
    sense: Sense  #: upper ("<=") or lower (">=") limit
    value: float | None  #: limit in SI, or None for the value of the start law

    @property
    def words(self) -> str:
        """Limit as text for tables, such as "lift at 90° ≥ 30 mm"."""
        quantity, value = self.term.quantity, "the start's"
        if self.value is not None:
            value = f"{self.value / quantity.factor:.4g} {quantity.unit}".rstrip()
        return f"{self.term.words} {'≤' if self.sense == '<=' else '≥'} {value}"


def parse_term(text: str, allowed: Mapping[str, LawQuantity]) -> Term:
    """Parse a quantity with its domain, such as ``residual_vibration@200-400rpm``.

    Parameters
    ----------
    text : str
        Text of the quantity and its domain.
    allowed : mapping of str to LawQuantity
        Allowed quantities by name.

    Raises
    ------
    ConfigError
        If the quantity is not allowed, or its domain is missing or invalid.
    """
    match, text = _TERM.fullmatch(text.strip()), text.strip()
    name = match["name"] if match else text
    if match is None or name not in allowed:
        raise ConfigError(
            f"{text!r} is not a quantity{did_you_mean(name, allowed)}; "
            f"allowed: {', '.join(allowed)}"
        )
    quantity, low = allowed[name], match["low"]
    where = quantity.where
    if not where:
        if low is not None:
            raise ConfigError(f"{text!r}: {name} needs no speed or angle; allowed: {name} alone")
        return Term(quantity)
    if where == "event":
        number = float(low or "nan")
        if match["high"] or match["unit"] or not (number >= 1.0 and number.is_integer()):
            raise ConfigError(f"{text!r}: allowed: the number of one event, such as {name}@1")
        return Term(quantity, number, number)
    if low is None:
        needed = f"a speed or a range of speeds, such as {name}@200-400rpm"
        if where == "deg":
            needed = f"an angle or a range, such as {name}@90deg"
        raise ConfigError(f"{name}: has no speed or angle; needed: {needed}")
    units, unit = SPEED_UNITS if where == "rpm" else ANGLE_UNITS, match["unit"] or where
    if unit not in units:
        raise ConfigError(f"{text!r}: unit is {unit!r}; allowed: {', '.join(units)}")
    first = float(low) * units[unit]
    last = first if match["high"] is None else float(match["high"]) * units[unit]
    if not 0.0 <= first <= last or (where == "rpm" and first == 0.0):
        raise ConfigError(f"{text!r}: allowed: a rising range from above 0")
    if where == "deg" and last > 2.0 * math.pi * (1.0 + 1e-12):
        raise ConfigError(f"{text!r}: allowed: angles of one turn, 0 to 360deg")
    return Term(quantity, first, last)


def parse_limit(text: str, allowed: Mapping[str, LawQuantity]) -> Limit:
    """Parse a limit, such as ``peak_acceleration<=start`` or ``lift@90deg>=30mm``.

    Parameters
    ----------
    text : str
        Text of the limit.
    allowed : mapping of str to LawQuantity
        Allowed quantities by name.

    Raises
    ------
    ConfigError
        If the term, the sense, the value or its unit is not allowed.
    """
    match = _LIMIT.fullmatch(text.strip())
    if match is None:
        raise ConfigError(
            f"limit {text!r}: allowed: quantity<=value or quantity>=value, such as "
            "peak_acceleration<=start"
        )
    term = parse_term(match["term"], allowed)
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
    si_value = float(value["number"]) * quantity.units[unit]
    if not (quantity.signed or 0.0 < si_value < quantity.below):
        below = quantity.below / quantity.factor
        bound = "" if math.isinf(below) else f" and below {below:g}"
        raise ConfigError(f"limit {text!r}: allowed: a value above 0{bound}")
    return Limit(term, sense, si_value)

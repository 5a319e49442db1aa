"""A quantity of a law on a rig, where it is taken, and limits on it, as people write them.

``peak_acceleration<=start``, ``lift@90deg>=30mm``, ``residual_vibration@200-400rpm<=1um``.
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

Sense = Literal["<=", ">="]
SPEED_UNITS = {"rpm": RPM, "rad/s": 1.0}
ANGLE_UNITS = {"deg": math.pi / 180.0, "rad": 1.0}
#: The limit that a quantity's own value of the start law sets.
START = "start"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"

_TERM = re.compile(
    rf"(?P<name>\w+)\s*(?:@\s*(?P<low>{_NUMBER})(?:\s*-\s*(?P<high>{_NUMBER}))?\s*(?P<unit>\w+)?)?"
)

_LIMIT = re.compile(r"(?P<term>[^<>=]+?)\s*(?P<sense><=|>=|≤|≥)\s*(?P<value>.+)")
_VALUE = re.compile(rf"(?P<number>{_NUMBER})\s*(?P<unit>\S+)?")
#: Units as they are typeset.
_TYPESET = str.maketrans({"*": "·", "^": ""}) | str.maketrans("23", "²³")


def sign_of(sense: Sense) -> float:
    """1 where less keeps a limit, or is better; −1 where more is."""
    return 1.0 if sense == "<=" else -1.0


@dataclass(frozen=True, eq=False)
class LawQuantity:
    """A quantity of a law on a rig.

    ``title`` has the model that it is of; ``unit`` is that of tables, each of ``units`` goes to SI
    (dB of a level). ``value`` is of a subject, SI: over a range of angles or speeds the one that a
    limit of that sense is about. ``where`` it is taken: a speed or an angle, a range of them, an
    event's number, or nothing. A design can keep limits of ``senses``, and minimises a ``goal``
    where ``<=`` is among them, else maximises. ``signed`` ones may be below zero, or zero; a limit
    is less than ``below`` (SI); ``order`` is of the derivative of s that it is of. A ``campaign``
    may measure it, over ``ranges`` of speeds too; ``rigid`` is a jump speed of one rigid mass,
    which no resonance changes; ``of_run`` of a run of the scene's model, which its title names.
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
        """One of ``unit`` in SI."""
        return self.units[self.unit]

    @property
    def typeset(self) -> str:
        """``unit`` as a table shows it."""
        return {"deg": "°", "um": "µm"}.get(self.unit, self.unit.translate(_TYPESET))

    @property
    def si(self) -> str:
        """The unit of its numbers."""
        return next(unit for unit, factor in self.units.items() if factor == 1.0)


@dataclass(frozen=True)
class Term:
    """A quantity and where it is taken: angles (rad), speeds (rad/s), or an event's number."""

    quantity: LawQuantity
    low: float = math.nan
    high: float = math.nan

    @property
    def name(self) -> str:
        """The quantity's."""
        return self.quantity.name

    @property
    def event(self) -> int:
        """The number of its event, from 1."""
        return int(self.low)

    @property
    def words(self) -> str:
        """As a table says it."""
        title, where = self.quantity.title, self.quantity.where
        if where in ("", "event"):
            return f"{title} {self.event}" if where else title
        low, high = self._ends(".6g")
        at = low if low == high else f"{low} to {high}"
        return f"{title} at {at}{' rpm' if where == 'rpm' else '°'}"

    @property
    def key(self) -> str:
        """As it is asked for."""
        where = self.quantity.where
        if where in ("", "event"):
            return f"{self.name}@{self.event}" if where else self.name
        low, high = self._ends(".12g")
        return f"{self.name}@{low}{'' if low == high else f'-{high}'}{where}"

    def _ends(self, shown: str) -> tuple[str, str]:
        factor = (SPEED_UNITS | ANGLE_UNITS)[self.quantity.where]
        return f"{self.low / factor:{shown}}", f"{self.high / factor:{shown}}"


@dataclass(frozen=True)
class Limit:
    """A limit on a quantity; ``value`` in SI, None is that of the start law."""

    term: Term
    sense: Sense
    value: float | None

    @property
    def words(self) -> str:
        """As a table says it."""
        quantity, value = self.term.quantity, "the start's"
        if self.value is not None:
            value = f"{self.value / quantity.factor:.4g} {quantity.unit}".rstrip()
        return f"{self.term.words} {'≤' if self.sense == '<=' else '≥'} {value}"


def parse_term(text: str, known: Mapping[str, LawQuantity]) -> Term:
    """A quantity among those known, such as ``residual_vibration@200-400rpm``."""
    match, text = _TERM.fullmatch(text.strip()), text.strip()
    name = match["name"] if match else text
    if match is None or name not in known:
        raise ConfigError(
            f"{text!r} is not a quantity{did_you_mean(name, known)}; known: {', '.join(known)}"
        )
    quantity, low = known[name], match["low"]
    where = quantity.where
    if not where:
        if low is not None:
            raise ConfigError(f"{name}: is taken at {text!r}; allowed: {name} alone")
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
        raise ConfigError(f"{name}: is not said at what; needed: {needed}")
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


def parse_limit(text: str, known: Mapping[str, LawQuantity]) -> Limit:
    """A limit, such as ``peak_acceleration<=start`` or ``lift@90deg>=30mm``."""
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
    if not (quantity.signed or 0.0 < found < quantity.below):
        below = quantity.below / quantity.factor
        most = "" if math.isinf(below) else f" and below {below:g}"
        raise ConfigError(f"limit {text!r}: allowed: a value above 0{most}")
    return Limit(term, sense, found)

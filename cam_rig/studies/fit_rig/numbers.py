"""The numbers of a follower that a fit looks for, and what is shown of those that it found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.show.result import Column, Records, Result
from cam_rig.units import FloatArray, rounded_to_error

Follower = FollowerParameters | TwoMassParameters


@dataclass(frozen=True)
class Number:
    """A number of a rig file: its unit, its limits, and whether it is sought by its logarithm."""

    unit: str
    low: float
    high: float
    logarithm: bool = False


#: By their keys in a rig file.
NUMBERS = {
    "mass": Number("kg", 1e-6, 1e6, logarithm=True),
    "spring_stiffness": Number("N/m", 1e-6, 1e12, logarithm=True),
    "preload": Number("N", 0.0, 1e9),
    "damping": Number("N*s/m", 0.0, 1e9),
    "restitution": Number("1", 0.0, 0.95),
    "stem_stiffness": Number("N/m", 1.0, 1e15, logarithm=True),
    "roller_share": Number("1", 0.01, 0.99),
    "stem_damping": Number("N*s/m", 0.0, 1e9),
}
ONE_MASS = ("mass", "spring_stiffness", "preload", "damping", "restitution")
TWO_MASSES = (*ONE_MASS, "stem_stiffness", "roller_share", "stem_damping")
#: Those that one rigid mass has not.
OF_TWO = ("roller_share", "stem_damping")


def require_in_model(given: Mapping[str, float], model: str | None) -> None:
    """Refuse numbers that no follower has, or not one of the model that is asked for."""
    for name, value in given.items():
        limits = NUMBERS[name]
        if not limits.low <= value <= limits.high:
            raise ConfigError(
                f"{name}: {value:g} {limits.unit} is given; allowed: from {limits.low:g} to "
                f"{limits.high:g} {limits.unit}"
            )
    if model != "two_mass" and (odd := [name for name in given if name in OF_TWO]):
        raise ConfigError(
            f"{odd[0]}: is given, a number of two masses and a stem; allowed with --model two_mass"
        )


def follower_of(values: dict[str, float], stem_stiffness: float | None) -> Follower:
    """The follower of some numbers: two masses where they say how the mass splits.

    ``stem_stiffness`` (N/m) is that of one mass, which only a landing's pulse feels.
    """
    v = values
    if "roller_share" not in v:
        spring = v["spring_stiffness"], v["damping"], v["preload"]
        return FollowerParameters(v["mass"], *spring, stem_stiffness, v["restitution"])
    roller = v["roller_share"] * v["mass"]
    names = ("stem_stiffness", "spring_stiffness", "stem_damping", "damping", "preload")
    others = (v[name] for name in (*names, "restitution"))
    return TwoMassParameters(roller, v["mass"] - roller, *others)


def to_search(name: str, value: float) -> float:
    """The number as it is sought."""
    return float(np.log(value)) if NUMBERS[name].logarithm else value


def from_search(names: Iterable[str], x: FloatArray) -> dict[str, float]:
    """What is sought, ``(n,)``, and perhaps more behind it, as numbers of the rig."""
    found = zip(names, x.tolist(), strict=False)
    return {n: float(np.exp(v)) if NUMBERS[n].logarithm else v for n, v in found}


def slope(name: str, value: float) -> float:
    """The number's change with what is sought."""
    return value if NUMBERS[name].logarithm else 1.0


def search_limits(names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest of what is sought, ``(n,)`` each."""
    low = [to_search(name, NUMBERS[name].low) for name in names]
    return np.array(low), np.array([to_search(name, NUMBERS[name].high) for name in names])


# A number that a fit found, or why it has none: as tables, sentences and rig files have it.

#: 95 % of a normal distribution lie within so many standard deviations.
WITHIN_95 = 1.96
#: An error of more than this part of a value is warned of; below this a number is identified.
CAUTION, TOLD = 1.0 / 3.0, 0.5


@dataclass(frozen=True)
class FoundNumber:
    """One number, SI: given; identified, with its standard error; or not identified, and why.

    ``within`` is how many standard errors its interval of 95 % reaches to either side.
    """

    name: str
    value: float | None
    error: float | None
    origin: str
    reason: str = ""
    within: float = WITHIN_95

    @classmethod
    def unidentified(cls, name: str, reason: str, error: float | None = None) -> FoundNumber:
        """One without a value; ``error`` is what a search would have stated."""
        return cls(name, None, error, "not identified", reason)

    @property
    def unit(self) -> str:
        """Of both."""
        return NUMBERS[self.name].unit

    @property
    def shown(self) -> str:
        """The value, to two digits of its standard error where it has one; empty without one."""
        return "" if self.value is None else rounded_to_error(self.value, self.error or 0.0)

    @property
    def shown_error(self) -> str:
        """The standard error, to two digits; empty without a value."""
        if self.value is None or self.error is None:
            return ""
        return rounded_to_error(self.error, self.error)

    @property
    def caution(self) -> str:
        """What stands beside a value whose error is a third of it or more, or larger than it."""
        if self.value is None or self.error is None or self.error < CAUTION * self.value:
            return ""
        half = self.within * self.error
        words = interval_words(self.value, half, self.unit)
        return f"{'may be 0' if self.value < half else 'uncertain'}: {words}"

    @property
    def gist(self) -> str:
        """In words: 1.2995 ± 0.0008 kg."""
        return self._with_caution(f"{self.shown} ± {self.shown_error} {self.unit}")

    def in_a_sentence(self) -> str:
        """The number by its name, or that it is not identified, and why."""
        if self.value is not None:
            return self._with_caution(f"{self.name} {self.shown} {self.unit}")
        end = "" if self.reason.endswith("?") else "."
        return f"{self.name}: not identified, {self.reason}{end}"

    def _with_caution(self, words: str) -> str:
        return words.removesuffix(" 1") + (f" ({self.caution})" if self.caution else "")


def interval_words(value: float, half: float, unit: str) -> str:
    """An interval of 95 % of a number that is not below zero, in words."""
    low, end = value - half, f"{value + half:.3g} {unit}".removesuffix(" 1")
    return f"with 95 % it is below {end}" if low <= 0.0 else f"with 95 % it is {low:.3g} to {end}"


@dataclass(frozen=True, eq=False, repr=False)
class FoundNumbers(Result):
    """What readings say of a follower, and a ``model``, one_mass or two_mass.

    ``correlation`` ``(n, n)`` is of the numbers that were sought and found, in their order.
    """

    columns: ClassVar = {
        "numbers": (
            Column("number", of="name"),
            Column("value", "", ".6g", cell=lambda number: number.shown, doc="SI, see unit"),
            Column(
                *("standard_error", "", ".2g"),
                of=lambda number: None if number.value is None else number.error,
                cell=lambda number: number.shown_error,
            ),
            Column("unit"),
            Column("origin", cell=lambda n: "; ".join(filter(None, (n.origin, n.caution)))),
            Column("caution", hidden=True),
            Column("reason", hidden=True, doc="why it has no value"),
        ),
        "correlation": (
            Column("number", of="0"),
            Column("other", of="1", cell=lambda pair: pair[1].replace("_", " ")),
            Column("correlation", "", ".2f", of="2"),
        ),
    }

    law: Law
    model: str
    numbers: tuple[FoundNumber, ...]
    correlation: FloatArray

    @property
    def identified(self) -> tuple[FoundNumber, ...]:
        """The numbers that the readings tell."""
        return tuple(n for n in self.numbers if n.origin == "identified")

    def number_tables(self, caption: str, names: tuple[str, ...]) -> list[Records]:
        """A row a number; the correlation of the errors of those of ``names``, if several."""
        pairs = [
            (names[i], names[k], float(self.correlation[i, k]))
            for i, k in product(range(len(names)), repeat=2)
            if len(names) > 1
        ]
        title = "Correlation of their errors"
        return [
            self.table("numbers", caption, self.numbers),
            self.table("correlation", title, pairs, pivot="other"),
        ]


def correlation_of(covariance: FloatArray) -> FloatArray:
    """``(n, n)``; of a number without an error 0, of any other with itself exactly 1."""
    square = np.diag(covariance)
    deviation = np.maximum(np.sqrt(square), 1e-300)
    found = covariance / np.outer(deviation, deviation)
    np.fill_diagonal(found, np.where(square > 0.0, 1.0, 0.0))
    return np.asarray(found)

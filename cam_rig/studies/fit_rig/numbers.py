"""Parameters of a follower in a fit, and the display of their estimates."""

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
from cam_rig.units import FloatArray, round_to_error

Follower = FollowerParameters | TwoMassParameters


@dataclass(frozen=True)
class Number:
    """Parameter of a rig file: unit and limits.

    ``logarithm`` is True if a search uses its logarithm.
    """

    unit: str
    low: float
    high: float
    logarithm: bool = False


#: Parameters by their keys in a rig file.
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
#: Parameters that one rigid mass does not have.
TWO_MASS_ONLY = ("roller_share", "stem_damping")


def check_fixed(fixed: Mapping[str, float], model: str | None) -> None:
    """Raise an error if a fixed value is outside its limits or not in the model."""
    for name, value in fixed.items():
        limits = NUMBERS[name]
        if not limits.low <= value <= limits.high:
            raise ConfigError(
                f"{name}: {value:g} {limits.unit} is given; allowed: from {limits.low:g} to "
                f"{limits.high:g} {limits.unit}"
            )
    if model != "two_mass" and (odd := [name for name in fixed if name in TWO_MASS_ONLY]):
        raise ConfigError(
            f"{odd[0]}: is given, a number of two masses and a stem; allowed with --model two_mass"
        )


def build_follower(values: dict[str, float], stem_stiffness: float | None) -> Follower:
    """Return the follower with these values.

    It has two masses if the values contain ``roller_share``. ``stem_stiffness`` (N/m) is that of
    one mass. It affects only the pulse of a landing.
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
    """Return a value in the form in which it is searched for."""
    return float(np.log(value)) if NUMBERS[name].logarithm else value


def from_search(names: Iterable[str], x: FloatArray) -> dict[str, float]:
    """Return search variables as values by name.

    ``x`` has the shape ``(n,)`` or is longer. The variables after the first n are ignored.
    """
    pairs = zip(names, x.tolist(), strict=False)
    return {n: float(np.exp(v)) if NUMBERS[n].logarithm else v for n, v in pairs}


def slope(name: str, value: float) -> float:
    """Return the derivative of a value with respect to its search variable."""
    return value if NUMBERS[name].logarithm else 1.0


def search_limits(names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper limits of the search variables, ``(n,)`` each."""
    low = [to_search(name, NUMBERS[name].low) for name in names]
    return np.array(low), np.array([to_search(name, NUMBERS[name].high) for name in names])


# Estimate of a parameter, for tables, sentences and rig files.

#: Half the width in standard deviations of the interval with 95 % of a normal distribution.
WITHIN_95 = 1.96
#: Relative standard error above which an identified value has a warning.
CAUTION_RELATIVE_ERROR = 1.0 / 3.0
#: Relative standard error below which a parameter is identified.
MAX_RELATIVE_ERROR = 0.5


@dataclass(frozen=True)
class ParameterEstimate:
    """Estimate of one parameter in SI: given, identified, or not identified.

    An identified parameter has a standard error. A parameter that is not identified has a reason.
    ``within`` is half the width of its interval of 95 % in standard errors.
    """

    name: str
    value: float | None
    error: float | None
    origin: str
    reason: str = ""
    within: float = WITHIN_95

    @classmethod
    def unidentified(cls, name: str, reason: str, error: float | None = None) -> ParameterEstimate:
        """Return an estimate without a value.

        ``error`` is the standard error that the search computed.
        """
        return cls(name, None, error, "not identified", reason)

    @property
    def unit(self) -> str:
        """Unit of value and error."""
        return NUMBERS[self.name].unit

    @property
    def shown(self) -> str:
        """Value as text, with two digits of its standard error.

        It is empty without a value.
        """
        return "" if self.value is None else round_to_error(self.value, self.error or 0.0)

    @property
    def shown_error(self) -> str:
        """Standard error as text with two digits, or empty without a value."""
        if self.value is None or self.error is None:
            return ""
        return round_to_error(self.error, self.error)

    @property
    def caution(self) -> str:
        """Warning for an error of a third of the value or more, or larger than the value.

        It is empty for a smaller error.
        """
        if (
            self.value is None
            or self.error is None
            or self.error < CAUTION_RELATIVE_ERROR * self.value
        ):
            return ""
        half = self.within * self.error
        text = interval_text(self.value, half, self.unit)
        return f"{'may be 0' if self.value < half else 'uncertain'}: {text}"

    @property
    def gist(self) -> str:
        """Value, error and unit as text, such as 1.2995 ± 0.0008 kg."""
        return self._with_caution(f"{self.shown} ± {self.shown_error} {self.unit}")

    def to_sentence(self) -> str:
        """Return the name and value, or the reason why the parameter is not identified."""
        if self.value is not None:
            return self._with_caution(f"{self.name} {self.shown} {self.unit}")
        end = "" if self.reason.endswith("?") else "."
        return f"{self.name}: not identified, {self.reason}{end}"

    def _with_caution(self, text: str) -> str:
        return text.removesuffix(" 1") + (f" ({self.caution})" if self.caution else "")


def interval_text(value: float, half: float, unit: str) -> str:
    """Return an interval of 95 % as text, for a parameter that is not negative."""
    low, end = value - half, f"{value + half:.3g} {unit}".removesuffix(" 1")
    return f"with 95 % it is below {end}" if low <= 0.0 else f"with 95 % it is {low:.3g} to {end}"


@dataclass(frozen=True, eq=False, repr=False)
class RigParameters(Result):
    """Estimates of a follower's parameters, and its model: one_mass or two_mass.

    ``correlation`` ``(n, n)`` is that of the identified free parameters, in their order.
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
            Column("reason", hidden=True, doc="reason for a missing value"),
        ),
        "correlation": (
            Column("number", of="0"),
            Column("other", of="1", cell=lambda pair: pair[1].replace("_", " ")),
            Column("correlation", "", ".2f", of="2"),
        ),
    }

    law: Law
    model: str
    numbers: tuple[ParameterEstimate, ...]
    correlation: FloatArray

    @property
    def identified(self) -> tuple[ParameterEstimate, ...]:
        """Identified parameters."""
        return tuple(n for n in self.numbers if n.origin == "identified")

    def number_tables(self, caption: str, names: tuple[str, ...]) -> list[Records]:
        """Return a table with one row per parameter, and a table of correlations.

        The correlations are those of ``names``. The table is empty for a single name.
        """
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


def correlation_matrix(covariance: FloatArray) -> FloatArray:
    """Return the correlation matrix ``(n, n)`` of a covariance.

    The diagonal is exactly 1, or 0 for a parameter without an error.
    """
    square = np.diag(covariance)
    deviation = np.maximum(np.sqrt(square), 1e-300)
    correlation = covariance / np.outer(deviation, deviation)
    np.fill_diagonal(correlation, np.where(square > 0.0, 1.0, 0.0))
    return np.asarray(correlation)

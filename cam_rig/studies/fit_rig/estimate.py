"""Estimates of a follower's parameters, and their form in tables, sentences and rig files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from cam_rig.laws import Law
from cam_rig.show.result import Column, Records, Result
from cam_rig.studies.fit_rig.parameters import PARAMETERS
from cam_rig.units import FloatArray, round_to_error

#: Half the width of the 95 % interval of a normal distribution, in standard deviations.
NORMAL_95 = 1.96
#: Relative standard error from which an identified value gets a warning: fewer than one digit of
#: the value is significant.
CAUTION_RELATIVE_ERROR = 1.0 / 3.0
#: Largest relative standard error at which a parameter counts as identified. Its 95 % interval then
#: excludes zero.
MAX_RELATIVE_ERROR = 0.5


@dataclass(frozen=True)
class ParameterEstimate:
    """Estimate of one parameter of the follower, in SI units.

    ``origin`` is "given", "identified" or "not identified". An identified parameter has a standard
    error ``error``. A parameter that is not identified has the value None and a ``reason``.
    ``coverage_factor`` is half the width of the 95 % interval in standard errors.
    """

    name: str
    value: float | None
    error: float | None
    origin: str
    reason: str = ""
    coverage_factor: float = NORMAL_95

    @classmethod
    def unidentified(cls, name: str, reason: str, error: float | None = None) -> ParameterEstimate:
        """Return the estimate of a parameter that is not identified.

        Its value is None. ``reason`` explains why. ``error`` is the standard error that the search
        computed, or None.
        """
        return cls(name, None, error, "not identified", reason)

    @property
    def unit(self) -> str:
        """Unit of the parameter's value and standard error."""
        return PARAMETERS[self.name].unit

    @property
    def value_text(self) -> str:
        """Value as text, rounded to the digits that its standard error supports.

        It is empty if the parameter has no value.
        """
        return "" if self.value is None else round_to_error(self.value, self.error or 0.0)

    @property
    def error_text(self) -> str:
        """Standard error as text with two digits, or empty if there is no value or error."""
        if self.value is None or self.error is None:
            return ""
        return round_to_error(self.error, self.error)

    @property
    def caution(self) -> str:
        """Warning if the standard error is a third of the value or more.

        It is empty for a smaller error, or without a value.
        """
        if (
            self.value is None
            or self.error is None
            or self.error < CAUTION_RELATIVE_ERROR * self.value
        ):
            return ""
        half = self.coverage_factor * self.error
        text = interval_text(self.value, half, self.unit)
        return f"{'may be 0' if self.value < half else 'uncertain'}: {text}"

    @property
    def text(self) -> str:
        """Value, standard error and unit as text, such as 1.2995 ± 0.0008 kg."""
        return self._with_caution(f"{self.value_text} ± {self.error_text} {self.unit}")

    def to_sentence(self) -> str:
        """Return name and value as text, or the reason why the parameter has no value."""
        if self.value is not None:
            return self._with_caution(f"{self.name} {self.value_text} {self.unit}")
        end = "" if self.reason.endswith("?") else "."
        return f"{self.name}: not identified, {self.reason}{end}"

    def _with_caution(self, text: str) -> str:
        return text.removesuffix(" 1") + (f" ({self.caution})" if self.caution else "")


#: Smallest and largest usual values of a follower on a test bench, in SI, by key of the rig file.
#: An identified value outside of them gets a warning and is not rejected.
USUAL_VALUES = {"mass": (0.005, 500.0), "spring_stiffness": (10.0, 1e8)}


def warn_of_unusual_values(numbers: Iterable[ParameterEstimate]) -> Iterator[str]:
    """Yield a warning for each identified parameter outside `USUAL_VALUES`."""
    for number in numbers:
        low, high = USUAL_VALUES.get(number.name, (0.0, math.inf))
        if number.value is not None and not low <= number.value <= high:
            yield (
                f"The {number.name.replace('_', ' ')} of {number.value:.3g} {number.unit} is "
                f"outside the usual size of a bench, {low:g} to {high:g} {number.unit}: check the "
                "units of force and lift."
            )


def interval_text(value: float, half: float, unit: str) -> str:
    """Return the 95 % interval of a parameter as text.

    ``value`` is its middle and ``half`` half its width, both in ``unit``. The parameter cannot be
    negative: if the interval contains 0, the text gives the upper limit only.
    """
    low, end = value - half, f"{value + half:.3g} {unit}".removesuffix(" 1")
    return f"with 95 % it is below {end}" if low <= 0.0 else f"with 95 % it is {low:.3g} to {end}"


@dataclass(frozen=True, eq=False, repr=False)
class RigParameters(Result):
    """Estimates of a follower's parameters, and the model that was fitted.

    ``law`` is that of the cam, ``model`` is one_mass or two_mass. ``correlation`` ``(n, n)``
    contains the correlations between the errors of the identified free parameters, in their order
    in ``numbers``.
    """

    columns: ClassVar = {
        "numbers": (
            Column("number", of="name"),
            Column("value", "", ".6g", cell=lambda number: number.value_text, doc="SI, see unit"),
            Column(
                *("standard_error", "", ".2g"),
                of=lambda number: None if number.value is None else number.error,
                cell=lambda number: number.error_text,
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
        """Estimates of those parameters that were identified, with value and error."""
        return tuple(n for n in self.numbers if n.origin == "identified")

    def number_tables(self, caption: str, names: tuple[str, ...]) -> list[Records]:
        """Return the table of parameters, and the correlations of their errors.

        ``caption`` is the caption of the first table, and ``names`` are the parameters of
        ``correlation``. The second table is empty if there is only one parameter.
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
    """Return the correlation matrix of a covariance matrix, both ``(n, n)``.

    The diagonal is exactly 1, or 0 for a parameter whose variance is 0.
    """
    square = np.diag(covariance)
    deviation = np.maximum(np.sqrt(square), 1e-300)
    correlation = covariance / np.outer(deviation, deviation)
    np.fill_diagonal(correlation, np.where(square > 0.0, 1.0, 0.0))
    return np.asarray(correlation)

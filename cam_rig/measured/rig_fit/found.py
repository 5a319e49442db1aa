"""A number that a fit found, or why it has none: as tables, sentences and rig files have it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product

from cam_rig.measured.rig_fit.numbers import NUMBERS
from cam_rig.measured.rig_fit.start import WITHIN_95
from cam_rig.show.result import Column, Records
from cam_rig.units import FloatArray, rounded_to_error

#: An error of more than this part of a value is warned of.
CAUTION = 1.0 / 3.0


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
        words = f"{self.shown} ± {self.shown_error} {self.unit}".removesuffix(" 1")
        return f"{words} ({self.caution})" if self.caution else words


def interval_words(value: float, half: float, unit: str) -> str:
    """An interval of 95 % of a number that is not below zero, in words."""
    low, end = value - half, f"{value + half:.3g} {unit}".removesuffix(" 1")
    return f"with 95 % it is below {end}" if low <= 0.0 else f"with 95 % it is {low:.3g} to {end}"


NUMBER_COLUMNS = (
    Column("number", of="name"),
    Column("value", "", ".6g", cell=lambda number: number.shown, about="SI, see unit"),
    Column(
        "standard_error",
        "",
        ".2g",
        of=lambda number: None if number.value is None else number.error,
        cell=lambda number: number.shown_error,
    ),
    Column("unit"),
    Column("origin", cell=lambda number: "; ".join(filter(None, (number.origin, number.caution)))),
    Column("caution", hidden=True),
    Column("reason", hidden=True, about="why it has no value"),
)

CORRELATION_COLUMNS = (
    Column("number"),
    Column("other", cell=lambda pair: pair.other.replace("_", " ")),
    Column("correlation", "", ".2f"),
)


@dataclass(frozen=True)
class ErrorCorrelation:
    """How the errors of two numbers go together, -1 to 1."""

    number: str
    other: str
    correlation: float


def number_tables(
    caption: str, numbers: Iterable[FoundNumber], names: tuple[str, ...], correlation: FloatArray
) -> list[Records]:
    """A row a number; the correlation of the errors of those of some names, if they are several."""
    pairs = [
        ErrorCorrelation(names[i], names[k], float(correlation[i, k]))
        for i, k in product(range(len(names)), repeat=2)
        if len(names) > 1
    ]
    title, columns = "Correlation of their errors", CORRELATION_COLUMNS
    return [
        Records("numbers", caption, NUMBER_COLUMNS, tuple(numbers)),
        Records("correlation", title, columns, pairs, across="other"),
    ]


def number_sentences(numbers: Iterable[FoundNumber]) -> Iterator[str]:
    """What has no number, and why."""
    for number in numbers:
        if number.value is None:
            end = "" if number.reason.endswith("?") else "."
            yield f"{number.name}: not identified, {number.reason}{end}"


def told(numbers: Iterable[FoundNumber]) -> str:
    """Identified numbers in words, each with its caution."""
    return ", ".join(
        f"{number.name} {number.shown} {number.unit}".removesuffix(" 1")
        + (f" ({number.caution})" if number.caution else "")
        for number in numbers
    )

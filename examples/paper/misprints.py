"""Misprints of the paper and of the works on which it is based."""

from __future__ import annotations

from typing import NamedTuple

from examples.paper.common import Table


class Misprint(NamedTuple):
    """Misprint: source, place, printed text and correct text."""

    source: str
    where: str
    printed: str
    correct: str


#: Sources of the misprints.
PAPER = "paper"
LAWS = "laws thesis"
PROFILE = "profile thesis"
EXAMPLE = "worked example"

MISPRINTS = (
    Misprint(PAPER, "eq. 2, two coefficients", "45045, 434434", "4504.5, 4344.34"),
    Misprint(PAPER, "eq. 20, constant", "2593808", "25.93808"),
    Misprint(PAPER, "ordinates of Bézier 15", "…1.5, 15, …", "…1.5, 1.5, …"),
    Misprint(PAPER, "Table 1, mass", "13 kg", "1.3 kg"),
    Misprint(
        LAWS, "eq. 3.6, ordinates", "0, 0, 0, 0, 0, 1/3, 2/3, 1", "0, 0, 0, 0, 0, 1/4, 1/2, 3/4, 1"
    ),
    Misprint(
        LAWS,
        "eq. 3.7, second and third derivative",
        "12u + 12u², 12 + 24u",
        "−12u + 12u², −12 + 24u",
    ),
    Misprint(
        PROFILE, "eq. 2.1, 2.10", "sum from i = 1; N⁰ closed at both ends", "from i = 0; half-open"
    ),
    Misprint(PROFILE, "eq. 2.13", "divides by uᵢ₊₁ − uᵢ", "by uᵢ₊ₙ − uᵢ"),
    Misprint(
        PROFILE,
        "eq. 2.17",
        "components in base 1, 2",
        "in the base turned by the face's inclination",
    ),
    Misprint(
        PROFILE,
        "eq. 2.33, second component",
        "−l₁ cos θ − l₃ cos(θ + d)(1 + d')",
        "−l₁ cos θ + l₃ cos(θ + d)(1 + d')",
    ),
    Misprint(
        PROFILE,
        "eq. 2.39, last component",
        "−(d + d'') cos β − ε sin β",
        "−((d + d'') cos β − ε sin β)",
    ),
    Misprint(EXAMPLE, "part a", "S(π/2) = (π/2)/(π/2) + b", "S(π/2) = a (π/2)/(π/2) + b"),
    Misprint(EXAMPLE, "part b", "½[1 − cos(πθ/β)], θ/β from 1 to 2", "½[1 + cos(πθ/β)]"),
)


def table() -> Table:
    """Return a table of all misprints, by source."""
    return Table("Misprints in the sources", "source | where | printed | correct", MISPRINTS)

"""A law's pieces with 50 digits, as power series of time: the law's doubles taken as exact."""

from __future__ import annotations

from dataclasses import dataclass

import mpmath as mp  # type: ignore[import-untyped]

from cam_rig.bench.cases.phase import Number, Vector
from cam_rig.laws import Law


@dataclass(frozen=True)
class ExactPiece:
    """One piece at one speed.

    Parameters
    ----------
    start, duration : s
    series : s, ṡ, s̈ and 1 as coefficients of the powers of the time since the start
    """

    start: Number
    duration: Number
    series: tuple[list[Number], ...]

    @property
    def degree(self) -> int:
        """Degree of the series."""
        return len(self.series[0]) - 1

    def motion(self, time: Number) -> list[Number]:
        """(s, ṡ, s̈, 1) at a time since the start."""
        return [polynomial(row, time) for row in self.series]

    def combined(self, weights: Vector) -> list[Number]:
        """Coefficients of a weighted sum of s, ṡ, s̈ and 1."""
        return [
            sum((w * a for w, a in zip(weights, column, strict=True)), mp.mpf(0))
            for column in zip(*self.series, strict=True)
        ]


def polynomial(coefficients: list[Number], x: Number) -> Number:
    """Value by Horner's rule."""
    total = mp.mpf(0)
    for a in reversed(coefficients):
        total = total * x + a
    return total


def powers(ordinates: list[float]) -> list[Number]:
    """Coefficients of the powers of u of a polynomial in Bernstein form."""
    degree = len(ordinates) - 1
    b = [mp.mpf(float(x)) for x in ordinates]
    return [
        mp.binomial(degree, j)
        * sum(((-1) ** (j - i) * mp.binomial(j, i) * b[i] for i in range(j + 1)), mp.mpf(0))
        for j in range(degree + 1)
    ]


def exact_pieces(law: Law, speed: float) -> list[ExactPiece]:
    """The pieces of one turn."""
    breaks = [mp.mpf(float(x)) for x in law.breaks]
    omega = mp.mpf(speed)
    pieces = []
    for i, ordinates in enumerate(law.ordinates.T.tolist()):
        span = breaks[i + 1] - breaks[i]
        lift = [a * (omega / span) ** j for j, a in enumerate(powers(ordinates))]
        rate, acceleration = derivative(lift), derivative(derivative(lift))
        one = [mp.mpf(j == 0) for j in range(len(lift))]
        pieces.append(ExactPiece(breaks[i] / omega, span / omega, (lift, rate, acceleration, one)))
    return pieces


def derivative(coefficients: list[Number]) -> list[Number]:
    """Coefficients of the derivative, padded to the same length."""
    return [*(j * a for j, a in enumerate(coefficients) if j), mp.mpf(0)]

"""Analytic curves turned into Bernstein pieces with derivatives as good as the values."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import LawError
from cam_rig.laws import bernstein
from cam_rig.laws.pieces import Pieces

#: Degree of the interpolant of the third derivative; the curve itself has three more.
THIRD_DEGREE = 22
#: Relative tail of the third derivative's Chebyshev series that is accepted ...
TAIL = 1e-13
#: ... or what the tail may add to the curve itself, relative: rounding of the formula.
ROUNDING = 1e-17
#: Pieces are not made shorter than this fraction of the curve.
SHORTEST = 1e-5

Curve = Callable[[FloatArray, int], FloatArray]
#: A curve on the stretch from its first to its second abscissa.
Section = tuple[float, float, Curve]


@lru_cache(maxsize=4)
def _nodes(degree: int) -> tuple[FloatArray, FloatArray]:
    """Chebyshev nodes on [0, 1] and the Bernstein collocation matrix there."""
    nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    return nodes, bernstein.basis(degree, nodes)


def fit(
    curve: Curve, start: float, stop: float, degree: int = THIRD_DEGREE, accepted_tail: float = TAIL
) -> Pieces:
    """Bernstein pieces of ``curve`` on [start, stop]: breakpoints and ordinate columns.

    ``curve(x, order)`` gives the values and the derivatives up to the third. The third
    derivative is interpolated and integrated three times from exact values at the piece's
    start, so s''' is as accurate as s (differencing an interpolant of s would lose six
    digits). A piece is halved until its Chebyshev tail is at rounding level.

    ``degree`` and ``accepted_tail`` are those of the third derivative: where pieces come out short
    against a period of the stem, a lower degree keeps the vibration's polynomial solution small.

    Raises
    ------
    LawError : the curve is not smooth at any width
    """
    breaks: list[float] = [start]
    pieces: list[FloatArray] = []
    todo = [(start, stop)]
    while todo:
        a, b = todo.pop()
        third = _third_derivative(curve, a, b, degree, accepted_tail)
        if third is None:
            if b - a < SHORTEST * (stop - start):
                raise LawError(
                    f"the curve turns too sharply at {a:.6g} to be followed; allowed: a third "
                    f"derivative that is smooth over {SHORTEST:g} of its span"
                )
            mid = 0.5 * (a + b)
            todo += [(mid, b), (a, mid)]
            continue
        pieces.append(_integrate(third, curve, a, b))
        breaks.append(b)
    return breaks, pieces


def fit_sections(sections: list[Section]) -> Pieces:
    """Bernstein pieces of curves that follow one another; raises as ``fit``."""
    breaks, pieces = [sections[0][0]], []
    for start, stop, curve in sections:
        steps, fitted = fit(curve, start, stop)
        breaks += steps[1:]
        pieces += fitted
    return breaks, pieces


def _third_derivative(
    curve: Curve, a: float, b: float, degree: int, accepted_tail: float
) -> FloatArray | None:
    """Ordinates of the third derivative on [a, b], or None when the degree does not do."""
    nodes, collocation = _nodes(degree)
    values = curve(a + (b - a) * nodes, 3)
    series = np.polynomial.chebyshev.chebfit(2.0 * nodes - 1.0, values, degree)
    tail = np.abs(series[-2:]).max()
    size = float(np.abs(curve(np.array([a, b]), 0)).max())
    accepted = max(accepted_tail * np.abs(series).max(), ROUNDING * size / (b - a) ** 3)
    if not tail <= accepted:
        return None
    return np.asarray(np.linalg.solve(collocation, values))


def _integrate(third: FloatArray, curve: Curve, a: float, b: float) -> FloatArray:
    at = np.array([a])
    ordinates = third
    for order in (2, 1, 0):
        ordinates = (b - a) * bernstein.antiderivative(ordinates) + curve(at, order)[0]
    return ordinates

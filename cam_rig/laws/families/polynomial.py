"""The polynomial through conditions on values and derivatives (eq. 2.1, worked example c)."""

from __future__ import annotations

from fractions import Fraction
from math import comb, perm

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import LawError


def polynomial_through(u: list[float], order: list[int], value: list[float]) -> FloatArray:
    """Bernstein ordinates on [0, 1] of the polynomial of lowest degree through the conditions.

    Parameters
    ----------
    u, order, value : (m,) each; the derivative of order r at u ∈ [0, 1] is to be the value

    The m conditions give degree m − 1. They are solved in exact fractions: the system is badly
    conditioned in any basis, and of at most 21 rows.

    Raises
    ------
    LawError : the conditions contradict each other or leave the polynomial open
    """
    at = [Fraction(x) for x in u]
    rows = [_row(len(at) - 1, x, r) for x, r in zip(at, order, strict=True)]
    for row, x in zip(rows, value, strict=True):
        row.append(Fraction(x))
    try:
        return np.array([float(x) for x in _solve(rows)])
    except ZeroDivisionError:
        shown = ", ".join(f"({x:g}, {r})" for x, r in zip(u, order, strict=True))
        raise LawError(
            f"no single polynomial of degree {len(at) - 1} meets the conditions (u, order) "
            f"{shown}; allowed: a set that fixes it, so give the lower orders where a higher one "
            "is given"
        ) from None


def _row(degree: int, u: Fraction, order: int) -> list[Fraction]:
    """Derivative of order r of each Bernstein polynomial at u, in fractions."""
    row = [Fraction(0)] * (degree + 1)
    lower = degree - order
    values = [comb(lower, i) * u**i * (1 - u) ** (lower - i) for i in range(lower + 1)]
    factor = perm(degree, order)
    for i, value in enumerate(values):
        for j in range(order + 1):
            row[i + j] += factor * value * comb(order, j) * (-1) ** (order - j)
    return row


def _solve(rows: list[list[Fraction]]) -> list[Fraction]:
    """Gauss-Jordan elimination; ZeroDivisionError when the system is singular."""
    n = len(rows)
    for i in range(n):
        pivot = next((k for k in range(i, n) if rows[k][i] != 0), i)
        rows[i], rows[pivot] = rows[pivot], rows[i]
        scale = 1 / rows[i][i]
        rows[i] = [x * scale for x in rows[i]]
        for k in range(n):
            if k != i and rows[k][i] != 0:
                factor = rows[k][i]
                rows[k] = [x - factor * y for x, y in zip(rows[k], rows[i], strict=True)]
    return [row[-1] for row in rows]

"""Products and compositions of polynomials in Bernstein form, by convex combinations.

They write a law as a polynomial of time where the cam speeds up or slows down: s(θ(t)) with a
quadratic θ(t).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws.bernstein import binomials


def product(one: FloatArray, other: FloatArray) -> FloatArray:
    """Ordinates of the product, ``(m + n + 1, k)`` from ``(m + 1,)`` and ``(n + 1, k)``."""
    low, high = one.size - 1, other.shape[0] - 1
    scaled = binomials(high)[:, None] * other
    out = np.zeros((low + high + 1, other.shape[1]))
    for i, weight in enumerate(binomials(low) * one):
        out[i : i + high + 1] += weight * scaled
    return np.asarray(out / binomials(low + high)[:, None])


def compose(outer: FloatArray, inner: FloatArray) -> FloatArray:
    """Ordinates of f(u(τ)), ``(2p + 1, k)`` from f ``(p + 1, k)`` and a quadratic u ``(3,)``.

    De Casteljau's scheme with u(τ) in place of a number. With the ordinates of u in [0, 1] every
    step is a convex combination, so nothing cancels.
    """
    rows = outer[:, None, :]
    near, far = binomials(2) * inner, binomials(2) * (1.0 - inner)
    for degree in range(0, 2 * outer.shape[0] - 2, 2):
        scaled = rows * binomials(degree)[:, None]
        grown = np.zeros((rows.shape[0] - 1, degree + 3, rows.shape[2]))
        for i in range(3):
            grown[:, i : i + degree + 1] += far[i] * scaled[:-1] + near[i] * scaled[1:]
        rows = grown / _column(degree + 2)
    return np.asarray(rows[0])


@lru_cache(maxsize=128)
def _column(degree: int) -> FloatArray:
    return binomials(degree)[:, None]

"""Polynomials in Bernstein form on [0, 1]: the one basis the rig computes in.

An ordinate array is ``(p + 1,)`` or ``(p + 1, n)``: degree p, n polynomials side by side.
The basis is chosen for its stability (profile thesis §2.1.1): for degree 15 the monomial
coefficients reach 1e7 and cancel, the Bernstein ordinates are of the size of the lift.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.laws.bracketed_root import bracketed_root

EPS = float(np.finfo(np.float64).eps)
#: Up to so many points one call that runs along them is quicker than a loop over the degree.
FEW = 128
#: Subdivision stops here: roots nearer than this cannot be told apart in double precision.
_ROOT_RESOLUTION = 2.0**-46


@lru_cache(maxsize=128)
def binomials(degree: int) -> FloatArray:
    """Row ``degree`` of Pascal's triangle, ``(degree + 1,)``."""
    row = np.array([math.comb(degree, i) for i in range(degree + 1)], dtype=np.float64)
    row.setflags(write=False)
    return row


def basis(degree: int, u: FloatArray) -> FloatArray:
    """Bernstein basis values B_i(u), ``(len(u), degree + 1)`` (eq. 1 of the paper)."""
    powers = np.empty((2, degree + 1, u.size))
    powers[:, 0] = 1.0
    powers[0, 1:], powers[1, 1:] = u, 1.0 - u
    if u.size <= FEW:
        np.multiply.accumulate(powers, axis=1, out=powers)
    else:
        for i in range(2, degree + 1):
            powers[:, i] *= powers[:, i - 1]
    weights = powers[0]
    weights *= powers[1, ::-1]
    weights *= binomials(degree)[:, None]
    return np.asarray(weights.T)


def evaluate(ordinates: FloatArray, u: FloatArray) -> FloatArray:
    """Values at ``u``; ``(len(u),)`` or ``(len(u), n)``."""
    return np.asarray(basis(ordinates.shape[0] - 1, np.atleast_1d(u)) @ ordinates)


def scalar(ordinates: FloatArray) -> Callable[[float], float]:
    """The polynomial (``(p + 1,)`` ordinates) as a function of one u, in plain floats.

    Horner's rule in u/(1 − u), or in its inverse beyond the middle, so that no power grows: as
    stable as the basis, and 20 times as quick as an array of one.
    """
    weighted = (binomials(ordinates.size - 1) * ordinates).tolist()
    backward, degree = weighted[::-1], len(weighted) - 1

    def value(u: float) -> float:
        v = 1.0 - u
        terms, ratio, scale = (backward, u / v, v) if u < 0.5 else (weighted, v / u, u)
        total = 0.0
        for term in terms:
            total = total * ratio + term
        return float(total * scale**degree)

    return value


def derivative(ordinates: FloatArray) -> FloatArray:
    """Ordinates of d/du, one degree lower (a constant's is a constant zero)."""
    degree = ordinates.shape[0] - 1
    if degree == 0:
        return np.zeros_like(ordinates)
    return np.asarray(degree * np.diff(ordinates, axis=0))


def antiderivative(ordinates: FloatArray, start: float = 0.0) -> FloatArray:
    """Ordinates of the integral over u that begins at ``start``, one degree higher."""
    degree = ordinates.shape[0]
    steps = np.cumsum(ordinates, axis=0) / degree
    return np.concatenate([np.zeros_like(ordinates[:1]), steps]) + start


@lru_cache(maxsize=1024)
def elevation_matrix(degree: int, target: int) -> FloatArray:
    """Matrix ``(target + 1, degree + 1)`` that rewrites degree ``degree`` as ``target``."""
    matrix = np.zeros((target + 1, degree + 1))
    for j in range(degree + 1):
        rise = np.arange(j, j + target - degree + 1)
        more = binomials(target - degree)[rise - j]
        matrix[rise, j] = binomials(degree)[j] * more / binomials(target)[rise]
    matrix.setflags(write=False)
    return matrix


def elevate(ordinates: FloatArray, target: int) -> FloatArray:
    """The same polynomial written with degree ``target``: convex combinations, so stable."""
    degree = ordinates.shape[0] - 1
    return ordinates if degree == target else elevation_matrix(degree, target) @ ordinates


def taylor(ordinates: FloatArray) -> FloatArray:
    """``(n, p + 1, p + 1)``: for each of n columns, basis values at u to the series f^(r)(u)/r!."""
    degree = ordinates.shape[0] - 1
    series = np.empty((ordinates.shape[1], degree + 1, degree + 1))
    rows, factorial = ordinates, 1.0
    for r in range(degree + 1):
        series[:, :, r] = elevate(rows, degree).T / factorial
        rows = derivative(rows)
        factorial *= r + 1
    return series


def split(ordinates: FloatArray, u: float) -> tuple[FloatArray, FloatArray]:
    """De Casteljau: ordinates on [0, u] and on [u, 1]; the joint is the same number in both.

    Row i of the left half's matrix holds the basis of degree i at u; the right half mirrors it.
    """
    pascal, rest = _pascal(ordinates.shape[0] - 1)
    order = np.arange(float(ordinates.shape[0]))
    near, far = u**order, (1.0 - u) ** order
    left = (pascal * near * far[rest]) @ ordinates
    right = ((pascal * far * near[rest]) @ ordinates[::-1])[::-1]
    right[0] = left[-1]
    return np.asarray(left), np.asarray(right)


@lru_cache(maxsize=128)
def _pascal(degree: int) -> tuple[FloatArray, NDArray[np.intp]]:
    """Binomials C(i, j), zero where j > i, and the differences i − j."""
    order = np.arange(degree + 1)
    rest = np.maximum(order[:, None] - order, 0)
    pascal = [[float(math.comb(i, j)) for j in range(degree + 1)] for i in range(degree + 1)]
    return np.array(pascal), rest


def restrict(ordinates: FloatArray, start: float, stop: float) -> FloatArray:
    """Ordinates of the same polynomial on [start, stop] ⊂ [0, 1], start < 1."""
    tail = split(ordinates, start)[1] if start > 0.0 else ordinates
    inner = (stop - start) / (1.0 - start)
    return split(tail, inner)[0] if inner < 1.0 else tail


def sign_changes(ordinates: FloatArray) -> int:
    """Number of sign changes: no fewer than the roots in (0, 1) (Descartes' rule)."""
    signs = np.sign(ordinates)
    signs = signs[signs != 0.0]
    return int(np.count_nonzero(signs[1:] != signs[:-1]))


def crossings(ordinates: FloatArray, lo: float = 0.0, hi: float = 1.0) -> list[float]:
    """All u in (lo, hi) where the polynomial changes sign, in order.

    The ordinates are those on [lo, hi]. None is missed: a piece is dropped only when its
    ordinates do not change sign, which proves that the polynomial does not. Touching zero
    without crossing it is not counted.
    """
    changes = sign_changes(ordinates)
    if changes == 0:
        return []
    if changes == 1 and _opposite(ordinates[0], ordinates[-1]):
        return [lo + (hi - lo) * bracketed_root(scalar(ordinates), 0.0, 1.0)]
    if hi - lo <= _ROOT_RESOLUTION:
        return [0.5 * (lo + hi)] if _opposite(ordinates[0], ordinates[-1]) else []
    left, right = split(ordinates, 0.5)
    mid = 0.5 * (lo + hi)
    at_split = (
        [mid] if left[-1] == 0.0 and _opposite(_sign_before(left), _sign_after(right)) else []
    )
    return crossings(left, lo, mid) + at_split + crossings(right, mid, hi)


def _opposite(one: float, other: float) -> bool:
    """Opposite signs; a product of the two would underflow for tiny values."""
    return bool(np.sign(one) * np.sign(other) < 0.0)


def _sign_before(ordinates: FloatArray) -> float:
    nonzero = ordinates[ordinates != 0.0]
    return float(np.sign(nonzero[-1])) if nonzero.size else 0.0


def _sign_after(ordinates: FloatArray) -> float:
    return _sign_before(ordinates[::-1])


def negative_intervals(ordinates: FloatArray) -> list[tuple[float, float]]:
    """Intervals of [0, 1] where the polynomial is negative, in order."""
    edges = np.array([0.0, *crossings(ordinates), 1.0])
    middles = evaluate(ordinates, 0.5 * (edges[:-1] + edges[1:]))
    spans = zip(edges[:-1], edges[1:], middles, strict=True)
    return [(float(a), float(b)) for a, b, value in spans if value < 0.0]

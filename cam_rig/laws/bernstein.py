"""Polynomials in Bernstein form on [0, 1]: the one basis the rig computes in.

An ordinate array is ``(p + 1,)`` or ``(p + 1, n)``: degree p, n polynomials side by side.
The basis is chosen for its stability (profile thesis §2.1.1): for degree 15 the monomial
coefficients reach 1e7 and cancel, the Bernstein ordinates are of the size of the lift.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from cam_rig.laws.polynomials import (
    MIN_PART_WIDTH,
    count_sign_changes,
    find_single_root,
    halve_at_root,
    have_opposite_signs,
    weight_ordinates,
    weighted_value,
)
from cam_rig.units import FloatArray

EPS = float(np.finfo(np.float64).eps)
#: Up to so many points one call that runs along them is quicker than a loop over the degree.
FEW = 32


@lru_cache(maxsize=128)
def binomials(degree: int) -> FloatArray:
    """Row ``degree`` of Pascal's triangle, ``(degree + 1,)``."""
    row = np.array([math.comb(degree, i) for i in range(degree + 1)], dtype=np.float64)
    row.setflags(write=False)
    return row


def basis(degree: int, u: FloatArray) -> FloatArray:
    """Bernstein basis values B_i(u), ``(len(u), degree + 1)`` (eq. 1 of the paper)."""
    powers = np.empty((degree + 1, 2, u.size))
    powers[0] = 1.0
    powers[1:, 0], powers[1:, 1] = u, 1.0 - u
    if u.size <= FEW:
        np.multiply.accumulate(powers, axis=0, out=powers)
    else:
        for i in range(2, degree + 1):
            np.multiply(powers[i - 1], powers[1], out=powers[i])
    weights = powers[:, 0] * powers[::-1, 1]
    weights *= binomials(degree)[:, None]
    return np.asarray(weights.T)


def evaluate(ordinates: FloatArray, u: FloatArray) -> FloatArray:
    """Values at ``u``; ``(len(u),)`` or ``(len(u), n)``."""
    return np.asarray(basis(ordinates.shape[0] - 1, np.atleast_1d(u)) @ ordinates)


def scalar(ordinates: FloatArray) -> Callable[[float], float]:
    """The polynomial ``(p + 1,)`` as a function of one float."""
    size = ordinates.size
    return partial(weighted_value, weight_ordinates(ordinates, size), size)


def derivative(ordinates: FloatArray) -> FloatArray:
    """Ordinates of d/du, one degree lower (a constant's is a constant zero)."""
    degree = ordinates.shape[0] - 1
    if degree == 0:
        return np.zeros_like(ordinates)
    return np.asarray(degree * (ordinates[1:] - ordinates[:-1]))


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
    """De Casteljau: ordinates on [0, u] and on [u, 1]; the joint is the same number in both."""
    # row i of the left half's matrix holds the basis of degree i at u; the right half mirrors it
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


@lru_cache(maxsize=256)
def parts(degree: int, count: int) -> FloatArray:
    """Matrices ``(count, p + 1, p + 1)`` that take ordinates to those of equal parts."""
    starts = np.arange(count) / count
    widths = (np.arange(1, count + 1) / count - starts) / (1.0 - starts)
    before, tails = _splits(degree, starts)
    tails[:, 0] = before[:, -1]
    found = np.asarray(np.matmul(_splits(degree, widths)[0], tails))
    found.setflags(write=False)
    return found


def cut(
    ordinates: FloatArray, breaks: FloatArray, counts: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Pieces ``(p + 1, …, n)``, each cut into so many equal parts, and the breaks of all.

    Parts of what is constant, as in a dwell, keep its digits.
    """
    spans, firsts = np.repeat(np.diff(breaks) / counts, counts), np.cumsum(counts) - counts
    found = np.repeat(ordinates, counts, axis=-1)
    for i in np.flatnonzero(
        (counts > 1) & (ordinates != ordinates[0]).reshape(-1, counts.size).any(axis=0)
    ).tolist():
        first, count = int(firsts[i]), int(counts[i])
        matrices = parts(ordinates.shape[0] - 1, count)
        found[..., first : first + count] = np.einsum(
            "cqp,p...->q...c", matrices, ordinates[..., i]
        )
    inside = (np.arange(spans.size) - np.repeat(firsts, counts)) * spans
    return found, np.append(np.repeat(breaks[:-1], counts) + inside, breaks[-1])


def _splits(degree: int, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Matrices ``(n, p + 1, p + 1)`` of `split` at each u, but for the right one's first row."""
    pascal, rest = _pascal(degree)
    order = np.arange(degree + 1.0)
    near, far = u[:, None] ** order, (1.0 - u)[:, None] ** order
    left = pascal * near[:, None] * far[:, rest]
    return left, (pascal * far[:, None] * near[:, rest])[:, ::-1, ::-1]


def crossings(ordinates: FloatArray, low: float = 0.0, high: float = 1.0) -> list[float]:
    """Return all u in (low, high) where a polynomial on [low, high] changes sign, in order.

    No sign change is missed: a part is discarded only if its ordinates have none.
    """
    changes = count_sign_changes(ordinates)
    crosses = have_opposite_signs(ordinates[0], ordinates[-1])
    if changes == 0:
        return []
    if changes == 1 and crosses:
        return [float(low + (high - low) * find_single_root(ordinates))]
    middle = 0.5 * (low + high)
    if high - low <= MIN_PART_WIDTH:
        return [middle] if crosses else []
    halves = np.stack([ordinates, ordinates])
    at_middle = [middle] if halve_at_root(halves, 0) else []
    right, left = halves
    return crossings(left, low, middle) + at_middle + crossings(right, middle, high)


def negative_intervals(ordinates: FloatArray) -> list[tuple[float, float]]:
    """Intervals of [0, 1] where the polynomial is negative, in order."""
    edges = np.array([0.0, *crossings(ordinates), 1.0])
    middles = evaluate(ordinates, 0.5 * (edges[:-1] + edges[1:]))
    spans = zip(edges[:-1], edges[1:], middles, strict=True)
    return [(float(a), float(b)) for a, b, value in spans if value < 0.0]


# Products and compositions of polynomials in Bernstein form, by convex combinations.


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

    By powers of u and of 1 − u and their products: convolutions of ordinates times binomials, none
    of them below 0 where the ordinates of u are in [0, 1], so nothing cancels in them.
    """
    degree = outer.shape[0] - 1
    u, rest = binomials(2) * inner, binomials(2) * (1.0 - inner)
    near, far = [np.ones(1)], [np.ones(1)]
    for _ in range(degree):
        near.append(np.convolve(near[-1], u))
        far.append(np.convolve(far[-1], rest))
    shares = np.stack([np.convolve(*pair) for pair in zip(near, far[::-1], strict=True)], axis=1)
    weighted = binomials(degree)[:, None] * outer
    return np.asarray(shares / binomials(2 * degree)[:, None] @ weighted)


# Bernstein pieces that follow one another, before they are a cam's law.

#: Breakpoints, and one column of ordinates between each two.
Pieces = tuple[list[float], list[FloatArray]]
#: A cut nearer to a breakpoint than this fraction of its piece is made at the breakpoint.
NEAR = 1e-12


def turned_to_zero(pieces: Pieces, turn: float) -> Pieces:
    """One turn of pieces that begins at any angle, as one from angle 0, where a piece is cut."""
    moved: list[tuple[float, float, FloatArray]] = []
    breaks, columns = pieces
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        shift = turn * (start // turn)
        a, b = start - shift, stop - shift
        u = (turn - a) / (b - a)
        if u > 1.0 - NEAR:
            moved.append((a, min(b, turn), column))
        elif u < NEAR:
            moved.append((0.0, b - turn, column))
        else:
            before, after = split(column, u)
            moved += [(a, turn, before), (0.0, b - turn, after)]
    moved.sort(key=lambda piece: piece[0])
    starts = [0.0, *(a for a, _, _ in moved[1:])]
    return [*starts, turn], [column for _, _, column in moved]


def joined(columns: list[FloatArray]) -> FloatArray:
    """``(p + 1, n)`` ordinates of n columns, written with the highest degree p among them."""
    degree = max(column.size - 1 for column in columns)
    return np.stack([elevate(column, degree) for column in columns], axis=1)

"""Polynomials in Bernstein form on [0, 1], the basis of all computations.

An ordinate array has the shape ``(p + 1,)``, or ``(p + 1, n)`` for n polynomials of degree p. The
basis is used for its stability (profile thesis §2.1.1): for degree 15 the monomial coefficients
reach 1e7 and cancel, whereas the Bernstein ordinates are of the size of the lift.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
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

#: Float epsilon: distance from 1.0 to the next larger float.
EPS = float(np.finfo(np.float64).eps)
#: Largest number of points at which one accumulating call is faster than a loop over the degree.
MAX_ACCUMULATE_SIZE = 32


@lru_cache(maxsize=128)
def binomials(degree: int) -> FloatArray:
    """Return row ``degree`` of Pascal's triangle, ``(degree + 1,)``."""
    row = np.array([math.comb(degree, i) for i in range(degree + 1)], dtype=np.float64)
    row.setflags(write=False)
    return row


def basis(degree: int, u: FloatArray) -> FloatArray:
    """Return the Bernstein basis values B_i(u), ``(len(u), degree + 1)``.

    i is the index of the column.

    References
    ----------
    Equation 1 of the paper.
    """
    powers = np.empty((degree + 1, 2, u.size))
    powers[0] = 1.0
    powers[1:, 0], powers[1:, 1] = u, 1.0 - u
    if u.size <= MAX_ACCUMULATE_SIZE:
        np.multiply.accumulate(powers, axis=0, out=powers)
    else:
        for i in range(2, degree + 1):
            np.multiply(powers[i - 1], powers[1], out=powers[i])
    weights = powers[:, 0] * powers[::-1, 1]
    weights *= binomials(degree)[:, None]
    return np.asarray(weights.T)


def evaluate(ordinates: FloatArray, u: FloatArray) -> FloatArray:
    """Return the values of polynomials at ``u``, ``(len(u),)`` or ``(len(u), n)``."""
    return np.asarray(basis(ordinates.shape[0] - 1, np.atleast_1d(u)) @ ordinates)


def scalar(ordinates: FloatArray) -> Callable[[float], float]:
    """Return a polynomial with the ordinates ``(p + 1,)`` as a function of one float."""
    size = ordinates.size
    return partial(weighted_value, weight_ordinates(ordinates, size), size)


def derivative(ordinates: FloatArray) -> FloatArray:
    """Return the ordinates of the derivative by u, one degree lower.

    The derivative of a constant is a constant zero.
    """
    degree = ordinates.shape[0] - 1
    if degree == 0:
        return np.zeros_like(ordinates)
    return np.asarray(degree * (ordinates[1:] - ordinates[:-1]))


def antiderivative(ordinates: FloatArray, start: float = 0.0) -> FloatArray:
    """Return the ordinates of the integral of a polynomial over u, one degree higher.

    The value of the integral at u = 0 is ``start``.
    """
    degree = ordinates.shape[0]
    steps = np.cumsum(ordinates, axis=0) / degree
    return np.concatenate([np.zeros_like(ordinates[:1]), steps]) + start


@lru_cache(maxsize=1024)
def elevation_matrix(degree: int, target: int) -> FloatArray:
    """Return the matrix that raises the degree of a polynomial to ``target``.

    Its shape is ``(target + 1, degree + 1)``.
    """
    matrix = np.zeros((target + 1, degree + 1))
    for j in range(degree + 1):
        rows = np.arange(j, j + target - degree + 1)
        factors = binomials(target - degree)[rows - j]
        matrix[rows, j] = binomials(degree)[j] * factors / binomials(target)[rows]
    matrix.setflags(write=False)
    return matrix


def elevate(ordinates: FloatArray, target: int) -> FloatArray:
    """Return the ordinates of the same polynomial, written with degree ``target``.

    The new ordinates are convex combinations of the old ones, so the conversion is stable.
    """
    degree = ordinates.shape[0] - 1
    return ordinates if degree == target else elevation_matrix(degree, target) @ ordinates


def from_powers(powers: Sequence[float | Fraction]) -> FloatArray:
    """Return the ordinates ``(p + 1,)`` of the sum of powers[k]·u^k, exact for fractions."""
    degree = len(powers) - 1

    def ordinate(i: int) -> float:
        terms = (Fraction(math.comb(i, k), math.comb(degree, k)) * powers[k] for k in range(i + 1))
        return float(sum(terms))

    return np.array([ordinate(i) for i in range(degree + 1)])


def hermite(start: FloatArray, end: FloatArray, spans: FloatArray | float = 1.0) -> FloatArray:
    """Return the ordinates of the polynomials of least degree between given ends.

    The r-th derivative at an end depends on r + 1 ordinates (eq. 2.7 of the laws thesis).

    Parameters
    ----------
    start, end : ndarray, shape (m,) or (m, n)
        Value and derivatives at both ends of an interval, or of n intervals.
    spans : float or ndarray, shape (n,)
        Lengths of the intervals (default: 1).

    Returns
    -------
    ndarray, shape (2 m,) or (2 m, n)
        Ordinates of degree 2 m − 1.
    """
    count = start.shape[0]
    orders = np.arange(count).reshape(count, *[1] * (start.ndim - 1))
    factors = np.array([math.perm(2 * count - 1, order) for order in range(count)])
    scales, (pascal, _) = spans**orders / factors.reshape(orders.shape), _pascal(count - 1)
    halves = pascal @ (scales * start), pascal @ (scales * (-1.0) ** orders * end)
    return np.concatenate([halves[0], halves[1][::-1]])


def taylor(ordinates: FloatArray) -> FloatArray:
    """Return the matrices that convert Bernstein basis values to Taylor coefficients.

    The shape is ``(n, p + 1, p + 1)``, one matrix per column. Coefficient r is f^(r)(u)/r!.
    """
    degree = ordinates.shape[0] - 1
    series = np.empty((ordinates.shape[1], degree + 1, degree + 1))
    derived, factorial = ordinates, 1.0
    for r in range(degree + 1):
        series[:, :, r] = elevate(derived, degree).T / factorial
        derived = derivative(derived)
        factorial *= r + 1
    return series


def split(ordinates: FloatArray, u: float) -> tuple[FloatArray, FloatArray]:
    """Return the ordinates of a polynomial on [0, u] and on [u, 1].

    De Casteljau's algorithm is used. The ordinate at the joint is the same number in both.
    """
    # Row i of the left half's matrix contains the basis of degree i at u. The right half's matrix
    # is its mirror image.
    pascal, difference = _pascal(ordinates.shape[0] - 1)
    order = np.arange(float(ordinates.shape[0]))
    powers, mirrored = u**order, (1.0 - u) ** order
    left = (pascal * powers * mirrored[difference]) @ ordinates
    right = ((pascal * mirrored * powers[difference]) @ ordinates[::-1])[::-1]
    right[0] = left[-1]
    return np.asarray(left), np.asarray(right)


@lru_cache(maxsize=128)
def _pascal(degree: int) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return matrices of the binomials C(i, j), zero for j > i, and of i − j."""
    order = np.arange(degree + 1)
    difference = np.maximum(order[:, None] - order, 0)
    pascal = [[float(math.comb(i, j)) for j in range(degree + 1)] for i in range(degree + 1)]
    return np.array(pascal), difference


def restrict(ordinates: FloatArray, start: float, stop: float) -> FloatArray:
    """Return the ordinates of a polynomial on [start, stop] ⊂ [0, 1], start < 1."""
    tail = split(ordinates, start)[1] if start > 0.0 else ordinates
    inner = (stop - start) / (1.0 - start)
    return split(tail, inner)[0] if inner < 1.0 else tail


@lru_cache(maxsize=256)
def parts(degree: int, count: int) -> FloatArray:
    """Return the matrices from ordinates on [0, 1] to those on ``count`` equal parts.

    The shape is ``(count, p + 1, p + 1)``.
    """
    starts = np.arange(count) / count
    widths = (np.arange(1, count + 1) / count - starts) / (1.0 - starts)
    before, tails = _splits(degree, starts)
    tails[:, 0] = before[:, -1]
    matrices = np.asarray(np.matmul(_splits(degree, widths)[0], tails))
    matrices.setflags(write=False)
    return matrices


def cut(
    ordinates: FloatArray, breaks: FloatArray, counts: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Divide each piece of a polynomial into equal parts.

    The parts of a constant piece, such as a dwell, keep its digits.

    Parameters
    ----------
    ordinates : ndarray, shape (p + 1, …, n)
        Ordinates of n pieces.
    breaks : ndarray, shape (n + 1,)
        Breakpoints of the pieces.
    counts : ndarray of int, shape (n,)
        Number of parts of each piece.

    Returns
    -------
    ordinates, breaks : ndarray
        Ordinates and breakpoints of all parts.
    """
    spans, firsts = np.repeat(np.diff(breaks) / counts, counts), np.cumsum(counts) - counts
    result = np.repeat(ordinates, counts, axis=-1)
    for i in np.flatnonzero(
        (counts > 1) & (ordinates != ordinates[0]).reshape(-1, counts.size).any(axis=0)
    ).tolist():
        first, count = int(firsts[i]), int(counts[i])
        matrices = parts(ordinates.shape[0] - 1, count)
        result[..., first : first + count] = np.einsum(
            "cqp,p...->q...c", matrices, ordinates[..., i]
        )
    offsets = (np.arange(spans.size) - np.repeat(firsts, counts)) * spans
    return result, np.append(np.repeat(breaks[:-1], counts) + offsets, breaks[-1])


def _splits(degree: int, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the matrices ``(n, p + 1, p + 1)`` of `split` at each u, left and right.

    The first row of the right matrix is not adjusted to the last row of the left one.
    """
    pascal, difference = _pascal(degree)
    order = np.arange(degree + 1.0)
    powers, mirrored = u[:, None] ** order, (1.0 - u)[:, None] ** order
    left = pascal * powers[:, None] * mirrored[:, difference]
    return left, (pascal * mirrored[:, None] * powers[:, difference])[:, ::-1, ::-1]


def crossings(ordinates: FloatArray, low: float = 0.0, high: float = 1.0) -> list[float]:
    """Return all u in (low, high) at which a polynomial changes sign, in order.

    ``ordinates`` belong to [low, high]. No sign change is missed: a part is discarded only if its
    ordinates do not change sign.
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
    """Return the intervals of [0, 1] in which a polynomial is negative, in order."""
    edges = np.array([0.0, *crossings(ordinates), 1.0])
    middles = evaluate(ordinates, 0.5 * (edges[:-1] + edges[1:]))
    spans = zip(edges[:-1], edges[1:], middles, strict=True)
    return [(float(a), float(b)) for a, b, value in spans if value < 0.0]


# Products and compositions of polynomials, by convex combinations.


def product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the ordinates of the product of two polynomials, ``(m + n + 1, k)``.

    The factors have the shapes ``(m + 1,)`` and ``(n + 1, k)``.
    """
    low, high = first.size - 1, second.shape[0] - 1
    scaled = binomials(high)[:, None] * second
    out = np.zeros((low + high + 1, second.shape[1]))
    for i, weight in enumerate(binomials(low) * first):
        out[i : i + high + 1] += weight * scaled
    return np.asarray(out / binomials(low + high)[:, None])


def compose(outer: FloatArray, inner: FloatArray) -> FloatArray:
    """Return the ordinates of a polynomial f of a quadratic u(τ), ``(2p + 1, k)``.

    f has the shape ``(p + 1, k)``, and u is a quadratic ``(3,)``. The result is a sum of products
    of powers of u and of 1 − u. If the ordinates of u are in [0, 1], the powers have no negative
    coefficients, so no digits cancel.
    """
    degree = outer.shape[0] - 1
    u, remainder = binomials(2) * inner, binomials(2) * (1.0 - inner)
    powers, mirrored = [np.ones(1)], [np.ones(1)]
    for _ in range(degree):
        powers.append(np.convolve(powers[-1], u))
        mirrored.append(np.convolve(mirrored[-1], remainder))
    terms = np.stack(
        [np.convolve(*pair) for pair in zip(powers, mirrored[::-1], strict=True)], axis=1
    )
    weighted = binomials(degree)[:, None] * outer
    return np.asarray(terms / binomials(2 * degree)[:, None] @ weighted)


# Consecutive Bernstein pieces, before they become the law of a cam.

#: Breakpoints, and one column of ordinates for each interval between two of them.
Pieces = tuple[list[float], list[FloatArray]]
#: Distance from a breakpoint, as a fraction of the piece, within which a cut is moved to the
#: breakpoint. It is above the rounding of an angle of one turn.
BREAK_RTOL = 1e-12


def rotate_to_zero(pieces: Pieces, turn: float) -> Pieces:
    """Rotate the pieces of one turn so that they start at angle 0.

    A piece that contains angle 0 is split there. ``turn`` is the length of a turn.
    """
    moved: list[tuple[float, float, FloatArray]] = []
    breaks, columns = pieces
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        shift = turn * (start // turn)
        low, high = start - shift, stop - shift
        u = (turn - low) / (high - low)
        if u > 1.0 - BREAK_RTOL:
            moved.append((low, min(high, turn), column))
        elif u < BREAK_RTOL:
            moved.append((0.0, high - turn, column))
        else:
            before, after = split(column, u)
            moved += [(low, turn, before), (0.0, high - turn, after)]
    moved.sort(key=lambda piece: piece[0])
    starts = [0.0, *(low for low, _, _ in moved[1:])]
    return [*starts, turn], [column for _, _, column in moved]


def join_pieces(columns: list[FloatArray]) -> FloatArray:
    """Join the ordinates of n pieces of different degrees, ``(p + 1, n)``.

    p is the highest degree among the pieces.
    """
    degree = max(column.size - 1 for column in columns)
    return np.stack([elevate(column, degree) for column in columns], axis=1)

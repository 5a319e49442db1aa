"""The points of a plan in the unit cube, each from its index alone.

So any batch of points can be made anywhere, without those before it and without memory of them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from cam_rig.arrays import FloatArray
from cam_rig.schema.studies.campaign import PlanKind

Indices = NDArray[np.uint64]
#: Bits of Sobol's sequence; a coordinate is the middle of its smallest interval, never 0 or 1.
SOBOL_BITS = 30
#: Rounds of the network that permutes the strata of a Latin hypercube.
ROUNDS = 8
#: 2^64 over the golden ratio, odd: the step of SplitMix64.
GOLDEN = 0x9E3779B97F4A7C15


def unit_points(
    kind: PlanKind, seed: int, total: int, dimensions: int, first: int, last: int
) -> FloatArray:
    """Points ``first`` to ``last`` (exclusive) of so many in all, ``(last − first, dimensions)``.

    Of ``latin_hypercube``, ``sobol`` (scrambled by the seed) or ``shares``: for each point (a, b)
    of a Sobol sequence of 2d numbers the d + 2 rows a; a with one number of b, d times; b
    (Saltelli's design, in SALib's order).
    """
    if kind == "latin_hypercube":
        index = np.arange(first, last, dtype=np.uint64)
        columns = [_stratified(index, total, seed, axis) for axis in range(dimensions)]
        return np.stack(columns, axis=1)
    if kind == "sobol":
        return _sobol(seed, dimensions, first, last)
    each = dimensions + 2
    base = _sobol(seed, 2 * dimensions, first // each, -(-last // each))
    a, b = base[:, None, :dimensions], base[:, None, dimensions:]
    of_b = np.zeros((each, dimensions), dtype=bool)
    of_b[1:-1], of_b[-1] = np.eye(dimensions, dtype=bool), True
    rows = np.where(of_b, b, a).reshape(-1, dimensions)
    start = first - first // each * each
    return rows[start : start + last - first]


def _sobol(seed: int, dimensions: int, first: int, last: int) -> FloatArray:
    """Points of the scrambled sequence."""
    sequence = qmc.Sobol(dimensions, scramble=True, bits=SOBOL_BITS, rng=seed)
    parts = []
    if first == 0 and last > 0:  # apart: scipy warns of a first draw that is no power of 2
        parts.append(sequence.random(1))
        first = 1
    else:
        sequence.fast_forward(first)
    if last > first:
        parts.append(sequence.random(last - first))
    return np.concatenate(parts) + 0.5 ** (SOBOL_BITS + 1)


def _stratified(index: Indices, total: int, seed: int, axis: int) -> FloatArray:
    """One coordinate of a Latin hypercube: each of ``total`` equal strata is met once."""
    key = _hashed(np.array([seed, axis], dtype=np.uint64), 1).tolist()
    stratum = _permuted(index, total, key[0] ^ _rotated(key[1]))
    inside = (_hashed(index, key[1] ^ _rotated(key[0])) >> np.uint64(11)).astype(np.float64)
    return np.asarray((stratum + (inside + 0.5) * 2.0**-53) / total)


def _rotated(word: int) -> int:
    return (word << 32 | word >> 32) & 0xFFFFFFFFFFFFFFFF


def _hashed(words: Indices, key: int) -> Indices:
    """SplitMix64 of words under a key: as good as random, and the same wherever it is computed."""
    with np.errstate(over="ignore"):
        z = (words ^ np.uint64(key)) * np.uint64(GOLDEN) + np.uint64(GOLDEN)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(z ^ (z >> np.uint64(31)))


def _permuted(index: Indices, total: int, key: int) -> Indices:
    """A permutation of 0 … total − 1 by its key, at any indices.

    A Feistel network permutes the numbers of an even number of bits; what falls beyond ``total``
    goes through it again, until it is inside.
    """
    half = max(1, -(-(total - 1).bit_length() // 2))
    mask, shift = np.uint64((1 << half) - 1), np.uint64(half)
    found = index.copy()
    outside = np.ones(found.size, dtype=bool)
    while outside.any():
        left, right = found[outside] >> shift, found[outside] & mask
        for step in range(ROUNDS):
            mixed = _hashed(right, (key + step * GOLDEN) & 0xFFFFFFFFFFFFFFFF)
            left, right = right, left ^ (mixed & mask)
        found[outside] = left << shift | right
        outside = found >= np.uint64(total)
    return found


def grid_places(counts: list[int], first: int, last: int) -> NDArray[np.int64]:
    """Which step of each input, the last input fastest, ``(last − first, len(counts))``."""
    index = np.arange(first, last, dtype=np.int64)
    places = np.empty((index.size, len(counts)), dtype=np.int64)
    for axis in range(len(counts) - 1, -1, -1):
        places[:, axis] = index % counts[axis]
        index //= counts[axis]
    return places


def rows_of(kind: PlanKind, points: int | None, counts: list[int]) -> int:
    """How many rows a plan has; ``counts`` are the steps of a grid, one for each input."""
    if kind == "grid":
        return math.prod(counts)
    assert points is not None  # the schema's
    return points * (len(counts) + 2) if kind == "shares" else points

"""The inputs of points: from the unit cube to numbers, correlated where the study says so."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from cam_rig.errors import ConfigError
from cam_rig.studies.campaign.inputs import CampaignInput
from cam_rig.studies.campaign.schema import CampaignConfig, PlanKind
from cam_rig.units import FloatArray

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
    sequence = qmc.Sobol(dimensions, scramble=True, bits=SOBOL_BITS, rng=seed)
    parts = [np.empty((0, dimensions))]
    if first == 0 < last:  # apart: scipy warns of a first draw that is no power of 2
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
    """A permutation of 0 … total − 1 at any indices: a Feistel network, walked until inside."""
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


def grid_places(counts: list[int], first: int, last: int) -> NDArray[np.intp]:
    """Which step of each input, the last input fastest, ``(last − first, len(counts))``."""
    return np.stack(np.unravel_index(np.arange(first, last), counts), axis=1)


def rows_of(kind: PlanKind, points: int | None, counts: list[int]) -> int:
    """How many rows a plan has; ``counts`` are the steps of a grid, one for each input."""
    if kind == "grid":
        return math.prod(counts)
    assert points is not None  # the schema's
    return points * (len(counts) + 2) if kind == "shares" else points


@dataclass(eq=False)
class InputDraws:
    """The inputs of all points, ``(n, d)`` SI, correlated by a Gaussian copula."""

    config: CampaignConfig
    inputs: tuple[CampaignInput, ...]

    def __post_init__(self) -> None:
        variations = [one.variation for one in self.inputs]
        self._counts = [len(v.values) if v.values else v.count or 1 for v in variations]
        self.total = rows_of(self.config.plan.kind, self.config.plan.points, self._counts)
        order = [one.path for one in self.inputs]
        matrix = np.eye(len(order))
        for pair in self.config.correlated:
            i, j = (order.index(path) for path in pair.inputs)
            matrix[i, j] = matrix[j, i] = pair.coefficient
        try:
            self._mixing = np.linalg.cholesky(matrix).tolist()
        except np.linalg.LinAlgError:
            raise ConfigError(
                "correlated: no numbers have these correlations together (their matrix is not "
                "positive definite); allowed: smaller coefficients"
            ) from None

    def rows(self, first: int, last: int) -> FloatArray:
        """Points ``first`` to ``last`` (exclusive); a row depends on its index and the study."""
        plan = self.config.plan
        if plan.kind == "grid":
            places = grid_places(self._counts, first, last)
            columns = [steps_of(one)[places[:, i]] for i, one in enumerate(self.inputs)]
        else:
            dimensions = len(self.inputs)
            unit = unit_points(plan.kind, plan.seed, self.total, dimensions, first, last)
            unit = self._correlated(unit)
            columns = [drawn(one, unit[:, i]) for i, one in enumerate(self.inputs)]
        return np.stack(columns, axis=1)

    def middle(self) -> FloatArray:
        """Each input in the middle of its distribution, ``(d,)``; a list's number there."""
        half = np.array([0.5])
        return np.concatenate([drawn(one, half) for one in self.inputs])

    def _correlated(self, unit: FloatArray) -> FloatArray:
        """Term by term: a matrix product may round otherwise in a batch of another length."""
        if not self.config.correlated:
            return unit
        normal, found = ndtri(unit), np.zeros_like(unit)
        for i, row in enumerate(self._mixing):
            for k, weight in enumerate(row[: i + 1]):
                found[:, i] += weight * normal[:, k]
        return np.asarray(ndtr(found))


def steps_of(one: CampaignInput) -> FloatArray:
    """The numbers that an input takes on a grid."""
    variation = one.variation
    if variation.values is not None:
        steps = np.array(variation.values)
    else:
        assert variation.range is not None and variation.count is not None  # the schema's
        steps = np.linspace(*variation.range, variation.count)
    return np.asarray(one.origin + one.factor * steps)


def ends_of(one: CampaignInput) -> FloatArray:
    """The least and the largest that an input can be; the middle of what has no ends."""
    if one.variation.values is not None:
        steps = steps_of(one)
        return np.array([steps.min(), steps.max()])
    return drawn(one, np.array([0.5] if one.endless else [0.0, 1.0]))


def drawn(one: CampaignInput, unit: FloatArray) -> FloatArray:
    """What an input is at places of its distribution, each in (0, 1)."""
    variation = one.variation
    if variation.values is not None:
        steps = steps_of(one)
        return np.asarray(steps[np.minimum(unit * steps.size, steps.size - 1).astype(int)])
    if variation.range is not None:
        low, high = variation.range
        return np.asarray(one.origin + one.factor * (low + (high - low) * unit))
    if variation.uniform is not None:
        return np.asarray(one.mean + one.factor * variation.uniform * (2.0 * unit - 1.0))
    spread, within = variation.normal or 0.0, variation.within
    if spread == 0.0:
        return np.full(unit.size, one.mean)
    if within is not None:
        below = ndtr(-within / spread)
        unit = below + (1.0 - 2.0 * below) * unit
    return np.asarray(one.mean + one.factor * spread * ndtri(unit))

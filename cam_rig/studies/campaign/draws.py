"""Input values of the points of a campaign.

A plan places the points on a grid, or in the unit cube with one coordinate per input. A coordinate
is then converted to a value by the inverse of the input's distribution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.studies.campaign.inputs import CampaignInput
from cam_rig.studies.campaign.schema import CampaignConfig, PlanKind
from cam_rig.units import FloatArray

Indices = NDArray[np.uint64]
#: Number of bits of a coordinate of a Sobol sequence. Half of the smallest step is added to it, so
#: that it is never 0 or 1.
SOBOL_BITS = 30
#: Number of rounds of the Feistel network (a pseudorandom permutation) that orders the strata of a
#: Latin hypercube.
ROUNDS = 8
#: Increment of the SplitMix64 generator: the odd number nearest to 2^64 divided by the golden
#: ratio.
GOLDEN = 0x9E3779B97F4A7C15


def unit_points(
    kind: PlanKind, seed: int, total: int, dimensions: int, first: int, last: int
) -> FloatArray:
    """Return the points ``first`` to ``last`` (exclusive) of a plan in the unit cube.

    The shape is ``(last − first, dimensions)``, and ``total`` is the number of all points. ``kind``
    is ``latin_hypercube``, ``sobol`` (scrambled by the seed) or ``shares``. For ``shares`` each
    point (a, b) of a Sobol sequence of 2d numbers gives d + 2 rows: a, then a with one number of b,
    d times, then b (Saltelli's design, in SALib's order).
    """
    if kind == "latin_hypercube":
        index = np.arange(first, last, dtype=np.uint64)
        columns = [_latin_coordinate(index, total, seed, axis) for axis in range(dimensions)]
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
    from scipy.stats import qmc  # takes 0.25 s, and a worker of a grid does not need it

    sequence = qmc.Sobol(dimensions, scramble=True, bits=SOBOL_BITS, rng=seed)
    parts = [np.empty((0, dimensions))]
    if first == 0 < last:  # separate, because scipy warns if the first draw is not a power of 2
        parts.append(sequence.random(1))
        first = 1
    else:
        sequence.fast_forward(first)
    if last > first:
        parts.append(sequence.random(last - first))
    return np.concatenate(parts) + 0.5 ** (SOBOL_BITS + 1)


def _latin_coordinate(index: Indices, total: int, seed: int, axis: int) -> FloatArray:
    """Return one coordinate, in (0, 1), of points of a Latin hypercube.

    The range of the coordinate is divided into ``total`` equal strata, each of which contains one
    point. ``index`` are the numbers of the points, and ``axis`` is that of the coordinate.
    """
    key = _hash(np.array([seed, axis], dtype=np.uint64), 1).tolist()
    stratum = _permute(index, total, key[0] ^ _rotate(key[1]))
    position = (_hash(index, key[1] ^ _rotate(key[0])) >> np.uint64(11)).astype(np.float64)
    return np.asarray((stratum + (position + 0.5) * 2.0**-53) / total)


def _rotate(word: int) -> int:
    return (word << 32 | word >> 32) & 0xFFFFFFFFFFFFFFFF


def _hash(values: Indices, key: int) -> Indices:
    """Return SplitMix64 hashes of values under a key.

    They are the same on all platforms, so that a seed gives the same points everywhere.
    """
    with np.errstate(over="ignore"):
        z = (values ^ np.uint64(key)) * np.uint64(GOLDEN) + np.uint64(GOLDEN)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(z ^ (z >> np.uint64(31)))


def _permute(index: Indices, total: int, key: int) -> Indices:
    """Return the numbers to which a pseudorandom permutation maps ``index``.

    It permutes 0 … total − 1, and ``key`` selects the permutation. It is a Feistel network,
    repeated until the result is below ``total``. No table of the permutation is needed.
    """
    half = max(1, -(-(total - 1).bit_length() // 2))
    mask, shift = np.uint64((1 << half) - 1), np.uint64(half)
    result = index.copy()
    outside = np.ones(result.size, dtype=bool)
    while outside.any():
        left, right = result[outside] >> shift, result[outside] & mask
        for step in range(ROUNDS):
            mixed = _hash(right, (key + step * GOLDEN) & 0xFFFFFFFFFFFFFFFF)
            left, right = right, left ^ (mixed & mask)
        result[outside] = left << shift | right
        outside = result >= np.uint64(total)
    return result


def grid_indices(counts: list[int], first: int, last: int) -> NDArray[np.intp]:
    """Return the index of each input's value, for some points of a grid.

    The points are ``first`` to ``last`` (exclusive), with indices from 0 and the shape ``(last −
    first, len(counts))``. ``counts`` are the numbers of values per input. The last input varies
    fastest.
    """
    return np.stack(np.unravel_index(np.arange(first, last), counts), axis=1)


def rows_of(kind: PlanKind, points: int | None, counts: list[int]) -> int:
    """Return the total number of points (rigs) of a campaign plan.

    ``kind`` is the kind of the plan, and ``points`` its number in the campaign file. ``counts`` are
    the numbers of values per input of a grid.
    """
    if kind == "grid":
        return math.prod(counts)
    assert points is not None  # ensured by the schema
    return points * (len(counts) + 2) if kind == "shares" else points


@dataclass(eq=False)
class InputDraws:
    """Input values of all points of a campaign, in SI.

    They are computed for any range of points. Correlations of inputs are those of a Gaussian
    copula.
    """

    config: CampaignConfig
    inputs: tuple[CampaignInput, ...]

    def __post_init__(self) -> None:
        variations = [item.variation for item in self.inputs]
        self._counts = [len(v.values) if v.values else v.count or 1 for v in variations]
        self.total = rows_of(self.config.plan.kind, self.config.plan.points, self._counts)
        order = [item.path for item in self.inputs]
        matrix = np.eye(len(order))
        for pair in self.config.correlated:
            i, j = (order.index(path) for path in pair.inputs)
            matrix[i, j] = matrix[j, i] = pair.coefficient
        try:
            self._mixing = np.linalg.cholesky(matrix).tolist()
        except np.linalg.LinAlgError:
            raise ConfigError(
                "correlated: the matrix of the correlations must be positive definite; use smaller "
                "coefficients"
            ) from None

    def rows(self, first: int, last: int) -> FloatArray:
        """Return the input values of the points ``first`` to ``last`` (exclusive).

        A point is one rig of the campaign. The values are in SI, with shape ``(last − first, d)``.
        Those of a point depend only on its index and the campaign.
        """
        plan = self.config.plan
        if plan.kind == "grid":
            indices = grid_indices(self._counts, first, last)
            columns = [steps_of(item)[indices[:, i]] for i, item in enumerate(self.inputs)]
        else:
            dimensions = len(self.inputs)
            unit = unit_points(plan.kind, plan.seed, self.total, dimensions, first, last)
            unit = self._correlate(unit)
            columns = [draw(item, unit[:, i]) for i, item in enumerate(self.inputs)]
        return np.stack(columns, axis=1)

    def middle(self) -> FloatArray:
        """Return the median of the distribution of each input, in SI, ``(d,)``.

        For an input with a list of values it is the value in the middle of the list.
        """
        half = np.array([0.5])
        return np.concatenate([draw(item, half) for item in self.inputs])

    def _correlate(self, unit: FloatArray) -> FloatArray:
        """Transform points of the unit cube so that the inputs are correlated as required.

        ``unit`` contains one point per row. The sum is computed term by term, because a matrix
        product may be rounded differently in a batch of another length.
        """
        if not self.config.correlated:
            return unit
        from scipy.special import ndtr, ndtri

        normal, correlated = ndtri(unit), np.zeros_like(unit)
        for i, row in enumerate(self._mixing):
            for k, weight in enumerate(row[: i + 1]):
                correlated[:, i] += weight * normal[:, k]
        return np.asarray(ndtr(correlated))


def steps_of(item: CampaignInput) -> FloatArray:
    """Return the values (SI) that an input takes on a grid.

    They are its list of values, or equally spaced values of its range.
    """
    variation = item.variation
    if variation.values is not None:
        steps = np.array(variation.values)
    else:
        assert variation.range is not None and variation.count is not None  # ensured by the schema
        steps = np.linspace(*variation.range, variation.count)
    return np.asarray(item.origin + item.factor * steps)


def ends_of(item: CampaignInput) -> FloatArray:
    """Return the smallest and the largest value (SI) that an input can take.

    If its distribution is unbounded, only the median is returned.
    """
    if item.variation.values is not None:
        steps = steps_of(item)
        return np.array([steps.min(), steps.max()])
    return draw(item, np.array([0.5] if item.endless else [0.0, 1.0]))


def draw(item: CampaignInput, unit: FloatArray) -> FloatArray:
    """Return the values (SI) of an input at probabilities of its distribution.

    ``unit`` contains the probabilities, each in (0, 1). The function is the inverse of the
    cumulative distribution.
    """
    variation = item.variation
    if variation.values is not None:
        steps = steps_of(item)
        return np.asarray(steps[np.minimum(unit * steps.size, steps.size - 1).astype(int)])
    if variation.range is not None:
        low, high = variation.range
        return np.asarray(item.origin + item.factor * (low + (high - low) * unit))
    if variation.uniform is not None:
        return np.asarray(item.mean + item.factor * variation.uniform * (2.0 * unit - 1.0))
    from scipy.special import ndtr, ndtri

    spread, within = variation.normal or 0.0, variation.within
    if spread == 0.0:
        return np.full(unit.size, item.mean)
    if within is not None:
        below = ndtr(-within / spread)
        unit = below + (1.0 - 2.0 * below) * unit
    return np.asarray(item.mean + item.factor * spread * ndtri(unit))

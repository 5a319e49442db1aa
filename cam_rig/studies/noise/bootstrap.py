"""Confidence intervals of the noise curves and their crossing, by a bootstrap of the fit errors.

The measured levels are lost, so their scatter cannot be resampled. What can is the difference
between a simulated and a published regression: it is smooth along the speeds, so it is cut into
blocks of neighbouring speeds, which are drawn and joined anew (circular moving-block bootstrap).
The bands say how far the model could be out, if it is out elsewhere as much as where it can be
checked. They say nothing about the meter, nor about another copy of the machine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.simulation.regression import REGRESSION_DEGREE, crossings, nearest_crossing

#: Neighbouring speeds that are drawn together: a third of the range.
BLOCK = 7
#: Draws, and the seed of them.
DRAWS, SEED = 2000, 1
#: Percent outside a 95 % band, on either side.
TAIL = 2.5


def resample(residual: FloatArray, generator: np.random.Generator) -> FloatArray:
    """``(DRAWS, n)`` series like ``residual`` ``(n,)``, put together from blocks of it."""
    count = residual.size
    blocks = -(-count // BLOCK)
    starts = generator.integers(0, count, size=(DRAWS, blocks))
    index = (starts[:, :, None] + np.arange(BLOCK)) % count
    return np.asarray(residual[index.reshape(DRAWS, -1)[:, :count]])


@dataclass(frozen=True, eq=False)
class Band:
    """Where 95 % of the draws lie, dB at each speed, ``(n,)``."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, draws: FloatArray) -> Band:
        """The band of draws ``(DRAWS, n)``."""
        low, high = np.percentile(draws, [TAIL, 100.0 - TAIL], axis=0)
        return cls(low, high)

    def holds(self, level: FloatArray) -> float:
        """Share of the speeds at which a curve ``(n,)`` lies within."""
        return float(np.mean((level >= self.low) & (level <= self.high)))


@dataclass(frozen=True)
class Crossing:
    """Speed in rpm at which two regressions cross, with its confidence interval.

    ``low`` and ``high`` hold 95 % of the draws, ``deviation`` is their standard deviation;
    ``missing`` is the share of draws that do not cross at all within the speeds. ``points_rpm`` is
    where the simulated levels themselves cross, without a regression.
    """

    rpm: float | None
    low: float
    high: float
    deviation: float
    missing: float
    points_rpm: float | None = None


def all_crossings(rpm: FloatArray, one: FloatArray, two: FloatArray) -> FloatArray:
    """Where two cubics, given by their values ``(n,)``, cross, rpm."""
    fit, scale = _difference(rpm, one, two)
    return crossings(fit, (rpm[0], rpm[-1]), scale=scale, shift=1.0)


def crossing(rpm: FloatArray, one: FloatArray, two: FloatArray, near: float) -> float | None:
    """The one of `all_crossings` nearest to ``near`` rpm; None when there is none."""
    fit, scale = _difference(rpm, one, two)
    return nearest_crossing(fit, (rpm[0], rpm[-1]), near, scale=scale, shift=1.0)


def _difference(rpm: FloatArray, one: FloatArray, two: FloatArray) -> tuple[FloatArray, float]:
    """Coefficients of one less the other over rpm/scale − 1, and that scale."""
    scale = float(rpm.mean())
    fit = np.polynomial.polynomial.polyfit(rpm / scale - 1.0, one - two, REGRESSION_DEGREE)
    return np.asarray(fit, dtype=np.float64), scale


def points_crossing(rpm: FloatArray, one: FloatArray, two: FloatArray, near: float) -> float | None:
    """Where two series of levels ``(n,)``, joined by straight lines, cross nearest to ``near``."""
    gap = one - two
    at = np.flatnonzero(np.sign(gap[1:]) != np.sign(gap[:-1]))
    share = gap[at] / (gap[at] - gap[at + 1])
    found = rpm[at] + share * (rpm[at + 1] - rpm[at])
    return float(found[np.argmin(np.abs(found - near))]) if found.size else None


def crossing_interval(
    rpm: FloatArray,
    best: tuple[FloatArray, FloatArray],
    draws: tuple[FloatArray, FloatArray],
    near: float,
) -> Crossing:
    """The crossing of two regressions, with what draws ``(DRAWS, n)`` of both say about it."""
    found = [crossing(rpm, one, two, near) for one, two in zip(*draws, strict=True)]
    there = np.array([rpm for rpm in found if rpm is not None])
    missing = 1.0 - there.size / len(found)
    if there.size < 2:
        return Crossing(crossing(rpm, *best, near), np.nan, np.nan, np.nan, missing)
    low, high = np.percentile(there, [TAIL, 100.0 - TAIL])
    deviation = float(np.std(there, ddof=1))
    return Crossing(crossing(rpm, *best, near), float(low), float(high), deviation, missing)

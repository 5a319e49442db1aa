"""Levels over speed beside the published regressions: fit errors, and where two curves cross."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray, rms
from cam_rig.schema import PublishedNoise
from cam_rig.simulation.regression import nearest_crossing, regression
from cam_rig.units import to_rpm


@dataclass(frozen=True, eq=False)
class NoiseCurve:
    """Measured level (dB) of one cam at each speed, and its cubic regression in rpm."""

    cam: str
    role: str
    rpm: FloatArray
    level_db: FloatArray
    coefficients: FloatArray
    rmse_db: float | None


@dataclass(frozen=True, eq=False)
class NoiseResult:
    """The noise comparison of a run."""

    curves: dict[str, NoiseCurve]
    crossover_rpm: float | None


def compare(
    levels: dict[str, dict[float, float]],
    roles: dict[str, str],
    published: PublishedNoise | None,
) -> NoiseResult:
    """Regressions of all cams, their r.m.s. difference to the published ones, the crossover."""
    curves = {}
    for cam, steps in levels.items():
        rpm = to_rpm(np.array(sorted(steps)))
        level = np.array([steps[speed] for speed in sorted(steps)])
        curves[cam] = NoiseCurve(
            cam, roles[cam], rpm, level, regression(rpm, level), _rmse(cam, rpm, level, published)
        )
    return NoiseResult(curves, _crossover(curves, published))


def _rmse(
    cam: str, rpm: FloatArray, level: FloatArray, published: PublishedNoise | None
) -> float | None:
    """r.m.s. of simulated level minus published regression, within the published range."""
    if published is None or cam not in published.regression_db:
        return None
    low, high = published.range_rpm
    inside = (rpm > low - 1e-6) & (rpm < high + 1e-6)
    if not inside.any():
        return None
    return rms(level[inside] - published.level(cam, rpm[inside]))


def _crossover(curves: dict[str, NoiseCurve], published: PublishedNoise | None) -> float | None:
    """Speed (rpm) where the regressions of the two published cams meet, None when nowhere."""
    if published is None or not set(published.crossover.between) <= set(curves):
        return None
    one, two = (curves[cam] for cam in published.crossover.between)
    difference = one.coefficients - two.coefficients
    if not np.isfinite(difference).all():
        return None
    low, high = max(one.rpm[0], two.rpm[0]), min(one.rpm[-1], two.rpm[-1])
    scaled = difference * high ** np.arange(difference.size)
    return nearest_crossing(scaled, (low, high), published.crossover.rpm, scale=high)

"""Cubic regression of level over speed, as the paper's, and where two of them cross."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.schema import PublishedNoise
from cam_rig.simulation.scene import LevelOrigin
from cam_rig.units import FloatArray, rms, to_rpm

REGRESSION_DEGREE = 3
#: A number of a polynomial below this part of its largest is rounding; and such an imaginary part.
ROUNDING, ALMOST_REAL = 1e-12, 1e-9


def regression(rpm: FloatArray, level: FloatArray) -> FloatArray:
    """Least-squares coefficients c0 … c3 of level in dB over rpm."""
    if rpm.size <= REGRESSION_DEGREE:
        return np.full(REGRESSION_DEGREE + 1, np.nan)
    fit = np.polynomial.Polynomial.fit(rpm, level, REGRESSION_DEGREE)
    found = fit.convert().coef  # without trailing zeros
    return np.pad(found, (0, REGRESSION_DEGREE + 1 - found.size))


def cubic(rpm: FloatArray) -> FloatArray:
    """``(n, n)``: takes levels at the speeds to the values of their regression there."""
    powers = np.polynomial.polynomial.polyvander(rpm / rpm.mean() - 1.0, REGRESSION_DEGREE)
    return np.asarray(powers @ np.linalg.pinv(powers))


def real_roots(coefficients: FloatArray) -> FloatArray:
    """Real roots of c0 + c1 x + …, x about one; a leading number of mere rounding is zero."""
    kept = np.polynomial.polynomial.polytrim(coefficients, ROUNDING * np.abs(coefficients).max())
    roots = np.polynomial.polynomial.polyroots(kept)
    return np.asarray(roots.real[np.abs(roots.imag) < ALMOST_REAL])


def crossings(
    difference: FloatArray, speeds: tuple[float, float], *, scale: float, shift: float = 0.0
) -> FloatArray:
    """Speeds (rpm) between ``speeds`` at which regressions cross that differ by c0 … c3 (dB)."""
    found = (real_roots(difference) + shift) * scale
    return np.sort(found[(found >= speeds[0]) & (found <= speeds[1])])


def nearest_crossing(
    difference: FloatArray,
    speeds: tuple[float, float],
    near: float,
    *,
    scale: float,
    shift: float = 0.0,
) -> float | None:
    """The one of the `crossings` nearest to ``near`` (rpm); None when there is none."""
    inside = crossings(difference, speeds, scale=scale, shift=shift)
    return float(inside[np.argmin(np.abs(inside - near))]) if inside.size else None


@dataclass(frozen=True, eq=False)
class NoiseCurve:
    """Measured level (dB) of one cam at each speed, and its cubic regression in rpm."""

    cam: str
    role: LevelOrigin
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
    roles: dict[str, LevelOrigin],
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


#: A cubic through fewer speeds than this would show what nobody measured.
MIN_SPEEDS = 6

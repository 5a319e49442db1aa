"""Cubic regression of sound level over cam speed, and crossings of regressions.

The regressions are those of eq. 20-22 of the paper: level in dB over cam speed in rpm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.schema import PublishedNoise
from cam_rig.simulation.scene import LevelOrigin
from cam_rig.units import FloatArray, rms, to_rpm

#: Degree of the regressions of sound level over cam speed that the paper publishes (eq. 20-22).
REGRESSION_DEGREE = 3
#: Absolute value below which a leading coefficient is treated as zero (rounding), relative to the
#: largest coefficient.
COEFFICIENT_RTOL = 1e-12
#: Largest absolute imaginary part of a root of a polynomial that counts as real.
REAL_ROOT_ATOL = 1e-9
#: Smallest number of speeds for which a figure shows a regression. A cubic through fewer speeds
#: would show features that were not measured.
MIN_SPEEDS = 6


def regression(rpm: FloatArray, level: FloatArray) -> FloatArray:
    """Return the least-squares coefficients c0 to c3 of level (dB) over speed (rpm).

    Parameters
    ----------
    rpm : (n,) array
        Cam speeds, rpm.
    level : (n,) array
        Levels, dB.

    Returns
    -------
    (4,) array
        Coefficients in dB/rpm^k, NaN for fewer than four speeds.
    """
    if rpm.size <= REGRESSION_DEGREE:
        return np.full(REGRESSION_DEGREE + 1, np.nan)
    fit = np.polynomial.Polynomial.fit(rpm, level, REGRESSION_DEGREE)
    coefficients = fit.convert().coef  # without trailing zeros
    return np.pad(coefficients, (0, REGRESSION_DEGREE + 1 - coefficients.size))


def cubic_projection(rpm: FloatArray) -> FloatArray:
    """Return the matrix that converts levels to their cubic regression, (n, n).

    `rpm` contains the n cam speeds. The product of the matrix and the levels at these speeds is the
    regression at the same speeds.
    """
    powers = np.polynomial.polynomial.polyvander(rpm / rpm.mean() - 1.0, REGRESSION_DEGREE)
    return np.asarray(powers @ np.linalg.pinv(powers))


def real_roots(coefficients: FloatArray) -> FloatArray:
    """Return the real roots of the polynomial c0 + c1 x + …, for x of the order of 1.

    Leading coefficients that are rounding are treated as zero.
    """
    tolerance = COEFFICIENT_RTOL * np.abs(coefficients).max()
    trimmed = np.polynomial.polynomial.polytrim(coefficients, tolerance)
    roots = np.polynomial.polynomial.polyroots(trimmed)
    return np.asarray(roots.real[np.abs(roots.imag) < REAL_ROOT_ATOL])


def crossings(
    difference: FloatArray, speeds: tuple[float, float], *, scale: float, shift: float = 0.0
) -> FloatArray:
    """Return the cam speeds (rpm) at which two regressions cross, in rising order.

    Parameters
    ----------
    difference : (4,) array
        Coefficients c0 to c3 of the difference of the regressions, dB over x, with a speed of
        (x + shift)·scale.
    speeds : tuple of float
        Lowest and highest speed of the search, rpm.
    scale : float
        Unit of x, rpm.
    shift : float
        Speed at x = 0, in units of `scale`.
    """
    crossing_rpm = (real_roots(difference) + shift) * scale
    return np.sort(crossing_rpm[(crossing_rpm >= speeds[0]) & (crossing_rpm <= speeds[1])])


def nearest_crossing(
    difference: FloatArray,
    speeds: tuple[float, float],
    near: float,
    *,
    scale: float,
    shift: float = 0.0,
) -> float | None:
    """Return the speed (rpm) nearest to `near` (rpm) at which two regressions cross.

    It is None without a crossing. The other parameters are those of `crossings`.
    """
    inside = crossings(difference, speeds, scale=scale, shift=shift)
    return float(inside[np.argmin(np.abs(inside - near))]) if inside.size else None


@dataclass(frozen=True, eq=False)
class NoiseCurve:
    """Sound level of one cam at each speed of a run, and its cubic regression in rpm."""

    cam: str
    role: LevelOrigin
    rpm: FloatArray  #: ``(n,)``, rising
    level_db: FloatArray  #: ``(n,)``, dB
    coefficients: FloatArray  #: c0 to c3, dB/rpm^k; NaN for fewer than four speeds
    rmse_db: float | None  #: r.m.s. difference to the published regression; None without one


@dataclass(frozen=True, eq=False)
class NoiseResult:
    """Sound levels of a run, compared with published regressions."""

    curves: dict[str, NoiseCurve]  #: by cam
    crossover_rpm: float | None  #: speed of equal levels; None if the regressions do not cross


def compare(
    levels: dict[str, dict[float, float]],
    roles: dict[str, LevelOrigin],
    published: PublishedNoise | None,
) -> NoiseResult:
    """Compare the sound levels of a run with published regressions.

    `levels` are in dB by cam and speed (rad/s). `roles` states for each cam how its level was
    obtained: calibrated, identified or predicted. `published` contains the regressions, or is None.
    The result contains the regressions of all cams, their r.m.s. differences to the published
    regressions, and the crossover of the two published cams.
    """
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
    """Return the r.m.s. difference (dB) of levels to a cam's published regression.

    Only speeds in the range of the regression count. The result is None if no regression of the cam
    is published, or no speed is in the range.
    """
    if published is None or cam not in published.regression_db:
        return None
    low, high = published.range_rpm
    inside = (rpm > low - 1e-6) & (rpm < high + 1e-6)
    if not inside.any():
        return None
    return rms(level[inside] - published.level(cam, rpm[inside]))


def _crossover(curves: dict[str, NoiseCurve], published: PublishedNoise | None) -> float | None:
    """Return the speed (rpm) at which the regressions of the two published cams cross.

    It is the crossing nearest to the published speed, or None if the regressions do not cross.
    """
    if published is None or not set(published.crossover.between) <= set(curves):
        return None
    first, second = (curves[cam] for cam in published.crossover.between)
    difference = first.coefficients - second.coefficients
    if not np.isfinite(difference).all():
        return None
    low, high = max(first.rpm[0], second.rpm[0]), min(first.rpm[-1], second.rpm[-1])
    scaled = difference * high ** np.arange(difference.size)
    return nearest_crossing(scaled, (low, high), published.crossover.rpm, scale=high)

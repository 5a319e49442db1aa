"""Cubic regression of level over speed, as the paper's, and where two of them cross."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray

#: Regressions are cubic, as the paper's.
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
    """Real roots of c0 + c1 x + …, for x of about one.

    A leading number of mere rounding is taken for zero: its own root would drown the others.
    """
    kept = np.polynomial.polynomial.polytrim(coefficients, ROUNDING * np.abs(coefficients).max())
    roots = np.polynomial.polynomial.polyroots(kept)
    return np.asarray(roots.real[np.abs(roots.imag) < ALMOST_REAL])


def crossings(
    difference: FloatArray, speeds: tuple[float, float], *, scale: float, shift: float = 0.0
) -> FloatArray:
    """Speeds (rpm) at which two regressions cross, in their order.

    Parameters
    ----------
    difference : coefficients c0 … c3 in dB of one less the other, over x = rpm/scale − shift
    speeds : lowest and highest speed (rpm) at which both are known
    """
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

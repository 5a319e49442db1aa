"""The scatter of readings, from the readings alone: what no smooth law through them can have.

A polynomial of degree 5 through six neighbours of a reading says what a smooth law would have
there. The divided difference of order 6 of the seven, scaled to a unit sum of squares, is then
noise of the reading's own standard deviation (Gasser, Sroka and Jennen-Steinmetz, *Residual
variance and residual pattern in nonlinear regression*, Biometrika 73, 1986, with lines in place of
polynomials). Differences far beyond their median are left out, so neither a slip moves the scatter
nor the few places where the law's derivatives jump.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray, rms
from cam_rig.errors import LawError
from cam_rig.units import TURN

#: Readings of a divided difference: those of a polynomial of degree 5, and one more.
WINDOW = 7
#: Median of |x| of the standard normal distribution.
NORMAL_MEDIAN = 0.6744897501960817
#: Differences beyond so many standard deviations are of slips, and of jumps of the derivatives;
#: what is left of the standard normal distribution without them has this standard deviation.
TRIMMED, TRIMMED_STANDARD_DEVIATION = 3.0, 0.9865784
#: Standard error of the scatter of n readings, times √n, in parts of it: found by simulation.
STANDARD_ERROR = 1.35
#: A tolerance that lies so many standard errors below the scatter follows the noise, and so does
#: less than this part of it: of few readings the scatter is known so roughly.
SURE, LEAST_PART = 3.0, 0.4
#: A window as wide as this (rad) bridges a stretch without readings.
WIDEST_WINDOW = math.radians(100.0)


def differences(angles: FloatArray, lifts: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """``(n,)`` scaled divided differences (m) about each reading, and which of them count.

    Parameters
    ----------
    angles : ``(n,)`` rad, rising, within one turn
    lifts : ``(n,)`` m

    A window that bridges a stretch without readings, or in which all readings are equal, does not
    count.
    """
    count, half = angles.size, WINDOW // 2
    index = np.arange(count)[:, None] + np.arange(-half, half + 1)
    x = angles[index % count] + TURN * (index // count)
    y = lifts[index % count]
    apart = x[:, :, None] - x[:, None, :] + np.eye(WINDOW)
    with np.errstate(divide="ignore", over="ignore"):
        weights = 1.0 / (apart * 1e2).prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    counts = (x[:, -1] - x[:, 0] < WIDEST_WINDOW) & (np.ptp(y, axis=1) > 0.0)
    return (weights * y).sum(axis=1), counts


def scatter(angles: FloatArray, lifts: FloatArray) -> float:
    """Standard deviation (m) of readings about a smooth law; 0 where it cannot be told.

    Examples
    --------
    >>> import numpy as np
    >>> angles = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    >>> noise = np.random.default_rng(1).normal(scale=2e-6, size=360)  # m
    >>> 1.7e-6 < scatter(angles, 0.005 * (1.0 - np.cos(angles)) + noise) < 2.3e-6
    True
    """
    if angles.size < WINDOW + 1:
        return 0.0
    found, counts = differences(angles, lifts)
    if np.count_nonzero(counts) < WINDOW:
        return 0.0
    sizes = np.abs(found[counts])
    first = float(np.median(sizes)) / NORMAL_MEDIAN
    near = sizes[sizes <= TRIMMED * first]
    return rms(near) / TRIMMED_STANDARD_DEVIATION


def scatter_error(count: int) -> float:
    """Relative standard error of the scatter of so many readings."""
    return STANDARD_ERROR / math.sqrt(count)


def least_tolerance(found: float, count: int) -> float:
    """The tolerance (m) below which a spline follows a scatter (m) of so many readings."""
    return found * max(LEAST_PART, 1.0 - SURE * scatter_error(count))


def require_above_scatter(angles: FloatArray, lifts: FloatArray, tolerance: float) -> None:
    """Refuse a tolerance (m) that would make a law of the readings' noise; 0 is an own wish.

    Raises
    ------
    LawError : it lies below the scatter, by more than chance explains
    """
    if angles[-1] - angles[0] > TURN * (1.0 - 1e-12):
        angles, lifts = angles[:-1], lifts[:-1]
    found = scatter(angles, lifts)
    least = least_tolerance(found, angles.size)
    if 0.0 < tolerance < least:
        raise LawError(
            f"tolerance is {tolerance * 1e3:.3g} mm, the points scatter by {found * 1e3:.3g} mm, "
            "so the spline would follow their noise; allowed: at least "
            f"{least * 1e3:.3g} mm, or 0 to go through every point"
        )

"""Finding the first time a known function turns negative, when it may oscillate fast."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cam_rig.laws.bernstein import FloatArray

#: Grid points a period of the fastest mode.
PER_PERIOD = 24
#: Points looked at together.
WINDOW = 512

Function = Callable[[FloatArray], FloatArray]


def first_negative(
    function: Function, noise: float, end: float, fastest_rate: float, least: int
) -> float | None:
    """The zero in (0, end] after which ``function`` is below −``noise``; None when there is none.

    The function is sampled finer than its fastest mode, window after window. A dip between two
    samples shows as a minimum that bends down towards zero; it is looked at again, 32 times finer.

    Parameters
    ----------
    noise : what rounding may add; a function that only comes this far below zero has no zero
    fastest_rate : rad/s
    least : fewest grid points in all, for the slow part of the function
    """
    count = max(least, int(np.ceil(end * fastest_rate * PER_PERIOD / (2.0 * np.pi))))
    step = float(end / count)
    for first in range(0, count, WINDOW):
        times = step * np.arange(first, min(first + WINDOW, count) + 1, dtype=np.float64)
        found = _in_window(function, noise, times)
        if found is not None:
            return found
    return None


def _in_window(function: Function, noise: float, times: FloatArray) -> float | None:
    values = function(times) + noise
    below = np.flatnonzero((values[1:] < 0.0) & (values[:-1] >= 0.0))
    dips = _dips(values)
    stop = below[0] if below.size else times.size
    for i in dips[dips <= stop]:
        fine = np.linspace(times[i - 1], times[i + 1], 65)
        at = np.flatnonzero(function(fine) + noise < 0.0)
        if at.size and at[0] > 0:
            return _polish(function, noise, float(fine[at[0] - 1]), float(fine[at[0]]))
    if not below.size:
        return None
    return _polish(function, noise, float(times[below[0]]), float(times[below[0] + 1]))


def _dips(values: FloatArray) -> NDArray[np.intp]:
    """Inner points that are minima and could hide a sign change beside them."""
    left, mid, right = values[:-2], values[1:-1], values[2:]
    bend = left - 2.0 * mid + right
    hidden = (mid > 0.0) & (mid <= left) & (mid <= right) & (mid < bend)
    return np.asarray(np.flatnonzero(hidden) + 1)


def _polish(function: Function, noise: float, low: float, high: float) -> float:
    """The zero itself where the function was clearly above it before, else where it left it."""
    shift = 0.0 if float(function(np.array([low]))[0]) > 0.0 else noise

    def scalar(t: float) -> float:
        return float(function(np.array([t]))[0]) + shift

    if scalar(low) <= 0.0:
        return low
    return float(brentq(scalar, low, high, xtol=1e-300, rtol=4 * np.finfo(float).eps))

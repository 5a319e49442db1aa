"""Finding the first time a known function turns negative, when it may oscillate fast."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cam_rig.laws.bernstein import EPS, FloatArray

#: Grid points a period of the fastest mode.
PER_PERIOD = 24
#: Points looked at together, first and at most: most events of a chattering stem are near.
FIRST_WINDOW, WINDOW = 32, 512

#: Shortest time (s) that is told from none.
SHORTEST = 1e-25


class Guard(Protocol):
    """A signed quantity whose fall through zero is an event, at many times (s) or at one."""

    def many(self, times: FloatArray) -> FloatArray:
        """Values at times."""

    def one(self, time: float) -> float:
        """The value at one time, in plain floats."""


def first_negative(
    guard: Guard, noise: float, end: float, fastest_rate: float, least: int
) -> float | None:
    """The zero in (0, end] after which ``guard`` is below −``noise``; None when there is none.

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
    first, size = 0, FIRST_WINDOW
    while first < count:
        last = min(first + size, count)
        # Two points more than are new: a dip may have its lowest point at the seam.
        times = step * np.arange(max(0, first - 1), last + 1, dtype=np.float64)
        found = _in_window(guard, noise, times)
        if found is not None:
            return found
        first, size = last, min(2 * size, WINDOW)
    return None


def _in_window(guard: Guard, noise: float, times: FloatArray) -> float | None:
    values = guard.many(times) + noise
    below = np.flatnonzero((values[1:] < 0.0) & (values[:-1] >= 0.0))
    low = dips(values)
    stop = below[0] if below.size else times.size
    for i in low[low <= stop]:
        fine = np.linspace(times[i - 1], times[i + 1], 65)
        at = np.flatnonzero(guard.many(fine) + noise < 0.0)
        if at.size and at[0] > 0:
            return _polish(guard, noise, float(fine[at[0] - 1]), float(fine[at[0]]))
    if not below.size:
        return None
    if below[0] == 0 and times[0] == 0.0 and values[0] <= 2.0 * noise:
        return _first_cell(guard, noise, float(times[1]))
    return _polish(guard, noise, float(times[below[0]]), float(times[below[0] + 1]))


def _first_cell(guard: Guard, noise: float, end: float) -> float:
    """The zero in (0, end] of a guard that starts from zero and is below it at ``end``.

    A flight shorter than a cell begins with a gap of zero: its landing is sought from where the
    gap shows, going back towards the start by halves.
    """
    times = end * 0.5 ** np.arange(60.0)
    shown = int(np.argmax(guard.many(times) + noise >= 0.0))
    return _polish(guard, noise, float(times[shown]), float(times[shown - 1])) if shown else 0.0


def dips(values: FloatArray) -> NDArray[np.intp]:
    """Inner points that are minima and could hide a sign change beside them."""
    left, mid, right = values[:-2], values[1:-1], values[2:]
    bend = left - 2.0 * mid + right
    hidden = (mid > 0.0) & (mid <= left) & (mid <= right) & (mid < bend)
    return np.asarray(np.flatnonzero(hidden) + 1)


def _polish(guard: Guard, noise: float, low: float, high: float) -> float:
    """The zero itself where the function was clearly above it before, else where it left it."""
    from scipy.optimize import brentq  # a third of a node's imports, which few scenes need

    shift = 0.0 if guard.one(low) > 0.0 else noise

    def shifted(time: float) -> float:
        return guard.one(time) + shift

    if shifted(low) <= 0.0:
        return low
    return float(brentq(shifted, low, high, xtol=SHORTEST, rtol=4 * EPS))

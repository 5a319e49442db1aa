"""A frequency that stands out of a difference: a sensor or its mounting may have it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cam_rig.studies.real_run.pairs import PairedSignal

#: Readings of a part whose spectrum is taken, at most, and parts, at least.
LONGEST, PARTS = 1024, 4
#: A peak so many times the median stands out.
STANDS_OUT = 30.0
#: Frequencies that differ by less than this part are one; speeds by more are several.
SAME, OTHER = 0.05, 0.15
#: Below this order of the cam a difference is the motion's: of mass, spring, damping.
LOWEST_ORDER = 8.0


def peak_frequency(pair: PairedSignal) -> float | None:
    """The frequency (Hz) at which a difference has most power; None where none stands out."""
    from scipy.signal import welch

    step = float(np.median(np.diff(pair.time)))
    even = np.arange(pair.time[0], pair.time[-1], step)
    length = min(LONGEST, even.size // PARTS)
    if length < 32:
        return None
    difference = np.interp(even, pair.time, pair.difference)
    frequency, power = welch(difference, 1.0 / step, nperseg=length)
    peak = 1 + int(np.argmax(power[1:]))
    if power[peak] < STANDS_OUT * float(np.median(power[1:])):
        return None
    return float(frequency[peak])


def common_frequency(speeds: Sequence[float], peaks: Sequence[float | None]) -> float | None:
    """The frequency (Hz) that stands out at several speeds (rpm) alike; None: it moves with them.

    What the cam excites moves with its speed; what rings by itself does not.

    Examples
    --------
    >>> common_frequency([200.0, 300.0, 400.0], [151.0, 149.0, 150.0])
    150.0
    >>> common_frequency([200.0, 300.0, 400.0], [20.0, 30.0, 40.0]) is None
    True
    """
    found = [(speed, peak) for speed, peak in zip(speeds, peaks, strict=True) if peak is not None]
    if len(found) < 2:
        return None
    middle = float(np.median([peak for _, peak in found]))
    alike = [speed for speed, peak in found if abs(peak - middle) <= SAME * middle]
    if len(alike) < 2 or 2 * len(alike) <= len(found) or max(alike) < (1.0 + OTHER) * min(alike):
        return None
    if middle < LOWEST_ORDER * max(alike) / 60.0:
        return None
    return middle

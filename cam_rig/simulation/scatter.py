"""Scatter of readings between turns of the cam."""

from __future__ import annotations

import numpy as np

from cam_rig.units import TURN, FloatArray, rms

#: Largest number of bins into which the readings of a turn are divided to estimate the noise, and
#: over which differences are averaged.
BINS = 180
#: Smallest number of readings per bin of the turn. With fewer readings, the squared median
#: overestimates the noise.
MIN_READINGS = 40
#: Median of |x| of the standard normal distribution. It converts a median to a standard deviation.
MEDIAN = 0.6744897501960817


def scatter(angle: FloatArray, value: FloatArray) -> float:
    """Return the r.m.s. scatter of readings between turns, in the unit of `value`.

    Readings that are neighbours by their angle in the turn are mostly of different turns. Each
    reading is compared with the straight line through its two neighbours. The median of each bin of
    the turn is used, so that a fast change of the signal, such as a landing, affects one bin only.

    Parameters
    ----------
    angle : (n,) array
        Cam angles in rad, in any order.
    value : (n,) array
        Readings at these angles.
    """
    deviations = np.abs(off_neighbours(angle, value))
    if not deviations.size:
        return 0.0
    bins = max(1, min(BINS, deviations.size // MIN_READINGS))
    medians = [float(np.median(part)) for part in np.array_split(deviations, bins)]
    return rms(medians) / MEDIAN


def off_neighbours(angle: FloatArray, value: FloatArray) -> FloatArray:
    """Return the deviation of each reading from the line through its two neighbours.

    Neighbours are those by angle in the turn. The deviations are scaled to the scatter of a single
    reading. The result has shape `(n - 2,)`, or is empty for fewer than three readings.
    """
    angle_in_turn = np.remainder(angle, TURN)
    order = np.argsort(angle_in_turn, kind="stable")
    angles, values = angle_in_turn[order], value[order]
    if values.size < 3:
        return np.empty(0)
    span = angles[2:] - angles[:-2]
    weight = np.divide(angles[2:] - angles[1:-1], span, out=np.full_like(span, 0.5), where=span > 0)
    deviation = values[1:-1] - weight * values[:-2] - (1.0 - weight) * values[2:]
    deviation /= np.sqrt(1.0 + weight**2 + (1.0 - weight) ** 2)
    return np.asarray(deviation)

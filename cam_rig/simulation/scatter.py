"""Scatter of readings from turn to turn."""

from __future__ import annotations

import numpy as np

from cam_rig.units import TURN, FloatArray, rms

#: Parts of a turn in which noise is estimated, and over which differences are averaged.
BINS = 180
#: Readings in a part of a turn from which its noise is estimated, at least: of fewer, the square
#: of the median is too large.
LEAST = 40
#: Median of the absolute value of normal noise, in standard deviations.
MEDIAN = 0.6744897501960817


def scatter(angle: FloatArray, value: FloatArray) -> float:
    """r.m.s. of what differs from turn to turn, of readings at any angles.

    Readings that are neighbours by their angle in the turn are of different turns mostly: each is
    taken less what its two neighbours have there on a straight line. The median of each part of a
    turn counts, so that a departure that moves quickly there (a landing) is no more than its part.
    """
    off = np.abs(off_neighbours(angle, value))
    if not off.size:
        return 0.0
    bins = max(1, min(BINS, off.size // LEAST))
    medians = [float(np.median(part)) for part in np.array_split(off, bins)]
    return rms(medians) / MEDIAN


def off_neighbours(angle: FloatArray, value: FloatArray) -> FloatArray:
    """Each value less that of its neighbours by the angle in the turn, with its scatter."""
    inside = np.remainder(angle, TURN)
    order = np.argsort(inside, kind="stable")
    places, values = inside[order], value[order]
    if values.size < 3:
        return np.empty(0)
    span = places[2:] - places[:-2]
    ahead = np.divide(places[2:] - places[1:-1], span, out=np.full_like(span, 0.5), where=span > 0)
    off = values[1:-1] - ahead * values[:-2] - (1.0 - ahead) * values[2:]
    off /= np.sqrt(1.0 + ahead**2 + (1.0 - ahead) ** 2)
    return np.asarray(off)

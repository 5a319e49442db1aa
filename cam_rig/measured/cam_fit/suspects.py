"""Readings to look at again: outliers that were left out, and those farthest from the law."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cam_rig.measured.cam_fit.dwells import likely_range
from cam_rig.measured.cam_fit.gauge import Readings
from cam_rig.units import FloatArray

#: Residuals of more than so many scatters, or r.m.s. of the others, are named, the farthest so many
#: of them.
FARTHEST, MOST_NAMED = 3.0, 3


def left_out(readings: Readings) -> str:
    """The outliers, or that there are none."""
    named = ", ".join(f"line {one.line} by {one.beside * 1e3:.3g} mm" for one in readings.outliers)
    if not named:
        return "No reading looks like an outlier."
    return f"Left out, for they look like outliers: {named}."


def beside_others(readings: Readings, residuals: FloatArray) -> FloatArray:
    """``(n,)`` sizes of residuals, in r.m.s. of all others."""
    others = (np.sum(residuals**2) - residuals**2) / (residuals.size - 1)
    return np.abs(residuals) / np.maximum(np.sqrt(others), readings.rounding)


def farthest(readings: Readings, residuals: FloatArray, sizes: FloatArray) -> Iterator[str]:
    """The readings that are far from the law, by their lines; ``sizes`` in scatters."""
    likely = max(FARTHEST, 0.5 * likely_range(sizes.size))  # of many, one is so far by chance
    far = [i for i in np.argsort(-sizes)[:MOST_NAMED] if sizes[i] > likely]
    named = ", ".join(
        f"line {readings.lines[i]} ({math.degrees(readings.angles[i]):.6g} deg) by "
        f"{residuals[i] * 1e3:+.3g} mm, {sizes[i]:.2g} times the others' scatter"
        for i in far
    )
    if named:
        yield f"{readings.name}: farthest from the law {named}: look at them again."

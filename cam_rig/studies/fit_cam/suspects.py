"""Readings to check: excluded outliers, and the readings farthest from the law."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cam_rig.studies.fit_cam.dwells import likely_range
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.units import FloatArray

#: Smallest residual that is reported, as a multiple of the scatter or of the r.m.s. of the other
#: residuals. A normal error is as large in one reading of 370.
MIN_REPORTED_SCATTERS = 3.0
#: Largest number of reported residuals.
MAX_REPORTED = 3


def list_outliers(readings: Readings) -> str:
    """Return a sentence that lists the outliers, or states that there are not any."""
    if not readings.outliers:
        return "No reading looks like an outlier."
    listed = (f"line {o.line} by {o.distance * 1e3:.3g} mm" for o in readings.outliers)
    return f"Excluded as outliers: {', '.join(listed)}."


def relative_residuals(readings: Readings, residuals: FloatArray) -> FloatArray:
    """Return the absolute residuals relative to all other residuals, ``(n,)``.

    The unit is the r.m.s. of the others.
    """
    others = (np.sum(residuals**2) - residuals**2) / (residuals.size - 1)
    return np.abs(residuals) / np.maximum(np.sqrt(others), readings.rounding)


def list_farthest(readings: Readings, residuals: FloatArray, sizes: FloatArray) -> Iterator[str]:
    """Yield a sentence that lists the readings farthest from the law, if any are far.

    ``residuals`` is in m. ``sizes`` is the residuals as multiples of the scatter.
    """
    # The second limit is the likely maximum of this number of normal errors.
    limit = max(MIN_REPORTED_SCATTERS, 0.5 * likely_range(sizes.size))
    far = [i for i in np.argsort(-sizes)[:MAX_REPORTED] if sizes[i] > limit]
    listed = ", ".join(
        f"line {readings.lines[i]} ({math.degrees(readings.angles[i]):.6g} deg) by "
        f"{residuals[i] * 1e3:+.3g} mm, {sizes[i]:.2g} times the others' scatter"
        for i in far
    )
    if far:
        yield f"{readings.name}: farthest from the law {listed}: check them."

"""Sentences on suspicious readings: excluded outliers, and readings far from the law."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cam_rig.studies.fit_cam.dwells import likely_range
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.units import FloatArray

#: Smallest residual that is reported, in multiples of the scatter of the readings or of the r.m.s.
#: of the other residuals. Of normally distributed errors, one in 370 is as large.
MIN_REPORTED_SCATTERS = 3.0
#: Largest number of readings that are reported as far from the law.
MAX_REPORTED = 3


def list_outliers(readings: Readings) -> str:
    """Return a sentence that lists the excluded outliers, or reports that none exist."""
    if not readings.outliers:
        return "No reading looks like an outlier."
    listed = (f"line {o.line} by {o.distance * 1e3:.3g} mm" for o in readings.outliers)
    return f"Excluded as outliers: {', '.join(listed)}."


def relative_residuals(readings: Readings, residuals: FloatArray) -> FloatArray:
    """Return each absolute residual divided by the r.m.s. of all others, ``(n,)``.

    The r.m.s. is at least the rounding error of the readings. ``residuals`` is in m.
    """
    others = (np.sum(residuals**2) - residuals**2) / (residuals.size - 1)
    return np.abs(residuals) / np.maximum(np.sqrt(others), readings.rounding)


def list_farthest(readings: Readings, residuals: FloatArray, sizes: FloatArray) -> Iterator[str]:
    """Yield a sentence that lists the readings far from the law, if there are any.

    ``residuals`` (reading minus law) is in m. ``sizes`` is their magnitudes in multiples of the
    scatter. At most `MAX_REPORTED` readings are listed.
    """
    # The second limit is the likely maximum of as many normally distributed errors.
    limit = max(MIN_REPORTED_SCATTERS, 0.5 * likely_range(sizes.size))
    far = [i for i in np.argsort(-sizes)[:MAX_REPORTED] if sizes[i] > limit]
    listed = ", ".join(
        f"line {readings.lines[i]} ({math.degrees(readings.angles[i]):.6g} deg) by "
        f"{residuals[i] * 1e3:+.3g} mm, {sizes[i]:.2g} times the others' scatter"
        for i in far
    )
    if far:
        yield f"{readings.name}: farthest from the law {listed}: check them."

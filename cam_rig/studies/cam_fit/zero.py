"""The gauge's zero: what it shows where the lift is lowest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cam_rig.studies.cam_fit.dwells import find_dwells, likely_range
from cam_rig.studies.cam_fit.readings import Readings, most_outliers, without_outliers


def above_zero(readings: Readings) -> Readings:
    """Readings without outliers, above the lowest dwell, or the lowest reading without one."""
    kept = without_outliers(readings)
    lowest = float(kept.lifts.min())
    dwells = find_dwells(kept, kept.scatter)
    level = min((dwell.rest.level for dwell in dwells), default=lowest)
    at_rest = [dwell for dwell in dwells if dwell.rest.level == level and dwell.count > 1]
    # a few readings far below may be outliers that neighbours at a kink do not tell
    below = np.sort(kept.lifts)[most_outliers(kept.angles.size)]
    near = level - below < likely_range(kept.angles.size) * kept.scatter
    if not near or not at_rest:
        return replace(kept, lifts=kept.lifts - lowest, zero=lowest, zero_error=kept.scatter)
    count = sum(dwell.count for dwell in at_rest)
    squares = sum(dwell.count * dwell.scatter**2 for dwell in at_rest) / (count - 1)
    error = max(math.sqrt(squares), kept.rounding) / math.sqrt(count)
    return replace(kept, lifts=kept.lifts - level, zero=level, zero_error=error)

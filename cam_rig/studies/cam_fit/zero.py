"""The gauge's zero: what it shows where the lift is lowest."""

from __future__ import annotations

from dataclasses import replace

from cam_rig.studies.cam_fit.dwells import find_dwells, likely_range
from cam_rig.studies.cam_fit.readings import Readings, without_outliers


def above_zero(readings: Readings) -> Readings:
    """Readings without outliers, above the lowest dwell, or above the lowest reading without one."""
    kept = without_outliers(readings)
    lowest = float(kept.lifts.min())
    dwells = find_dwells(kept, kept.scatter)
    level = min((dwell.rest.level for dwell in dwells), default=lowest)
    near = level - lowest < likely_range(kept.angles.size) * kept.scatter
    resting = sum(dwell.count for dwell in dwells if dwell.rest.level == level)
    if near and resting:
        return replace(kept, lifts=kept.lifts - level, resting=resting)
    return replace(kept, lifts=kept.lifts - lowest)

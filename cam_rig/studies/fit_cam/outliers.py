"""Outliers: gauge readings that contradict their neighbours, or a fitted law.

They are due to slips of the gauge, or to errors in writing down a reading.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.laws.spline import WINDOW, differences, scatter
from cam_rig.studies.fit_cam.gauge import Outlier, Readings
from cam_rig.studies.fit_cam.gauge_table import widest_gap
from cam_rig.studies.fit_cam.shifted_runs import find_shifted_runs, require_no_slip
from cam_rig.units import TURN, FloatArray, rms

#: Smallest distance of an outlier from its neighbours or from the law, in scatters (standard
#: deviations of a reading). Of normally distributed errors, one in 500 million is as large.
MIN_OUTLIER_SCATTERS = 6.0
#: Smallest ratio of the distance of an outlier to that of the next largest reading. At a kink of
#: the law, several readings have similar distances.
MIN_OUTLIER_RATIO = 2.0
#: Largest number of readings that are excluded as outliers. A larger number has another cause than
#: single wrong readings.
MAX_OUTLIERS = 10
#: Largest fraction of all readings that are excluded as outliers. A larger fraction has another
#: cause than single wrong readings.
MAX_OUTLIER_FRACTION = 0.05
#: Numbers of adjacent readings that may be wrong together as one outlier, tried in this order. The
#: largest is that of a sequence with a common shift.
OUTLIER_WIDTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
#: Smallest number of readings over the turn when only every n-th reading is used to search for
#: outliers of n adjacent readings. They are then at most 3 deg apart, so that the law between them
#: is smooth.
MIN_SUBSET = 120


def max_outliers(count: int) -> int:
    """Return the largest number of outliers allowed among `count` readings."""
    return min(MAX_OUTLIERS, math.ceil(MAX_OUTLIER_FRACTION * count))


# Outliers that contradict their neighbours.


def exclude_outliers(readings: Readings) -> Readings:
    """Return the readings without those that contradict their neighbours.

    The excluded readings are in `outliers` of the result. The tip of a sharp nose is not an
    outlier. Raises ConfigError if the gauge has slipped, or if the other readings have no lift.
    """
    require_no_slip(readings)
    outliers = _mark_outliers(readings)
    good, excluded = np.flatnonzero(~outliers), []
    for i in np.flatnonzero(outliers).tolist():
        index = int(np.searchsorted(good, i))
        if not is_sharp_nose(_split(readings, np.insert(good, index, i)), index):
            excluded.append(i)
    kept = np.setdiff1d(np.arange(readings.angles.size), excluded)
    if excluded and not np.ptp(readings.lifts[kept]) > 0.0:
        lines = ", ".join(str(readings.lines[i]) for i in excluded)
        raise ConfigError(
            f"{readings.name}: all lifts are {readings.lifts[kept[0]] * 1e3:g} mm except those of "
            f"lines {lines}, which look like outliers; allowed: a lift over several readings"
        )
    distances = [_distance_from_neighbours(readings, kept, i) for i in excluded]
    return _split(readings, kept, excluded, distances)


def _mark_outliers(readings: Readings) -> NDArray[np.bool_]:
    """Return a mask of the readings that are outliers.

    Adjacent outliers hide each other. The search for outliers of n adjacent readings therefore uses
    every n-th reading, so that each outlier has good neighbours.
    """
    outliers = find_shifted_runs(readings)
    for width in OUTLIER_WIDTHS:
        if width > 1 and readings.angles.size < MIN_SUBSET * width:
            break
        good = np.flatnonzero(~outliers)
        for first in range(width):
            subset = good[first::width]
            outliers[subset[_isolated_outliers(readings, subset)]] = True
        if width > 1:
            _add_neighbours(readings, outliers, width)
    return outliers


def _add_neighbours(readings: Readings, outliers: NDArray[np.bool_], width: int) -> None:
    """Mark further outliers among the readings next to outliers.

    The mask ``outliers`` is changed in place. A sequence of adjacent outliers has at most `width`
    readings. Each candidate is compared with good readings that are `width` readings apart.
    """
    while outliers.any():
        good = np.flatnonzero(~outliers)
        noise = max(scatter(readings.angles[good], readings.lifts[good]), readings.rounding)
        added = []
        for i in np.flatnonzero(
            (np.roll(outliers, 1) | np.roll(outliers, -1)) & ~outliers
        ).tolist():
            ahead, behind = np.roll(outliers, -i - 1), np.roll(outliers, -i)[::-1]
            run = 1 + int(np.argmin(ahead)) + int(np.argmin(behind))
            if run <= width:
                off = _distance_from_neighbours(readings, good[good != i], i, width)
                if abs(off) > MIN_OUTLIER_SCATTERS * noise:
                    added.append(i)
        if not added:
            return
        outliers[added] = True


def _isolated_outliers(readings: Readings, subset: NDArray[np.int64]) -> list[int]:
    """Return the positions in `subset` of the outliers among its readings.

    `subset` is indices of readings. An outlier is found only if its neighbours in `subset` are good
    readings.
    """
    limit = max_outliers(subset.size)
    kept = np.arange(subset.size)
    angles, lifts = readings.angles[subset], readings.lifts[subset]
    sizes, removed = [], []
    for _ in range(limit + 1):
        values, is_valid = differences(angles[kept], lifts[kept])
        distances = np.where(is_valid, np.abs(values), 0.0)
        worst = int(np.argmax(distances))
        sizes.append(float(distances[worst]))
        removed.append(int(kept[worst]))
        kept = np.delete(kept, worst)
    count = 0
    for k in range(limit):
        others = np.setdiff1d(np.arange(subset.size), removed[: k + 1])
        noise = max(scatter(angles[others], lifts[others]), readings.rounding)
        is_far = sizes[k] > MIN_OUTLIER_SCATTERS * noise
        if (
            is_far
            and sizes[k] > MIN_OUTLIER_RATIO * sizes[k + 1]
            and _are_apart(removed[: k + 1], subset.size)
        ):
            count = k + 1
    return removed[:count]


def _are_apart(indices: list[int], count: int) -> bool:
    """Return True if no two of the readings with these indices are close together.

    The turn has `count` readings. Several outliers close together indicate a law that is not smooth
    instead of wrong readings.
    """
    apart = np.abs(np.subtract.outer(indices, indices))
    apart = np.minimum(apart, count - apart) + count * np.eye(len(indices), dtype=np.int64)
    return bool(apart.min() >= WINDOW // 2)


def is_sharp_nose(readings: Readings, index: int) -> bool:
    """Return True if a reading beyond all others is the tip of a sharp nose.

    The parabola through the three nearest readings on each side is extended to the angle of the
    reading. If the nose is sharper than the distance of the readings, both parabolas reach at least
    its lift. A wrong reading on a round nose is beyond them. The result is False if the reading is
    not the highest or lowest.
    """
    lifts, count = readings.lifts, readings.lifts.size
    others = np.delete(lifts, index)
    if others.min() <= lifts[index] <= others.max():
        return False
    sign = math.copysign(1.0, lifts[index] - others.max())
    sides = (np.arange(side, 4 * side, side) for side in (-1, 1))
    extended = [_interpolate_at(readings, (index + side) % count, index) for side in sides]
    return bool(min(sign * lift for lift in extended) >= sign * lifts[index])


def _distance_from_neighbours(
    readings: Readings, kept: NDArray[np.int64], index: int, stride: int = 1
) -> float:
    """Return the distance (m) of a reading from a polynomial through its neighbours.

    The polynomial goes through three readings of `kept` on either side, `stride` readings apart.
    The distance is signed.
    """
    ahead = (readings.angles[kept] - readings.angles[index] + 0.5 * TURN) % TURN - 0.5 * TURN
    order = np.argsort(ahead)
    middle = int(np.searchsorted(ahead[order], 0.0))
    half = (WINDOW // 2) * stride
    steps = [
        *range(middle - stride, middle - half - 1, -stride),
        *range(middle + stride - 1, middle + half, stride),
    ]
    near = order[np.array(steps) % kept.size]
    return float(readings.lifts[index]) - _interpolate_at(readings, kept[near], index)


def _interpolate_at(readings: Readings, near: NDArray[np.int64], index: int) -> float:
    """Return the lift (m) at the angle of the reading `index` from other readings.

    It is that of the polynomial through the readings with the indices `near`.
    """
    x = (readings.angles[near] - readings.angles[index] + 0.5 * TURN) % TURN - 0.5 * TURN
    lagrange = [np.prod(np.delete(x, i) / (np.delete(x, i) - x[i])) for i in range(x.size)]
    return float(np.dot(lagrange, readings.lifts[near]))


# Outliers that contradict a fitted law.


def exclude_outliers_from(law: Callable[[FloatArray], FloatArray], readings: Readings) -> Readings:
    """Return the readings without those that contradict a law fitted to them.

    All readings are tested again, including previous outliers. `law` returns lifts (m) at angles
    (rad). It may have kinks, because the readings are not compared with their neighbours.
    """
    all_readings = include_outliers(readings)
    distances = all_readings.lifts - law(all_readings.angles)
    farthest = np.argsort(-np.abs(distances), kind="stable")
    count = 0
    for k in range(max_outliers(distances.size)):
        noise = max(rms(distances[farthest[k + 1 :]]), readings.rounding)
        if abs(distances[farthest[k]]) > MIN_OUTLIER_SCATTERS * noise:
            count = k + 1
    excluded = np.sort(farthest[:count])
    return _split(all_readings, np.sort(farthest[count:]), excluded, distances[excluded])


def include_outliers(readings: Readings) -> Readings:
    """Return all readings in order of the angle, including previous outliers."""
    outliers = readings.outliers
    angles = np.append(readings.angles, [outlier.angle for outlier in outliers])
    lifts = np.append(readings.lifts, [outlier.lift - readings.zero for outlier in outliers])
    lines = np.append(readings.lines, np.array([o.line for o in outliers], dtype=np.int64))
    all_readings = replace(readings, angles=angles, lifts=lifts, lines=lines)
    return _split(all_readings, np.argsort(angles))


def _split(
    readings: Readings,
    kept: NDArray[np.int64],
    excluded: Sequence[int] | NDArray[np.int64] = (),
    distances: Sequence[float] | FloatArray = (),
) -> Readings:
    """Return the readings with the indices `kept`, and `excluded` as their outliers.

    `distances` are those (m) of the outliers from their neighbours or the law.
    """
    rows = readings.select(np.asarray(excluded, dtype=np.int64))
    values = (rows.lines, rows.angles, rows.lifts + rows.zero, np.asarray(distances))
    outliers = tuple(map(Outlier, *(value.tolist() for value in values)))
    gap = widest_gap(readings.angles[kept])
    return replace(readings.select(kept), gap=gap, outliers=outliers)

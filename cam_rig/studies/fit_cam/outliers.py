"""Outliers: gauge readings that their neighbours, or a law, contradict."""

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

#: Smallest distance of an outlier from its neighbours, in scatters, and smallest ratio to the
#: distance of the next reading. A kink of the law has several readings at similar distances.
OUTLIER, OUTLIER_ALONE = 6.0, 2.0
#: Largest number of outliers, and largest number as a fraction of the readings. A larger number is
#: not caused by single slips.
MOST_OUTLIERS, MOST_OUTLIERS_PART = 10, 0.05


def most_outliers(count: int) -> int:
    """Return the largest number of outliers among `count` readings."""
    return min(MOST_OUTLIERS, math.ceil(MOST_OUTLIERS_PART * count))


#: Widths of outliers, in readings next to each other, that are searched for one after the other.
OUTLIER_WIDTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
#: A search for a width of n takes every n-th reading: at least this number over the turn, which
#: are 3 deg apart, so that the law between them is smooth.
MIN_SUBSET = 120


def without_outliers(readings: Readings) -> Readings:
    """Return the readings without outliers.

    Outliers are slips of the gauge, or errors in writing down a reading. Outliers next to each
    other hide each other. The search for outliers that are n readings wide therefore takes every
    n-th reading, so that each outlier has good neighbours.
    """
    require_no_slip(readings)
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
    good = np.flatnonzero(~outliers)
    named = []
    for i in np.flatnonzero(outliers).tolist():
        place = int(np.searchsorted(good, i))
        if not is_summit(_leaving(readings, np.insert(good, place, i)), place):
            named.append(i)
    left = np.setdiff1d(np.arange(readings.angles.size), named)
    if named and not np.ptp(readings.lifts[left]) > 0.0:
        lines = ", ".join(str(readings.lines[i]) for i in named)
        raise ConfigError(
            f"{readings.name}: all lifts are {readings.lifts[left[0]] * 1e3:g} mm but those of "
            f"lines {lines}, which look like outliers; allowed: a lift over several readings"
        )
    return _leaving(readings, left, named, [_beside(readings, left, i) for i in named])


def _add_neighbours(readings: Readings, outliers: NDArray[np.bool_], width: int) -> None:
    """Mark readings next to outliers that are outliers too.

    A run of outliers has at most `width` readings. Each reading is compared with good readings
    that are `width` readings apart.
    """
    while outliers.any():
        good = np.flatnonzero(~outliers)
        normal = max(scatter(readings.angles[good], readings.lifts[good]), readings.rounding)
        added = [
            i
            for i in np.flatnonzero((np.roll(outliers, 1) | np.roll(outliers, -1)) & ~outliers)
            if _run_with(outliers, int(i)) <= width
            and abs(_beside(readings, good[good != i], int(i), width)) > OUTLIER * normal
        ]
        if not added:
            return
        outliers[added] = True


def _run_with(outliers: NDArray[np.bool_], index: int) -> int:
    """Return the number of outliers in a row, including the reading `index`."""
    ahead, behind = np.roll(outliers, -index - 1), np.roll(outliers, -index)[::-1]
    return 1 + int(np.argmin(ahead)) + int(np.argmin(behind))


def _isolated_outliers(readings: Readings, subset: NDArray[np.int64]) -> list[int]:
    """Return the positions in `subset` of its outliers.

    Outliers are found only if their neighbours in `subset` are good readings.
    """
    most = most_outliers(subset.size)
    kept = np.arange(subset.size)
    angles, lifts = readings.angles[subset], readings.lifts[subset]
    sizes, taken = [], []
    for _ in range(most + 1):
        found, counts = differences(angles[kept], lifts[kept])
        away = np.where(counts, np.abs(found), 0.0)
        worst = int(np.argmax(away))
        sizes.append(float(away[worst]))
        taken.append(int(kept[worst]))
        kept = np.delete(kept, worst)
    outliers = 0
    for k in range(most):
        rest = np.setdiff1d(np.arange(subset.size), taken[: k + 1])
        normal = max(scatter(angles[rest], lifts[rest]), readings.rounding)
        clear = sizes[k] > OUTLIER * normal and sizes[k] > OUTLIER_ALONE * sizes[k + 1]
        if clear and _scattered(taken[: k + 1], subset.size):
            outliers = k + 1
    return taken[:outliers]


def is_summit(readings: Readings, index: int) -> bool:
    """Return True if a reading beyond all others is the tip of a sharp nose.

    On each side, the parabola through the three nearest readings is extended to the angle of the
    reading. Both reach at least its lift if the nose is sharper than the distance of the readings.
    A slip on a round nose is beyond them. The result is False if the reading is not beyond all
    others.
    """
    lifts, count = readings.lifts, readings.lifts.size
    others = np.delete(lifts, index)
    if others.min() <= lifts[index] <= others.max():
        return False
    up = math.copysign(1.0, lifts[index] - others.max())
    sides = (np.arange(side, 4 * side, side) for side in (-1, 1))
    led = [_through(readings, (index + side) % count, index) for side in sides]
    return bool(min(up * lift for lift in led) >= up * lifts[index])


def with_outliers(readings: Readings) -> Readings:
    """Return all readings, including the outliers."""
    before = readings.outliers
    angles = np.append(readings.angles, [one.angle for one in before])
    lifts = np.append(readings.lifts, [one.lift - readings.zero for one in before])
    lines = np.append(readings.lines, np.array([one.line for one in before], dtype=np.int64))
    whole = replace(readings, angles=angles, lifts=lifts, lines=lines)
    return _leaving(whole, np.argsort(angles))


def judged_by(readings: Readings, law: Callable[[FloatArray], FloatArray]) -> Readings:
    """Return all readings without those that are outliers from a law through them.

    `law` returns lifts (m) at angles (rad). It may have kinks, because the readings are not
    compared with their neighbours.
    """
    whole = with_outliers(readings)
    beside = whole.lifts - law(whole.angles)
    farthest = np.argsort(-np.abs(beside), kind="stable")
    outliers = 0
    for k in range(most_outliers(beside.size)):
        normal = max(rms(beside[farthest[k + 1 :]]), readings.rounding)
        if abs(beside[farthest[k]]) > OUTLIER * normal:
            outliers = k + 1
    named = np.sort(farthest[:outliers])
    return _leaving(whole, np.sort(farthest[outliers:]), named, beside[named])


def _leaving(
    readings: Readings,
    left: NDArray[np.int64],
    named: Sequence[int] | NDArray[np.int64] = (),
    beside: Sequence[float] | FloatArray = (),
) -> Readings:
    """Return the readings `left`, with the readings `named` as their outliers.

    `left` and `named` are indices.

    `beside` are the distances (m) of the outliers from their neighbours or from the law.
    """
    lifts = readings.lifts + readings.zero
    outliers = (
        Outlier(int(readings.lines[i]), float(readings.angles[i]), float(lifts[i]), float(off))
        for i, off in zip(named, beside, strict=True)
    )
    return replace(
        readings,
        angles=readings.angles[left],
        lifts=readings.lifts[left],
        lines=readings.lines[left],
        gap=widest_gap(readings.angles[left]),
        outliers=tuple(outliers),
    )


def _scattered(indices: list[int], count: int) -> bool:
    """Return True if no two readings are close, in a turn of `count` readings.

    Several readings close to each other indicate that the law is not smooth.
    """
    apart = np.abs(np.subtract.outer(indices, indices))
    apart = np.minimum(apart, count - apart) + count * np.eye(len(indices), dtype=np.int64)
    return bool(apart.min() >= WINDOW // 2)


def _beside(readings: Readings, left: NDArray[np.int64], index: int, stride: int = 1) -> float:
    """Return the distance (m) of a reading from a polynomial through neighbours.

    There are three good neighbours on either side, `stride` readings apart.
    """
    ahead = (readings.angles[left] - readings.angles[index] + 0.5 * TURN) % TURN - 0.5 * TURN
    order = np.argsort(ahead)
    place = int(np.searchsorted(ahead[order], 0.0))
    half = (WINDOW // 2) * stride
    steps = [
        *range(place - stride, place - half - 1, -stride),
        *range(place + stride - 1, place + half, stride),
    ]
    near = order[np.array(steps) % left.size]
    return float(readings.lifts[index]) - _through(readings, left[near], index)


def _through(readings: Readings, near: NDArray[np.int64], index: int) -> float:
    """Return the lift (m) of a polynomial at the angle of the reading `index`.

    The polynomial goes through the readings `near`.
    """
    x = (readings.angles[near] - readings.angles[index] + 0.5 * TURN) % TURN - 0.5 * TURN
    lagrange = [np.prod(np.delete(x, i) / (np.delete(x, i) - x[i])) for i in range(x.size)]
    return float(np.dot(lagrange, readings.lifts[near]))

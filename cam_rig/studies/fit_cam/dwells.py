"""Detection of dwells in gauge readings: start, span and level.

A sequence of readings at one level, within the scatter, is longer than the dwell of the law,
because a law leaves its dwell more slowly than a gauge can resolve. Each end of a dwell is
therefore computed from the readings beyond the sequence. They leave the level with the third to the
fifth power of the angle. The end is the mean of all angles at which they can start to leave,
weighted with the likelihood of each. The readings between the ends are a dwell if a parabola fits
them no better than a constant level.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cam_rig.laws.spline import Rest
from cam_rig.schema.segment_base import MAX_DWELLS, MIN_EVENT_DEG
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.studies.fit_cam.outliers import exclude_outliers, max_outliers
from cam_rig.units import TURN, FloatArray

#: Smallest number of successive readings at one level that can be a dwell. Fewer readings can be at
#: one level by chance.
MIN_RUN_READINGS = 5
#: Smallest span (rad) of a dwell, and of the readings at one level from the first to the last. At
#: the top of a harmonic law with a lift of 10 mm, the lift changes by 0.04 mm over this span, far
#: more than the scatter of a gauge.
MIN_DWELL_SPAN = math.radians(15.0)
#: Smallest number of readings between the computed ends of a dwell. It is the number of
#: coefficients of the parabola that is compared with the constant level.
MIN_DWELL_READINGS = 3
#: Largest reduction of the sum of squares by a parabola at which a level counts as constant, in
#: squares of the scatter. It is the 99.9 % quantile of χ² with two degrees of freedom, the
#: reduction by chance.
MAX_TREND = 13.8
#: Largest difference between the lifts of two dwells that are treated as equal, in standard errors
#: of the difference.
SAME_LEVEL_ERRORS = 3.0
#: Fraction of the rise or fall next to a dwell whose readings determine the end of the dwell.
#: Farther from the dwell, the powers of the angle no longer describe the law.
EVENT_FRACTION = 0.35
#: Largest distance (rad) of the end of a dwell from the last reading at its level. A 4-5-6-7 law
#: with a lift of 10 mm over 90 deg leaves a range of 0.4 mm, four scatters of a coarse gauge,
#: within 17 deg.
MAX_END_DISTANCE = math.radians(25.0)
#: Number of cam angles that are tried as the end of a dwell. The end is their mean, weighted with
#: the likelihood.
END_ANGLES = 200
#: Number of decimals of a dwell's start and span in degrees, as in a written cam file.
DEGREE_DECIMALS = 4
#: Smallest distance (rad) between two dwells. If two are closer, the shorter is dropped. The
#: distance is twice the limit of a cam file.
MIN_EVENT_SPAN = math.radians(2.0 * MIN_EVENT_DEG)
#: Powers of the angle with which the lift may change after the end of a dwell: 3, 4 or 5 stands for
#: a jump of the third, fourth or fifth derivative.
LEAVING_POWERS = (3, 4, 5)


@dataclass(frozen=True)
class FoundDwell:
    """Dwell that was detected in gauge readings.

    ``rest`` contains its start and span in rad and its level (lift) in m. ``count`` is the number
    of readings in it, ``scatter`` their standard deviation in m.
    """

    rest: Rest
    count: int
    scatter: float

    def at_level(self, level: float) -> FoundDwell:
        """Return a copy of the dwell with another lift ``level`` (m)."""
        return replace(self, rest=self.rest._replace(level=level))

    def covers(self, start: float, span: float) -> bool:
        """Return True if a range of cam angles is inside the dwell.

        It starts at `start` and extends over `span` (rad).
        """
        return (start - self.rest.start) % TURN + span <= self.rest.span


@dataclass(frozen=True)
class _RestingRun:
    """Sequence of gauge readings at one level, within the scatter.

    The readings have the indices ``first`` to ``first + count − 1``, modulo the number of readings.
    ``level`` is in m.
    """

    first: int
    count: int
    level: float


def find_dwells(readings: Readings, scatter: float) -> tuple[FoundDwell, ...]:
    """Find the dwells of readings, in the order of the cam angle.

    ``scatter`` is the standard deviation of the readings in m.
    """
    runs = _find_runs(readings, scatter)
    candidates = [_fit_dwell(readings, runs, i, scatter) for i in range(len(runs))]
    dwells = [dwell for dwell in candidates if _is_dwell(readings, dwell, scatter)]
    dwells = sorted(_pool_levels(dwells, scatter), key=lambda dwell: dwell.rest.start)
    return _drop_close_dwells(dwells)


def likely_range(count: int) -> float:
    """Return the likely range of `count` readings of one level, in scatters.

    The range is the difference between the highest and the lowest reading, the scatter the standard
    deviation of a reading. The result is 2 √(2 ln 2n), which n normally distributed errors seldom
    exceed.
    """
    return 2.0 * math.sqrt(2.0 * math.log(2.0 * count))


def _find_runs(readings: Readings, scatter: float) -> list[_RestingRun]:
    """Return the sequences of readings at one level, in the order of the cam angle.

    They do not overlap, and there are at most `MAX_DWELLS`. ``scatter`` is the standard deviation
    of a reading, m.
    """
    lifts, count = readings.lifts, readings.lifts.size
    free = np.ones(count, dtype=np.bool_)
    runs: list[_RestingRun] = []
    limit = likely_range(count) * scatter
    while len(runs) < MAX_DWELLS:
        first, length = _widest_run(readings, free, limit)
        index = (first + np.arange(length)) % count
        is_long = length >= MIN_RUN_READINGS or _contains_wide_gap(readings, index)
        if not is_long or _span(readings, index) < MIN_DWELL_SPAN:
            break
        free[index] = False
        runs.append(_RestingRun(first, length, float(np.median(lifts[index]))))
    return sorted(runs, key=lambda run: run.first)


def _widest_run(readings: Readings, free: NDArray[np.bool_], limit: float) -> tuple[int, int]:
    """Return the first index and the number of readings of the widest sequence.

    The sequence spans the largest angle. It contains only readings marked in ``free``, with lifts
    within ``limit`` (m) of each other.
    """
    count = free.size
    lifts = np.tile(readings.lifts, 2)
    angles = np.concatenate([readings.angles, readings.angles + TURN])
    lows: deque[int] = deque()
    highs: deque[int] = deque()
    best, widest, first = (0, 0), -1.0, 0
    for last in range(2 * count):
        if not free[last % count]:
            lows.clear()
            highs.clear()
            first = last + 1
            continue
        while lows and lifts[lows[-1]] >= lifts[last]:
            lows.pop()
        while highs and lifts[highs[-1]] <= lifts[last]:
            highs.pop()
        lows.append(last)
        highs.append(last)
        while lifts[highs[0]] - lifts[lows[0]] > limit or last - first >= count:
            first += 1
            for ends in (lows, highs):
                if ends[0] < first:
                    ends.popleft()
        if angles[last] - angles[first] > widest:
            best, widest = (first % count, last - first + 1), float(angles[last] - angles[first])
    return best


def _span(readings: Readings, index: NDArray[np.int64]) -> float:
    """Return the angle (rad) from the first to the last reading of a sequence."""
    return float(readings.angles[index[-1]] - readings.angles[index[0]]) % TURN


def _contains_wide_gap(readings: Readings, index: NDArray[np.int64]) -> bool:
    """Return True if a sequence of readings contains a gap that can only be a dwell.

    See `Readings.has_wide_gap`. ``index`` are the indices of the sequence.
    """
    start = int(np.argmin(np.abs(readings.angles - readings.gap[0])))
    return readings.has_wide_gap and start in index[:-1]


def _is_dwell(readings: Readings, dwell: FoundDwell, scatter: float) -> bool:
    """Return True if a candidate is a dwell: long enough, and at a constant level.

    The level is constant if a parabola does not fit the readings better. A candidate that covers a
    range without readings is always accepted if this range is too wide for anything but a dwell.
    """
    if readings.has_wide_gap and dwell.covers(*readings.gap):
        return True
    if dwell.count < MIN_DWELL_READINGS or dwell.rest.span < MIN_DWELL_SPAN:
        return False
    ahead = (readings.angles - dwell.rest.start) % TURN
    inside = ahead <= dwell.rest.span
    x, y = ahead[inside], readings.lifts[inside] - np.mean(readings.lifts[inside])
    parabola = np.polynomial.Polynomial.fit(x, y, 2)
    return bool(np.sum(y**2) - np.sum((parabola(x) - y) ** 2) < MAX_TREND * scatter**2)


def _pool_levels(dwells: list[FoundDwell], scatter: float) -> list[FoundDwell]:
    """Return the dwells by increasing lift, with nearly equal lifts averaged.

    The lifts (levels) of two dwells are treated as equal if their difference can be due to chance.
    The mean is weighted with the number of readings. ``scatter`` (m) is the standard deviation of a
    reading.
    """
    groups: list[list[FoundDwell]] = []
    for dwell in sorted(dwells, key=lambda dwell: dwell.rest.level):
        last = groups[-1] if groups else [dwell]
        error = scatter * math.sqrt(1.0 / last[-1].count + 1.0 / dwell.count)
        if groups and dwell.rest.level - last[-1].rest.level <= SAME_LEVEL_ERRORS * error:
            last.append(dwell)
        else:
            groups.append([dwell])
    pooled = []
    for group in groups:
        levels, weights = zip(*((dwell.rest.level, dwell.count) for dwell in group), strict=True)
        level = float(np.average(levels, weights=weights))
        pooled += [dwell.at_level(level) for dwell in group]
    return pooled


def _drop_close_dwells(dwells: list[FoundDwell]) -> tuple[FoundDwell, ...]:
    """Return the dwells without the shorter of any two that are too close together.

    Between dwells closer than `MIN_EVENT_SPAN`, a cam file cannot contain a rise or fall.
    """
    for i, dwell in enumerate(dwells):
        after = dwells[(i + 1) % len(dwells)]
        between = (after.rest.start - dwell.rest.start - dwell.rest.span) % TURN
        # If the next dwell starts inside this one, the angle between them wraps to nearly a turn.
        limit = TURN - dwell.rest.span - after.rest.span + MIN_EVENT_SPAN
        if len(dwells) > 1 and not MIN_EVENT_SPAN < between < limit:
            shorter = min(dwell, after, key=lambda dwell: dwell.rest.span)
            return _drop_close_dwells([dwell for dwell in dwells if dwell is not shorter])
    return tuple(dwells)


def _fit_dwell(readings: Readings, runs: list[_RestingRun], i: int, scatter: float) -> FoundDwell:
    """Return the dwell that belongs to the `i`-th sequence of readings at one level.

    Its ends are computed from the readings beyond the sequence. ``scatter`` is the standard
    deviation of a reading, m.
    """
    run, count = runs[i], readings.angles.size
    before, after = runs[i - 1], runs[(i + 1) % len(runs)]
    to_next = (after.first - run.first - run.count) % count
    to_previous = (run.first - before.first - before.count) % count
    ahead = (run.first + np.arange(run.count + to_next)) % count
    behind = (run.first + run.count - 1 - np.arange(run.count + to_previous)) % count
    first = float(readings.angles[run.first])
    last = first + _span(readings, ahead[: run.count])
    min_end = min_start = 0.0
    # A dwell that covers a wide gap starts before the gap and ends after it.
    if _contains_wide_gap(readings, ahead[: run.count]):
        min_end = (sum(readings.gap) - first) % TURN
        min_start = (last - readings.gap[0]) % TURN
    forwards = (readings.angles[ahead] - first) % TURN
    backwards = (last - readings.angles[behind]) % TURN
    stop = first + _find_end(forwards, readings.lifts[ahead], run, scatter, min_end)
    start = last - _find_end(backwards, readings.lifts[behind], run, scatter, min_start)
    inside = (readings.angles - start) % TURN <= stop - start
    resting = readings.lifts[inside] if inside.any() else np.array([run.level])
    start, span = (
        math.radians(round(math.degrees(x), DEGREE_DECIMALS)) for x in (start, stop - start)
    )
    rest = Rest(start % TURN, span, float(np.mean(resting)))
    return FoundDwell(rest, int(np.count_nonzero(inside)), float(np.std(resting)))


def _find_end(
    x: FloatArray, y: FloatArray, run: _RestingRun, scatter: float, min_end: float
) -> float:
    """Return the angle (rad) at which a dwell ends, at least `min_end`.

    ``x`` is the angles (rad) of the readings at one level and of the rise or fall beyond them,
    measured from the other end of these readings. ``y`` is their lifts (m). ``run`` is the sequence
    of readings at one level, and ``scatter`` the standard deviation of a reading (m).
    """
    last, event = float(x[run.count - 1]), x[run.count :]
    reach = last + EVENT_FRACTION * (float(event[-1]) - last if event.size else 0.0)
    window = x <= reach
    terms = min(len(LEAVING_POWERS), int(np.count_nonzero(window) - run.count) // 3)
    if terms < 1 or event.size == 0:
        return last
    half = 0.5 * last
    window &= x >= half
    # The range includes the first reading beyond the sequence: if the rise is steep, the dwell
    # ends just before this reading.
    ends = np.linspace(max(half, last - MAX_END_DISTANCE, min_end), float(event[0]), END_ANGLES)
    sse = np.array([_leaving_sse(x[window], y[window] - run.level, end, terms) for end in ends])
    likelihood = np.exp(-0.5 * (sse - sse.min()) / scatter**2)
    return float(np.average(ends, weights=likelihood))


def _leaving_sse(x: FloatArray, y: FloatArray, end: float, terms: int) -> float:
    """Return the squared residuals (m²) of readings after an assumed end of a dwell.

    It is the sum for a least-squares fit of powers of the angle beyond `end` (rad). ``x`` is the
    angles (rad), ``y`` the lifts above the level of the dwell (m). ``terms`` is the number of
    powers.
    """
    beyond = np.maximum(x - end, 0.0)
    scale = float(beyond.max())
    powers = np.stack([(beyond / scale) ** power for power in LEAVING_POWERS[:terms]], axis=1)
    coefficients = np.linalg.lstsq(powers, y, rcond=None)[0]
    return float(np.sum((y - powers @ coefficients) ** 2))


# Zero of the gauge: its reading at the lowest lift.


def subtract_zero(readings: Readings) -> Readings:
    """Return the readings without outliers, relative to the gauge's zero.

    The zero is the level of the lowest dwell. It is the lowest reading instead if this dwell has
    fewer than two readings, or if more readings are far below it than outliers can explain.
    """
    kept = exclude_outliers(readings)
    count, lowest = kept.angles.size, float(kept.lifts.min())
    dwells = find_dwells(kept, kept.scatter)
    level = min((dwell.rest.level for dwell in dwells), default=lowest)
    at_rest = [dwell for dwell in dwells if dwell.rest.level == level and dwell.count > 1]
    # A few readings far below the dwell can be outliers that were not detected next to a kink.
    below = np.sort(kept.lifts)[max_outliers(count)]
    if not at_rest or not level - below < likely_range(count) * kept.scatter:
        return replace(kept, lifts=kept.lifts - lowest, zero=lowest, zero_error=kept.scatter)
    resting = sum(dwell.count for dwell in at_rest)
    variance = sum(dwell.count * dwell.scatter**2 for dwell in at_rest) / (resting - 1)
    error = max(math.sqrt(variance), kept.rounding) / math.sqrt(resting)
    return replace(kept, lifts=kept.lifts - level, zero=level, zero_error=error)

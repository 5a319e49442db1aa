"""Detection of dwells in readings: start, span and level.

A run of readings within the scatter of one level is longer than its dwell, because a law leaves its
dwell more slowly than a gauge can resolve. Each end is therefore computed from the readings beyond
the run. They leave the level with the third to the fifth power of the angle. The end is the mean of
all possible angles at which they can start to leave, weighted with their likelihood. The readings
between the ends are a dwell if a parabola fits them no better than a constant level.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cam_rig.laws.spline import Rest
from cam_rig.schema.segment_base import MAX_DWELLS, MIN_EVENT_DEG
from cam_rig.studies.fit_cam.gauge import Readings, bridges
from cam_rig.studies.fit_cam.outliers import most_outliers, without_outliers
from cam_rig.units import TURN, FloatArray

#: Smallest number of readings of a run, and smallest span (rad) of a run and of a dwell. The span
#: of a run is the distance from its first to its last reading.
FEWEST, SHORTEST = 5, math.radians(15.0)
#: Smallest number of readings between the computed ends of a dwell.
FEWEST_INSIDE = 3
#: Largest reduction of the sum of squares by a parabola, in squares of the scatter: the 99.9 %
#: quantile of the reduction by chance, with two degrees of freedom.
TREND = 13.8
#: Largest difference of two levels that are treated as equal, in its standard errors.
SAME_LEVEL = 3.0
#: Part of the event beyond a run whose readings determine the end, as a fraction of the event.
BEYOND = 0.35
#: Largest distance (rad) of the end from the last reading of the run, and number of angles tried.
INSIDE, STEPS = math.radians(25.0), 200
#: Decimals of degrees of a dwell's start and span.
DEGREES = 4
#: Distance (rad) between two dwells at or below which the shorter of them is dropped.
LEAST_ROOM = math.radians(2.0 * MIN_EVENT_DEG)
#: Powers of the angle with which a law leaves its dwell.
POWERS = (3, 4, 5)


@dataclass(frozen=True)
class FoundDwell:
    """Dwell, the number of readings in it, and their standard deviation in m.

    ``rest`` contains the start and span in rad and the level in m.
    """

    rest: Rest
    count: int
    scatter: float

    def at_level(self, level: float) -> FoundDwell:
        """Return this dwell at another level (m)."""
        return replace(self, rest=self.rest._replace(level=level))

    def covers(self, start: float, span: float) -> bool:
        """Return True if the interval from `start` over `span` (rad) is inside the dwell."""
        return (start - self.rest.start) % TURN + span <= self.rest.span


@dataclass(frozen=True)
class _RestingRun:
    """Run of readings ``first`` to ``first + count − 1``, modulo their number.

    They are within the scatter of ``level`` (m).
    """

    first: int
    count: int
    level: float


def find_dwells(readings: Readings, scatter: float) -> tuple[FoundDwell, ...]:
    """Find the dwells of readings, in the order of the cam angle.

    ``scatter`` is the standard deviation of the readings in m.
    """
    runs = _runs(readings, scatter)
    found = [_dwell(readings, runs, i, scatter) for i in range(len(runs))]
    kept = [dwell for dwell in found if _is_dwell(readings, dwell, scatter)]
    return _apart(sorted(_pooled(kept, scatter), key=lambda dwell: dwell.rest.start))


def _apart(dwells: list[FoundDwell]) -> tuple[FoundDwell, ...]:
    """Return the dwells, without the shorter of two that are too close.

    No law has room for an event between them.
    """
    for i, dwell in enumerate(dwells):
        after = dwells[(i + 1) % len(dwells)]
        room = (after.rest.start - dwell.rest.start - dwell.rest.span) % TURN
        most = TURN - dwell.rest.span - after.rest.span + LEAST_ROOM  # above it they overlap
        if len(dwells) > 1 and not LEAST_ROOM < room < most:
            shorter = min(dwell, after, key=lambda one: one.rest.span)
            return _apart([one for one in dwells if one is not shorter])
    return tuple(dwells)


def likely_range(count: int) -> float:
    """Return the likely range of `count` readings of one level, in scatters.

    The range is the difference between the highest and the lowest reading. It is twice √(2 ln 2n),
    which the largest of n normal errors seldom exceeds.
    """
    return 2.0 * math.sqrt(2.0 * math.log(2.0 * count))


def _runs(readings: Readings, scatter: float) -> list[_RestingRun]:
    """Return the runs of readings at one level, in the order of the cam angle.

    The runs do not overlap.
    """
    lifts, count = readings.lifts, readings.lifts.size
    free = np.ones(count, dtype=np.bool_)
    found: list[_RestingRun] = []
    limit = likely_range(count) * scatter
    while len(found) < MAX_DWELLS:
        first, length = _longest(readings, free, limit)
        index = (first + np.arange(length)) % count
        gap = bridges(readings) and _holds_gap(readings, index)
        if (length < FEWEST and not gap) or _span(readings, index) < SHORTEST:
            break
        free[index] = False
        found.append(_RestingRun(first, length, float(np.median(lifts[index]))))
    return sorted(found, key=lambda run: run.first)


def _longest(readings: Readings, free: NDArray[np.bool_], limit: float) -> tuple[int, int]:
    """Return the first reading and the number of readings of the widest run.

    The run contains only readings marked in ``free``, with lifts within ``limit`` (m) of each
    other.
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
    return float(readings.angles[index[-1]] - readings.angles[index[0]]) % TURN


def _holds_gap(readings: Readings, index: NDArray[np.int64]) -> bool:
    """Return True if the gap without readings is inside a run."""
    start = int(np.argmin(np.abs(readings.angles - readings.gap[0])))
    return bool(start in index[:-1])


def _is_dwell(readings: Readings, dwell: FoundDwell, scatter: float) -> bool:
    """Return True if a dwell is long enough and a parabola does not fit it better.

    A dwell that covers the gap is always accepted if the gap is too wide for anything but a dwell.
    """
    ahead = (readings.angles - dwell.rest.start) % TURN
    inside = ahead <= dwell.rest.span
    if bridges(readings) and dwell.covers(*readings.gap):
        return True
    if dwell.count < FEWEST_INSIDE or dwell.rest.span < SHORTEST:
        return False
    x, y = ahead[inside], readings.lifts[inside] - np.mean(readings.lifts[inside])
    bent = np.polynomial.Polynomial.fit(x, y, 2)
    return bool(np.sum(y**2) - np.sum((bent(x) - y) ** 2) < TREND * scatter**2)


def _pooled(dwells: list[FoundDwell], scatter: float) -> list[FoundDwell]:
    """Return the dwells by increasing level, with equal levels pooled.

    Levels are equal if their difference can be due to chance. The common level is their mean,
    weighted with the number of readings.
    """
    groups: list[list[FoundDwell]] = []
    for dwell in sorted(dwells, key=lambda one: one.rest.level):
        last = groups[-1] if groups else [dwell]
        error = scatter * math.sqrt(1.0 / last[-1].count + 1.0 / dwell.count)
        if groups and dwell.rest.level - last[-1].rest.level <= SAME_LEVEL * error:
            last.append(dwell)
        else:
            groups.append([dwell])
    pooled = []
    for group in groups:
        levels, weights = [one.rest.level for one in group], [one.count for one in group]
        pooled += [one.at_level(float(np.average(levels, weights=weights))) for one in group]
    return pooled


def _dwell(readings: Readings, runs: list[_RestingRun], i: int, scatter: float) -> FoundDwell:
    """Return the dwell of run `i`, with ends computed from the readings beyond it."""
    run, count = runs[i], readings.angles.size
    before, after = runs[i - 1], runs[(i + 1) % len(runs)]
    to_next = (after.first - run.first - run.count) % count
    to_last = (run.first - before.first - before.count) % count
    first = float(readings.angles[run.first])
    last = first + _span(readings, (run.first + np.arange(run.count)) % count)
    ahead = (run.first + np.arange(run.count + to_next)) % count
    behind = (run.first + run.count - 1 - np.arange(run.count + to_last)) % count
    open_end = open_start = 0.0
    if bridges(readings) and _holds_gap(readings, ahead[: run.count]):
        # the gap is inside the dwell, so both ends are beyond it
        open_end = (sum(readings.gap) - first) % TURN
        open_start = (last - readings.gap[0]) % TURN
    forwards = (readings.angles[ahead] - first) % TURN
    backwards = (last - readings.angles[behind]) % TURN
    end = _end(forwards, readings.lifts[ahead], run, scatter, open_end)
    start = _end(backwards, readings.lifts[behind], run, scatter, open_start)
    begin, stop = last - start, first + end
    inside = (readings.angles - begin) % TURN <= stop - begin
    resting = readings.lifts[inside] if inside.any() else np.array([run.level])
    rest = Rest(_as_written(begin) % TURN, _as_written(stop - begin), float(np.mean(resting)))
    return FoundDwell(rest, int(np.count_nonzero(inside)), float(np.std(resting)))


def _as_written(angle: float) -> float:
    """Return an angle (rad), rounded to the digits of a cam file."""
    return math.radians(round(math.degrees(angle), DEGREES))


def _end(x: FloatArray, y: FloatArray, run: _RestingRun, scatter: float, least: float) -> float:
    """Return the angle (rad) at which a run ends, at least `least`.

    ``x`` is the angles (rad) of the run and of the event beyond it, from the other end of the run.
    ``y`` is their lifts (m).
    """
    last = run.count - 1
    event = x[last + 1 :]
    reach = float(x[last]) + BEYOND * (float(event[-1] - x[last]) if event.size else 0.0)
    window = x <= reach
    terms = min(len(POWERS), int(np.count_nonzero(window) - run.count) // 3)
    if terms < 1 or event.size == 0:
        return float(x[last])
    half = 0.5 * float(x[last])
    window &= x >= half
    # up to the first reading of the event: if the rise is steep, the end is just before it
    tried = np.linspace(max(half, float(x[last]) - INSIDE, least), float(event[0]), STEPS)
    squares = np.array([_squares(x[window], y[window] - run.level, end, terms) for end in tried])
    likelihood = np.exp(-0.5 * (squares - squares.min()) / scatter**2)
    return float(np.average(tried, weights=likelihood))


def _squares(x: FloatArray, y: FloatArray, end: float, terms: int) -> float:
    """Return the residual sum of squares (m²) of readings that leave a level at `end`.

    ``y`` is the lifts above the level. ``terms`` is the number of powers of the angle beyond `end`.
    """
    beyond = np.maximum(x - end, 0.0)
    scale = float(beyond.max())
    powers = np.stack([(beyond / scale) ** power for power in POWERS[:terms]], axis=1)
    found = np.linalg.lstsq(powers, y, rcond=None)[0]
    return float(np.sum((y - powers @ found) ** 2))


# The gauge's zero: its reading at the lowest lift.


def above_zero(readings: Readings) -> Readings:
    """Return the readings without outliers, relative to the gauge's zero.

    The zero is the level of the lowest dwell. It is the lowest reading if no dwell has two
    readings, or if more readings are far below the lowest dwell than outliers can explain.
    """
    kept = without_outliers(readings)
    lowest = float(kept.lifts.min())
    dwells = find_dwells(kept, kept.scatter)
    level = min((dwell.rest.level for dwell in dwells), default=lowest)
    at_rest = [dwell for dwell in dwells if dwell.rest.level == level and dwell.count > 1]
    # a few readings far below can be outliers that were not detected next to a kink
    below = np.sort(kept.lifts)[most_outliers(kept.angles.size)]
    near = level - below < likely_range(kept.angles.size) * kept.scatter
    if not near or not at_rest:
        return replace(kept, lifts=kept.lifts - lowest, zero=lowest, zero_error=kept.scatter)
    count = sum(dwell.count for dwell in at_rest)
    squares = sum(dwell.count * dwell.scatter**2 for dwell in at_rest) / (count - 1)
    error = max(math.sqrt(squares), kept.rounding) / math.sqrt(count)
    return replace(kept, lifts=kept.lifts - level, zero=level, zero_error=error)


# Readings to check: outliers that were left out, and readings farthest from the law.

#: Smallest reported residual, as a multiple of the scatter or of the r.m.s. of the others, and the
#: largest number of reported residuals.
FARTHEST, MOST_NAMED = 3.0, 3


def left_out(readings: Readings) -> str:
    """Return a sentence that lists the outliers, or states that there are not any."""
    named = ", ".join(f"line {one.line} by {one.beside * 1e3:.3g} mm" for one in readings.outliers)
    if not named:
        return "No reading looks like an outlier."
    return f"Left out, for they look like outliers: {named}."


def beside_others(readings: Readings, residuals: FloatArray) -> FloatArray:
    """Return the sizes of residuals in r.m.s. of all other residuals, ``(n,)``."""
    others = (np.sum(residuals**2) - residuals**2) / (residuals.size - 1)
    return np.abs(residuals) / np.maximum(np.sqrt(others), readings.rounding)


def farthest(readings: Readings, residuals: FloatArray, sizes: FloatArray) -> Iterator[str]:
    """Yield a sentence that lists the readings farthest from the law, if any are far.

    ``residuals`` is in m. ``sizes`` is the residuals as multiples of the scatter.
    """
    likely = max(FARTHEST, 0.5 * likely_range(sizes.size))  # higher for many readings: chance
    far = [i for i in np.argsort(-sizes)[:MOST_NAMED] if sizes[i] > likely]
    named = ", ".join(
        f"line {readings.lines[i]} ({math.degrees(readings.angles[i]):.6g} deg) by "
        f"{residuals[i] * 1e3:+.3g} mm, {sizes[i]:.2g} times the others' scatter"
        for i in far
    )
    if named:
        yield f"{readings.name}: farthest from the law {named}: look at them again."

"""Gauge readings over one turn of a cam, ordered by the cam angle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.laws.spline import scatter, scatter_error
from cam_rig.schema.segment_base import MAX_GAP_DEG, MAX_POINTS, MIN_POINTS
from cam_rig.studies.fit_cam.gauge_table import GaugeColumn, GaugeTable, widest_gap
from cam_rig.studies.fit_cam.half_lobe import nose_of_half_lobe
from cam_rig.units import TURN, FloatArray

#: Largest difference (rad) of two cam angles that count as equal. It is above the rounding of
#: angles that are written in degrees with four decimals.
ANGLE_ATOL = 1e-6
#: Lower limit of the step in which lifts are written, m. It is far below the step of any gauge, and
#: gives exactly calculated lifts a rounding error above zero.
MIN_RESOLUTION = 1e-9
#: Largest plausible reading of a gauge, m. A larger reading is in a different unit than the table's
#: heading states.
MAX_LIFT = 10.0
#: Largest difference between the lifts before and after a range without readings at which the cam
#: is assumed to rest there, as a fraction of the lift. Across a missing rise or fall the difference
#: is far larger.
GAP_LEVEL_RTOL = 0.05
#: Largest difference of repeated readings at one angle, in scatters (standard deviations of a
#: reading). One step of the gauge is added to this limit. Of 10⁸ pairs of readings with normally
#: distributed errors, about two thousand differ by more.
MAX_REPEAT_SCATTERS = 6.0


@dataclass(frozen=True, eq=False)
class Outlier:
    """Reading of the gauge that contradicts its neighbours, or a fitted law.

    Attributes
    ----------
    line
        Line number in the file.
    angle
        Cam angle in rad.
    lift
        Reading of the gauge in m.
    distance
        Distance in m from the lift that follows from the neighbours, or from the law.
    """

    line: int
    angle: float
    lift: float
    distance: float


@dataclass(frozen=True, eq=False)
class Readings:
    """Gauge readings of one follower over one turn of the cam.

    Attributes
    ----------
    name
        File and column of the readings.
    angles
        Cam angles in rad, rising, at least 0, shape ``(n,)``.
    lifts
        Lifts in m, the reading of the gauge minus `zero`, shape ``(n,)``.
    lines
        Line numbers in the file, shape ``(n,)``.
    resolution
        Step in m in which the lifts are written.
    gap
        Start and span (rad) of the longest range without readings.
    notes
        Sentences about the changes that were made to the readings.
    outliers
        Readings that are excluded. Their lifts are those of the gauge, without `zero` subtracted.
    zero, zero_error
        Reading of the gauge in m that was subtracted as zero, and its standard error in m.
    """

    name: str
    angles: FloatArray
    lifts: FloatArray
    lines: NDArray[np.int64]
    resolution: float
    gap: tuple[float, float]
    notes: tuple[str, ...]
    outliers: tuple[Outlier, ...] = ()
    zero: float = 0.0
    zero_error: float = 0.0

    @property
    def rounding(self) -> float:
        """Standard deviation (m) of the rounding to the step in which lifts are written."""
        return max(self.resolution, MIN_RESOLUTION) / math.sqrt(12.0)

    @property
    def scatter(self) -> float:
        """Standard deviation (m) of the readings about a smooth law, at least `rounding`."""
        return max(scatter(self.angles, self.lifts), self.rounding)

    @property
    def scatter_error(self) -> float:
        """Relative standard error of `scatter`, the scatter estimated from the readings."""
        return scatter_error(self.angles.size)

    @property
    def has_wide_gap(self) -> bool:
        """True if the longest range without readings is too wide for anything but a dwell.

        The limit is `MAX_GAP_DEG`.
        """
        return self.gap[1] > math.radians(MAX_GAP_DEG) + ANGLE_ATOL

    def select(self, indices: NDArray[np.int64]) -> Readings:
        """Return only the readings with the given indices.

        The field `gap` is not recomputed. It is that of all readings.
        """
        return replace(
            self,
            angles=self.angles[indices],
            lifts=self.lifts[indices],
            lines=self.lines[indices],
        )


class _Rows(NamedTuple):
    """Readings in the order of a table, before they are put in order of the angle.

    They are angles (rad), lifts (m) and line numbers, ``(n,)`` each.
    """

    angles: FloatArray
    lifts: FloatArray
    lines: NDArray[np.int64]


def order_readings(
    table: GaugeTable, column: GaugeColumn, reverse: bool = False, mirror: bool = False
) -> Readings:
    """Return the readings of one column over one turn, ordered by the angle.

    Readings of the same angle are averaged. `reverse` changes the sign of the angles. `mirror` adds
    the mirror image of half a lobe. Raises ConfigError if the readings are not those of a cam.
    """
    filled = np.isfinite(column.lifts)
    if not filled.any():
        raise ConfigError(f"{table.file}: {column.name} has no number; allowed: readings")
    angles, lifts, lines = (np.array(x)[filled] for x in (table.angles, column.lifts, table.lines))
    rows, notes = _Rows(angles, lifts, lines), list[str]()
    _require_no_end_mark(table.file, rows)
    _require_return(table.file, column.name, rows)
    if not column.is_radius and _rests_at_top(rows):
        if lifts.max() <= LEVEL_RTOL * np.ptp(lifts):
            lifts = -lifts
            notes.append("the lifts are negative, and the cam rests longest near 0: signs changed")
        else:
            notes.append(
                "the cam rests longest at the highest reading: if the gauge counts down, the law "
                "is upside down, so change the signs of the readings"
            )
    if mirror:
        nose = nose_of_half_lobe(table.file, column.resolution, angles, lifts)
        angles = np.append(angles, 2.0 * nose - angles)
        lifts, lines = np.tile(lifts, 2), np.tile(lines, 2)
        notes.append(f"mirrored as requested about the nose at {math.degrees(nose) + 0.0:.6g} deg")
    if np.all(np.diff(angles) < 0.0):
        notes.append("angles fall in the file: put in rising order, lift over angle is the same")
    if reverse:
        angles = -angles
        notes.append("turning sense reversed as requested: the law is that of -angle")
    if angles.min() < 0.0 or angles.max() >= TURN - ANGLE_ATOL:
        low, high = math.degrees(angles.min()), math.degrees(angles.max())
        notes.append(f"angles of {low:.6g} to {high:.6g} deg taken within one turn")
    angles = np.maximum(angles - TURN * np.floor((angles + ANGLE_ATOL) / TURN), 0.0)
    order = np.argsort(angles, kind="stable")
    readings = _average(table, column, _Rows(angles[order], lifts[order], lines[order]))
    if not mirror and readings.angles.size < angles.size:
        notes.append(f"{angles.size - readings.angles.size} repeated angles averaged")
    return replace(readings, notes=tuple(notes))


def gap_note(readings: Readings, arcs: bool) -> tuple[str, ...]:
    """Return a sentence on the lift that is assumed in a range without readings.

    The result is empty if the range is so short that no dwell needs to be assumed. `arcs` is True
    for a fit of tangent arcs.
    """
    if not readings.has_wide_gap:
        return ()
    start, span = (math.degrees(angle) for angle in readings.gap)
    first = int(np.argmin(np.abs(readings.angles - readings.gap[0])))
    before, after = readings.lifts[[first, (first + 1) % readings.angles.size]]
    gap = f"no readings for {span:.6g} deg after {start:.6g} deg"
    noise = MAX_REPEAT_SCATTERS * readings.scatter + readings.resolution
    if abs(before - after) <= max(noise, GAP_LEVEL_RTOL * float(np.ptp(readings.lifts))):
        return (f"{gap}: the cam is assumed to rest there",)
    missing, other = ("fall", "rise") if before > after else ("rise", "fall")
    levels = f"the lift is {before * 1e3:.4g} mm before and {after * 1e3:.4g} mm after"
    assumption = f"no law is assumed there, read the {missing} too"
    if arcs:
        assumption = f"the mirror image of the {other} is assumed, because arcs have equal flanks"
    return (f"{gap}, and {levels}: the {missing} is not in the table; {assumption}",)


# Checks of the readings, before they are put in order of the angle.
#: Smallest distance of an end mark (a last line that is not a reading, such as 999, 999) from the
#: line before it, in median steps of the angle. Five successive lines are seldom missing before the
#: last line.
END_MARK_STEPS = 5.0
#: Smallest distance of the lift of an end mark from the range of the other lifts, as a fraction of
#: that range. A reading at the end of a table is within the range, or close to it.
END_MARK_RANGE = 0.2
#: Tolerance for a lift that only rises or only falls, as a fraction of its range. It limits the
#: changes in the opposite direction, and the difference between the range and the distance of the
#: last lift from the first.
ONE_WAY_RTOL = 0.05


def _require_no_end_mark(file: str, rows: _Rows) -> None:
    """Raise ConfigError if the last line is an end mark, such as 999, 999.

    An end mark is far from the other readings in both angle and lift.
    """
    angles, lifts, lines = rows
    if angles.size < MIN_POINTS:
        return
    steps, others = np.abs(np.diff(angles)), lifts[:-1]
    margin = END_MARK_RANGE * float(np.ptp(others))
    is_outside = not others.min() - margin <= lifts[-1] <= others.max() + margin
    if is_outside and steps[-1] > END_MARK_STEPS * float(np.median(steps)):
        raise ConfigError(
            f"{file}: line {lines[-1]} ({math.degrees(angles[-1]):.6g} deg, "
            f"{lifts[-1] * 1e3:.6g} mm) is far from the others, so it looks like an end mark; "
            "allowed: readings, so put # before it"
        )


def _require_return(file: str, name: str, rows: _Rows) -> None:
    """Raise ConfigError if the lift only rises or only falls over a whole turn.

    The lift of a cam returns to its initial value after one turn. The table of an indexing drive
    does not.
    """
    angles, lifts, lines = (values[np.argsort(rows.angles)] for values in rows)
    lift_range, steps = float(np.ptp(lifts)), np.diff(lifts)
    one_way = min(float(np.sum(steps[steps > 0.0])), -float(np.sum(steps[steps < 0.0])))
    if (
        angles.size > 1
        and angles[-1] - angles[0] > TURN - ANGLE_ATOL
        and abs(lifts[-1] - lifts[0]) > (1.0 - ONE_WAY_RTOL) * lift_range
        and one_way < ONE_WAY_RTOL * lift_range
    ):
        raise ConfigError(
            f"{file}, {name}: the lift goes from {lifts[0] * 1e3:.4g} mm (line {lines[0]}) to "
            f"{lifts[-1] * 1e3:.4g} mm (line {lines[-1]}) over the turn and does not return, as in "
            "the table of an indexing drive; allowed: a lift that is the same after one turn, so "
            "add the return"
        )


#: Largest distance of a reading from the highest or lowest reading at which it counts as being at
#: that level, as a fraction of the range of the readings. It is above the scatter, and so small
#: that the nose of a cam without a dwell has few readings at this level.
LEVEL_RTOL = 0.02
#: Smallest fraction of the turn at the highest level at which the readings are taken to have the
#: wrong sign. The highest level is then the base circle. Few cams rest as long at their nose.
MIN_TOP_PART = 0.25
#: Smallest ratio of the fraction of the turn at the highest level to that at the lowest level,
#: which is also required for the wrong sign. Laws with two dwells have similar fractions.
MIN_TOP_RATIO = 2.0


def _rests_at_top(rows: _Rows) -> bool:
    """Return True if the cam rests for a long part of the turn at the highest reading.

    The limits are `MIN_TOP_PART` and `MIN_TOP_RATIO`. The readings then have the wrong sign.
    """
    order = np.argsort(rows.angles % TURN)
    angles, lifts = rows.angles[order] % TURN, rows.lifts[order]
    ahead = np.diff(angles, append=angles[0] + TURN)
    widths = 0.5 * (ahead + np.roll(ahead, 1)) / TURN
    margin = LEVEL_RTOL * float(np.ptp(lifts))
    top = float(np.sum(widths[lifts >= lifts.max() - margin]))
    bottom = float(np.sum(widths[lifts <= lifts.min() + margin]))
    return top > max(MIN_TOP_PART, MIN_TOP_RATIO * bottom)


# Averages of the readings at equal angles.


def _average(table: GaugeTable, column: GaugeColumn, rows: _Rows) -> Readings:
    """Return the readings with one mean lift per angle.

    ``rows`` are the readings in the order of the angle. Raises ConfigError if there are too few or
    too many angles, if the lifts are constant or implausibly large, or if readings of the same
    angle differ too much.
    """
    angles, lifts, lines = rows
    starts = np.flatnonzero(np.diff(angles, prepend=-1.0) > ANGLE_ATOL)
    counts = np.diff(np.append(starts, angles.size))
    readings = Readings(
        name=f"{table.file}, {column.name}",
        angles=angles[starts],
        lifts=np.add.reduceat(lifts, starts) / counts,
        lines=lines[starts],
        resolution=column.resolution,
        gap=widest_gap(angles[starts]),
        notes=(),
    )
    if not MIN_POINTS <= starts.size <= MAX_POINTS:
        raise ConfigError(
            f"{table.file}: has {starts.size} readings of different angles; allowed: "
            f"{MIN_POINTS} to {MAX_POINTS} over a turn"
        )
    highest = np.abs(readings.lifts).max() * 1e3
    if not np.ptp(readings.lifts) > 0.0:
        raise ConfigError(
            f"{readings.name}: all lifts are {readings.lifts[0] * 1e3:g} mm; allowed: a lift"
        )
    if not highest <= MAX_LIFT * 1e3:
        raise ConfigError(
            f"{readings.name}: the largest lift must be at most {MAX_LIFT * 1e3:g} mm, got "
            f"{highest:g} mm; check the unit of the lifts"
        )
    differences = np.maximum.reduceat(lifts, starts) - np.minimum.reduceat(lifts, starts)
    worst = int(np.argmax(differences))
    # The scatter is that of mean lifts, so that of a single reading is larger.
    single = readings.scatter * math.sqrt(counts[worst])
    limit = MAX_REPEAT_SCATTERS * single + readings.resolution
    if differences[worst] > limit:
        same = lines[starts[worst] : starts[worst] + counts[worst]]
        raise ConfigError(
            f"{readings.name}: lines {', '.join(map(str, same))} are of "
            f"{math.degrees(readings.angles[worst]):g} deg and {differences[worst] * 1e3:.4g} mm "
            f"apart; allowed: {limit * 1e3:.3g} mm. {_cause_of_difference(table, same)}"
        )
    return readings


def _cause_of_difference(table: GaugeTable, lines: NDArray[np.int64]) -> str:
    """Return a sentence on the likely cause of different readings at the same angle.

    The cause is derived from the order of the angles in the table. ``lines`` are the lines of these
    readings.
    """
    covered = max(table.angles) - min(table.angles)
    steps = np.diff(table.angles)
    is_one_way = bool(np.all(steps >= 0.0) or np.all(steps <= 0.0))
    if is_one_way and covered > TURN + ANGLE_ATOL:
        return (
            f"The angles cover {math.degrees(covered):.6g} deg. If they are of the crank, use "
            "--angle crank; if they are several turns of the cam, the readings must repeat"
        )
    if table.lines[-1] in lines and not is_one_way and np.all(steps[:-1] * steps[0] >= 0.0):
        return f"Line {table.lines[-1]} looks like an end mark: put # before it"
    if is_one_way:
        return (
            "The lift does not return to its first level after one turn: the gauge has moved, or "
            "a part of the table is missing"
        )
    broken = _first_out_of_order(table.angles)
    return (
        f"The angle of line {table.lines[broken]}, {math.degrees(table.angles[broken]):.6g} deg, "
        "is out of order: correct it, or leave only one turn in the table. If the cam was turned "
        "both ways, there is backlash: read again, in one turning sense"
    )


def _first_out_of_order(angles: tuple[float, ...]) -> int:
    """Return the index of the first angle that breaks the order of the angles.

    The order is the direction, rising or falling, of most of the steps.
    """
    steps = np.diff(angles)
    sense = 1.0 if np.count_nonzero(steps > 0.0) >= np.count_nonzero(steps < 0.0) else -1.0
    k = int(np.argmax(sense * steps < 0.0))
    is_next = k > 0 and sense * (angles[k + 1] - angles[k - 1]) < 0.0
    return k + 1 if is_next or k == 0 else k

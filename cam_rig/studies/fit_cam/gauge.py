"""Gauge readings of one turn, in rising order of the angle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.laws.spline import scatter, scatter_error
from cam_rig.schema.segment_base import MAX_GAP_DEG, MAX_POINTS, MIN_POINTS
from cam_rig.studies.fit_cam.gauge_table import GaugeColumn, GaugeTable, widest_gap
from cam_rig.units import TURN, FloatArray

#: Largest difference (rad) of angles that count as the same angle.
SAME_ANGLE = 1e-6
#: Smallest plausible step of a gauge, m. A smaller step is replaced by it.
LEAST_RESOLUTION = 1e-9
#: Largest reading of a gauge, m.
MAX_LIFT = 10.0
#: Largest difference of the levels on both sides of a range without readings that count as the same
#: level, as a fraction of the lift.
OPEN = 0.05
#: Largest difference of readings of the same level, in scatters. One step of the gauge is added.
REPEATED = 6.0


@dataclass(frozen=True, eq=False)
class Outlier:
    """A reading that its neighbours, or a law, contradict.

    Attributes
    ----------
    line
        Line of the file.
    angle
        Cam angle in rad.
    lift
        Reading of the gauge in m.
    beside
        Distance in m from the neighbours, or from the law.
    """

    line: int
    angle: float
    lift: float
    beside: float


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of one follower over one turn.

    Attributes
    ----------
    name
        File and column of the readings.
    angles
        Cam angles in rad, rising, at least 0, shape ``(n,)``.
    lifts
        Lifts in m, the reading of the gauge minus `zero`, shape ``(n,)``.
    lines
        Lines of the file, shape ``(n,)``.
    resolution
        Step in m in which the lifts are written.
    gap
        Start and span (rad) of the longest range without readings.
    notes
        Sentences about the changes that were made to the readings.
    outliers
        Readings that are left out. Their lifts are those of the gauge, without `zero` subtracted.
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
        return max(self.resolution, LEAST_RESOLUTION) / math.sqrt(12.0)

    @property
    def scatter(self) -> float:
        """Standard deviation (m) of the readings about a smooth law, at least `rounding`."""
        return max(scatter(self.angles, self.lifts), self.rounding)

    @property
    def scatter_error(self) -> float:
        """Relative standard error of `scatter`."""
        return scatter_error(self.angles.size)


def put_in_order(
    table: GaugeTable, column: GaugeColumn, reverse: bool = False, mirror: bool = False
) -> Readings:
    """Return the readings of one column over one turn, in rising order of the angle.

    Readings of the same angle are averaged.
    `reverse` changes the sign of the angles. `mirror` adds the mirror image of half a lobe.
    """
    read = np.isfinite(column.lifts)
    angles, lifts = np.array(table.angles)[read], np.array(column.lifts)[read]
    lines = np.array(table.lines)[read]
    notes = []
    if not read.any():
        raise ConfigError(f"{table.file}: {column.name} has no number; allowed: readings")
    _require_no_end_mark(table, angles, lifts, lines)
    _require_return(table, column, angles, lifts, lines)
    if mirror:
        centre = _end_of_half_lobe(table, column, angles, lifts)
        angles = np.append(angles, 2.0 * centre - angles)
        lifts, lines = np.tile(lifts, 2), np.tile(lines, 2)
        notes.append(
            f"mirrored as requested about the nose at {math.degrees(centre) + 0.0:.6g} deg"
        )
    if np.all(np.diff(angles) < 0.0):
        notes.append("angles fall in the file: put in rising order, lift over angle is the same")
    if reverse:
        angles = -angles
        notes.append("turning sense reversed as asked: the law is that of -angle")
    if angles.min() < 0.0 or angles.max() >= TURN - SAME_ANGLE:
        low, high = math.degrees(angles.min()), math.degrees(angles.max())
        notes.append(f"angles of {low:.6g} to {high:.6g} deg taken within one turn")
    inside = angles - TURN * np.floor((angles + SAME_ANGLE) / TURN)
    inside = np.maximum(inside, 0.0)
    order = np.argsort(inside, kind="stable")
    found = _averaged(table, column, (inside[order], lifts[order], lines[order]))
    if not mirror and found.angles.size < inside.size:
        notes.append(f"{inside.size - found.angles.size} repeated angles averaged")
    return replace(found, notes=tuple(notes))


#: Limit for a lift that does not return, as a fraction of its range. Its changes in the other sense
#: are smaller, and its last level is that near to the opposite end of the range.
ONE_WAY = 0.05


#: The last line is an end mark if its angle is this number of usual steps from the line before it,
#: and its lift is outside the range of the other lifts by this fraction of that range.
END_MARK_STEPS, END_MARK_RANGE = 5.0, 0.2


def _require_no_end_mark(
    table: GaugeTable, angles: FloatArray, lifts: FloatArray, lines: NDArray[np.int64]
) -> None:
    """Raise ConfigError if the last line is an end mark, such as 999, 999."""
    if angles.size < MIN_POINTS:
        return
    steps, others = np.abs(np.diff(angles)), lifts[:-1]
    room = END_MARK_RANGE * float(np.ptp(others))
    is_outside = not others.min() - room <= lifts[-1] <= others.max() + room
    if is_outside and steps[-1] > END_MARK_STEPS * float(np.median(steps)):
        raise ConfigError(
            f"{table.file}: line {lines[-1]} ({math.degrees(angles[-1]):.6g} deg, "
            f"{lifts[-1] * 1e3:.6g} mm) is far from the others, so it looks like an end mark; "
            "allowed: readings, so put # before it"
        )


def _require_return(
    table: GaugeTable,
    column: GaugeColumn,
    angles: FloatArray,
    lifts: FloatArray,
    lines: NDArray[np.int64],
) -> None:
    """Raise ConfigError if the lift does not return after a whole turn."""
    order = np.argsort(angles)
    turn, height = angles[order], lifts[order]
    height_range = float(np.ptp(lifts))
    steps = np.diff(height)
    one_way = min(float(np.sum(steps[steps > 0.0])), -float(np.sum(steps[steps < 0.0])))
    if (
        turn.size > 1
        and turn[-1] - turn[0] > TURN - SAME_ANGLE
        and abs(height[-1] - height[0]) > (1.0 - ONE_WAY) * height_range
        and one_way < ONE_WAY * height_range
    ):
        raise ConfigError(
            f"{table.file}, {column.name}: the lift goes from {height[0] * 1e3:.4g} mm (line "
            f"{lines[order[0]]}) to {height[-1] * 1e3:.4g} mm (line {lines[order[-1]]}) over the "
            "turn and does not return, as in the table of an indexing drive; allowed: a lift that "
            "is the same after one turn, so add the return"
        )


def _end_of_half_lobe(
    table: GaugeTable, column: GaugeColumn, angles: FloatArray, lifts: FloatArray
) -> float:
    """Return the angle (rad) of the nose of half a lobe.

    Raises ConfigError if the nose is not at the smallest or largest angle of the table.
    """
    nose = float(angles[int(np.argmax(lifts))])
    if nose not in (angles.min(), angles.max()):
        raise ConfigError(
            f"{table.file}: the largest lift is at {math.degrees(nose):.6g} deg, inside the table; "
            "allowed with --mirror: half a lobe, which begins or ends at its nose"
        )
    _require_half_lobe(table, column, np.abs(angles - nose), lifts)
    return nose


#: The slope at the far end of a half lobe is fitted over the first fraction of its angles, with
#: at least 2 readings. The parabola at its nose is fitted over the second fraction of its lift,
#: with at least 3 readings.
END_PART, NOSE_PART = 0.03, 0.02
#: Largest slope at the far end of a half lobe that counts as rest, as a fraction of its steepest
#: slope.
MAX_END_SLOPE = 0.05
#: Largest distance of the vertex of the parabola from the last reading, in steps of the angle.
MAX_STEPS_TO_NOSE = 0.75
#: Standard errors of the slopes that are allowed in addition.
SLOPE_ERRORS = 3.0


def _require_half_lobe(
    table: GaugeTable, column: GaugeColumn, distances: FloatArray, lifts: FloatArray
) -> None:
    """Raise ConfigError if half a lobe lacks its nose or the rest at its far end.

    `distances` are the angles (rad) from the reading with the largest lift.
    """
    x, first = np.unique(distances, return_index=True)
    y = lifts[first]
    if x.size < MIN_POINTS // 2:
        return  # refused later, because of its number of readings
    noise = max(scatter(x, y), column.resolution / math.sqrt(12.0))
    count = max(2, int(np.sum(x >= x[-1] - END_PART * x[-1])))
    slope, error = _end_slope(x[-count:] - x[-1], y[-count:], 1, noise)
    steepest = float(np.max(np.abs((y[count:] - y[:-count]) / (x[count:] - x[:-count]))))
    if abs(slope) > MAX_END_SLOPE * steepest + SLOPE_ERRORS * error:
        raise ConfigError(
            f"{table.file}: the lift still changes by {abs(slope) * 1e3 * math.radians(1.0):.3g} "
            f"mm/deg at the end of the half lobe, {abs(slope) / steepest:.2g} of its steepest "
            "slope; allowed with --mirror: half a lobe from its nose to its base circle"
        )
    count = max(3, int(np.sum(y >= y[0] - NOSE_PART * float(np.ptp(y)))))
    slope, error = _end_slope(x[:count], y[:count], 2, noise)
    bend = 2.0 * abs(float(np.polyfit(x[:count], y[:count], 2)[0]))
    step = float(x[1] - x[0])
    if slope < -bend * MAX_STEPS_TO_NOSE * step - SLOPE_ERRORS * error:
        raise ConfigError(
            f"{table.file}: the lift still rises by {-slope * 1e3 * math.radians(1.0):.3g} mm/deg "
            "at the largest lift, so the nose is not reached; allowed with --mirror: half a lobe "
            "that contains its nose"
        )


def _end_slope(x: FloatArray, y: FloatArray, degree: int, noise: float) -> tuple[float, float]:
    """Return the slope at x = 0 of a fitted polynomial, and its standard error."""
    powers = np.vander(x, degree + 1, increasing=True)
    inverse = np.linalg.pinv(powers)
    return float(inverse[1] @ y), noise * float(np.linalg.norm(inverse[1]))


def _averaged(
    table: GaugeTable, column: GaugeColumn, rows: tuple[FloatArray, FloatArray, NDArray[np.int64]]
) -> Readings:
    angles, lifts, lines = rows
    starts = np.flatnonzero(np.diff(angles, prepend=-1.0) > SAME_ANGLE)
    counts = np.diff(np.append(starts, angles.size))
    means = np.add.reduceat(lifts, starts) / counts
    name, gap = f"{table.file}, {column.name}", widest_gap(angles[starts])
    found = Readings(name, angles[starts], means, lines[starts], column.resolution, gap, ())
    if not MIN_POINTS <= found.angles.size <= MAX_POINTS:
        raise ConfigError(
            f"{table.file}: has {found.angles.size} readings of different angles; allowed: "
            f"{MIN_POINTS} to {MAX_POINTS} over a turn"
        )
    _require_lift(name, means)
    spread = np.maximum.reduceat(lifts, starts) - np.minimum.reduceat(lifts, starts)
    worst = int(np.argmax(spread))
    single = found.scatter * math.sqrt(counts[worst])  # the scatter is that of means
    limit = REPEATED * single + found.resolution
    if spread[worst] > limit:
        same = lines[starts[worst] : starts[worst] + counts[worst]]
        raise ConfigError(
            f"{name}: lines {', '.join(map(str, same))} are of "
            f"{math.degrees(angles[starts][worst]):g} deg and {spread[worst] * 1e3:.4g} mm apart; "
            f"allowed: {limit * 1e3:.3g} mm. {_cause(table, same)}"
        )
    return found


def _require_lift(name: str, lifts: FloatArray) -> None:
    """Raise ConfigError if all lifts (m) are equal, or one is above `MAX_LIFT`."""
    if not np.ptp(lifts) > 0.0:
        raise ConfigError(f"{name}: all lifts are {lifts[0] * 1e3:g} mm; allowed: a lift")
    if not np.abs(lifts).max() <= MAX_LIFT:
        raise ConfigError(
            f"{name}: the largest lift is {np.abs(lifts).max() * 1e3:g} mm; allowed: "
            f"{MAX_LIFT * 1e3:g} mm, so check its unit"
        )


def _cause(table: GaugeTable, lines: NDArray[np.int64]) -> str:
    """Return the likely cause of different readings of the same angle.

    The cause follows from the order of the angles in the table.
    """
    covered = max(table.angles) - min(table.angles)
    steps = np.diff(table.angles)
    forwards = bool(np.all(steps >= 0.0) or np.all(steps <= 0.0))
    if forwards and covered > TURN + SAME_ANGLE:
        return (
            f"The angles cover {math.degrees(covered):.6g} deg. If they are of the crank, use "
            "--angle crank; if they are several turns of the cam, the readings must repeat"
        )
    if table.lines[-1] in lines and not forwards and np.all(steps[:-1] * steps[0] >= 0.0):
        return f"Line {table.lines[-1]} looks like an end mark: put # before it"
    if forwards:
        return (
            "The lift does not return to its first level after one turn: the gauge has moved, or "
            "a part of the table is missing"
        )
    return (
        "The cam was turned both ways, and there is backlash, or the gauge has slipped: read "
        "again, in one turning sense"
    )


def gap_note(readings: Readings, arcs: bool) -> tuple[str, ...]:
    """Return a sentence about the law that is assumed in a range without readings.

    The result is empty if the range is so short that no dwell is needed. `arcs` is True for a fit
    of tangent arcs.
    """
    if not bridges(readings):
        return ()
    start, span = (math.degrees(angle) for angle in readings.gap)
    first = int(np.argmin(np.abs(readings.angles - readings.gap[0])))
    before, after = readings.lifts[[first, (first + 1) % readings.angles.size]]
    where = f"no readings for {span:.6g} deg after {start:.6g} deg"
    least = REPEATED * readings.scatter + readings.resolution
    if abs(before - after) <= max(least, OPEN * float(np.ptp(readings.lifts))):
        return (f"{where}: the cam is assumed to rest there",)
    missing, other = ("fall", "rise") if before > after else ("rise", "fall")
    levels = f"the lift is {before * 1e3:.4g} mm before and {after * 1e3:.4g} mm after"
    assumed = f"assumed is the mirror image of the {other}, for arcs have two equal flanks"
    told = assumed if arcs else f"nothing is assumed of it, read the {missing} too"
    return (f"{where}, where {levels}: the {missing} is not in the table; {told}",)


def bridges(readings: Readings) -> bool:
    """Return True if the longest range without readings can only be a dwell."""
    return readings.gap[1] > math.radians(MAX_GAP_DEG) + SAME_ANGLE

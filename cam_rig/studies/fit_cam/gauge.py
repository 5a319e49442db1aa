"""Readings put in order for a fit: one turn, rising angles, outliers told apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.files import shown
from cam_rig.laws.spline import WINDOW, differences, scatter, scatter_error
from cam_rig.schema.instrument_table import NOTHING, CellTable, Heading, count_numbers, read_lines
from cam_rig.schema.segment_base import FEWEST_POINTS, MAX_POINTS, WIDEST_GAP_DEG
from cam_rig.show.tables import pluralize
from cam_rig.units import TURN, FloatArray, rms

# Tables of gauge readings as they come: any separator, decimal comma, unit, language.

#: Angles without a unit are rad where they go round in so much at most, else deg.
MOST_RAD = 1.02 * TURN


@dataclass(frozen=True)
class GaugeColumn:
    """Readings of one follower: ``lifts``, NaN of an empty cell, and their written step (m)."""

    name: str
    lifts: tuple[float, ...]
    resolution: float


@dataclass(frozen=True)
class GaugeTable:
    """A file of readings: ``lines`` of the file, and ``notes`` on how it was read, in its order."""

    file: str
    angles: tuple[float, ...]
    columns: tuple[GaugeColumn, ...]
    lines: tuple[int, ...]
    notes: tuple[str, ...]

    def only_column(self) -> GaugeColumn:
        """The column of lifts, where there is one."""
        if len(self.columns) > 1:
            names = ", ".join(repr(column.name) for column in self.columns)
            raise ConfigError(
                f"{self.file}: has {len(self.columns)} columns of lifts; allowed: one, so name it "
                f"with --column ({names}), or take all with --shape arcs"
            )
        return self.columns[0]


def read_gauge_table(path: Path, column: str | None = None) -> GaugeTable:
    """Read a table of a gauge, a spreadsheet or by hand; only ``column`` of lifts, all if None."""
    return _GaugeReader(path.name, read_lines(path, "cam angle and lift")).table(column)


class _GaugeReader(CellTable):
    """A file of readings; `table` makes numbers of its cells."""

    def table(self, column: str | None) -> GaugeTable:
        """Headings to columns, cells to numbers."""
        if self.first is None:
            line, cells = self.rows[-1]
            raise self.refused(
                f"line {line}: {shown(' | '.join(cells))} has no two numbers; allowed: lines of "
                "cam angle and lift"
            )
        width = len(self.rows[self.first][1])
        headings = self.headings(width)
        angle, lifts, notes = self._assigned(headings, column)
        used = [angle, *lifts]
        body = [
            (line, cells)
            for line, cells in self.rows[self.first :]
            if max(used) >= len(cells) or any(cells[i] for i in used)  # another width is an error
        ]
        texts = [self.numbers(line, cells, headings, used) for line, cells in body]
        for (line, _), row in zip(body, texts, strict=True):
            if row[angle] == NOTHING:
                raise self.refused(
                    f"line {line}: {headings[angle].text} is empty beside a lift; allowed: an "
                    "angle, or # before the line"
                )
        angles = [float(row[angle]) for row in texts]
        factor, words = _angle_factor(headings[angle], angles)
        columns = [self._column(headings[i], [row[i] for row in texts]) for i in lifts]
        unnamed = [headings[i].text for i in lifts if headings[i].factor is None]
        if unnamed:
            words += [f"no unit of length in {', '.join(map(repr, unnamed))}: mm assumed"]
        for i in lifts:
            empty = sum(row[i] == NOTHING for row in texts)
            if empty:
                words.append(
                    f"{pluralize(empty, 'empty cell')} in {headings[i].text!r}: no reading"
                )
        notes = [self.how_read(body, used), *notes, *words]
        lines, turned = tuple(line for line, _ in body), tuple(factor * value for value in angles)
        return GaugeTable(self.file, turned, tuple(columns), lines, tuple(notes))

    def _assigned(
        self, headings: list[Heading], column: str | None
    ) -> tuple[int, list[int], list[str]]:
        angles = [i for i, one in enumerate(headings) if one.kind == "angle"]
        lifts = [i for i, one in enumerate(headings) if one.kind == "lift"]
        others = [i for i, one in enumerate(headings) if one.kind == "other"]
        notes = []
        if len(angles) > 1:
            raise self._unclear(headings, f"{len(angles)} of them are angles; allowed: one")
        if not angles and others[:1] == [0]:
            angles, others = [0], others[1:]
            notes.append(f"no heading of an angle: {headings[0].text!r} assumed to be it")
        if column is not None:
            allowed = [i for i in (*lifts, *others) if i not in angles]
            lifts = [i for i in allowed if headings[i].text == column]
            if not lifts:
                names = ", ".join(repr(headings[i].text) for i in allowed)
                raise ConfigError(f"{self.file}: has no column {column!r}; allowed: {names}")
        if not lifts and angles:
            lifts = [i for i in others if count_numbers([self.rows[self.first or 0][1][i]])]
            names = ", ".join(repr(headings[i].text) for i in lifts)
            notes.append(f"no heading of a lift: {names} assumed to be it")
        if not angles or not lifts:
            raise self._unclear(headings, "allowed: one of an angle and at least one of a lift")
        return angles[0], lifts, notes

    def _unclear(self, headings: list[Heading], words: str) -> ConfigError:
        found = shown(", ".join(one.text for one in headings))
        return self.refused(f"columns are {found}, {words}, such as angle_deg and lift_mm")

    def _column(self, one: Heading, texts: list[str]) -> GaugeColumn:
        factor = 1e-3 if one.factor is None else one.factor
        decimals = max(len(text.partition(".")[2]) if "e" not in text else 9 for text in texts)
        lifts = tuple(factor * float(text) for text in texts)
        return GaugeColumn(one.text, lifts, factor * 10.0**-decimals)


def _angle_factor(one: Heading, angles: list[float]) -> tuple[float, list[str]]:
    if one.factor is not None:
        return one.factor, []
    around = max(angles) - min(angles)
    unit, factor = ("rad", 1.0) if around <= MOST_RAD else ("deg", TURN / 360.0)
    return factor, [f"no unit of angle in {one.text!r}: {unit} assumed"]


#: Readings of one angle (rad) are nearer than this.
SAME_ANGLE = 1e-6
#: A gauge that shows less than this (m) is none.
LEAST_RESOLUTION = 1e-9
#: Levels on both sides of a stretch without readings are one within this part of the lift.
OPEN = 0.05
#: They differ by no more than so many scatters and steps of the gauge.
REPEATED = 6.0
#: An outlier is so many scatters from what its neighbours say, and so many times farther than any
#: reading that is none: the few places where the law itself is not smooth come in numbers.
OUTLIER, OUTLIER_ALONE = 6.0, 2.0
#: Slips, at most: of all readings, and in parts of them. More is another kind of error.
MOST_OUTLIERS, MOST_OUTLIERS_PART = 10, 0.05


@dataclass(frozen=True, eq=False)
class Outlier:
    """A reading that its neighbours, or a law, contradict: ``beside`` (m) is how far it is off."""

    line: int
    angle: float
    lift: float
    beside: float


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of one follower over one turn, ``(n,)`` each.

    ``angles``: rad, rising, from 0 on; ``lifts``: m, above the gauge's own zero; ``lines``: of the
    file; ``resolution``: the step in which lifts are written, m; ``gap``: start and span (rad) of
    the longest stretch without readings; ``notes``: what was done to them, a sentence each;
    ``outliers``: those left out, above the gauge's own zero; ``zero``, ``zero_error``: what was
    subtracted as zero, and its standard error, m.
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
        """Standard deviation (m) of the readings about a smooth law, their rounding at least."""
        return max(scatter(self.angles, self.lifts), self.rounding)

    @property
    def scatter_error(self) -> float:
        """Its relative standard error."""
        return scatter_error(self.angles.size)


def put_in_order(table: GaugeTable, column: GaugeColumn, reverse: bool = False) -> Readings:
    """Readings of one column over one turn, those of one angle averaged; ``reverse`` turns θ."""
    read = np.isfinite(column.lifts)
    angles, lifts = np.array(table.angles)[read], np.array(column.lifts)[read]
    notes = []
    if not read.any():
        raise ConfigError(f"{table.file}: {column.name} has no number; allowed: readings")
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
    found = _averaged(
        table, column, (inside[order], lifts[order], np.array(table.lines)[read][order])
    )
    if found.angles.size < inside.size:
        notes.append(f"{inside.size - found.angles.size} repeated angles averaged")
    return replace(found, notes=tuple(notes))


def _averaged(
    table: GaugeTable, column: GaugeColumn, rows: tuple[FloatArray, FloatArray, NDArray[np.int64]]
) -> Readings:
    angles, lifts, lines = rows
    starts = np.flatnonzero(np.diff(angles, prepend=-1.0) > SAME_ANGLE)
    counts = np.diff(np.append(starts, angles.size))
    means = np.add.reduceat(lifts, starts) / counts
    name, gap = f"{table.file}, {column.name}", _widest_gap(angles[starts])
    found = Readings(name, angles[starts], means, lines[starts], column.resolution, gap, ())
    if not FEWEST_POINTS <= found.angles.size <= MAX_POINTS:
        raise ConfigError(
            f"{table.file}: has {found.angles.size} readings of different angles; allowed: "
            f"{FEWEST_POINTS} to {MAX_POINTS} over a turn"
        )
    if not np.ptp(means) > 0.0:
        raise ConfigError(f"{name}: all lifts are {means[0] * 1e3:g} mm; allowed: a lift")
    spread = np.maximum.reduceat(lifts, starts) - np.minimum.reduceat(lifts, starts)
    worst = int(np.argmax(spread))
    single = found.scatter * math.sqrt(counts[worst])  # the scatter is that of means
    limit = REPEATED * single + found.resolution
    if spread[worst] > limit:
        same = lines[starts[worst] : starts[worst] + counts[worst]]
        raise ConfigError(
            f"{name}: lines {', '.join(map(str, same))} are both of "
            f"{math.degrees(angles[starts][worst]):g} deg and {spread[worst] * 1e3:.4g} mm apart; "
            f"allowed: {limit * 1e3:.3g} mm. The gauge has slipped, or there is backlash: read "
            "again, in one turning sense"
        )
    return found


def _widest_gap(angles: FloatArray) -> tuple[float, float]:
    """Start and span (rad) of the longest stretch without readings."""
    ahead = np.diff(angles, append=angles[0] + TURN)
    widest = int(np.argmax(ahead))
    return float(angles[widest]), float(ahead[widest])


def most_outliers(count: int) -> int:
    """How many of so many readings may be outliers."""
    return min(MOST_OUTLIERS, math.ceil(MOST_OUTLIERS_PART * count))


def without_outliers(readings: Readings) -> Readings:
    """The readings without those that look like outliers of the gauge or of the pen."""
    most = most_outliers(readings.angles.size)
    kept = np.arange(readings.angles.size)
    sizes, taken = [], []
    for _ in range(most + 1):
        found, counts = differences(readings.angles[kept], readings.lifts[kept])
        away = np.where(counts, np.abs(found), 0.0)
        worst = int(np.argmax(away))
        sizes.append(float(away[worst]))
        taken.append(int(kept[worst]))
        kept = np.delete(kept, worst)
    outliers = 0
    for k in range(most):
        rest = np.setdiff1d(np.arange(readings.angles.size), taken[: k + 1])
        normal = max(scatter(readings.angles[rest], readings.lifts[rest]), readings.rounding)
        clear = sizes[k] > OUTLIER * normal and sizes[k] > OUTLIER_ALONE * sizes[k + 1]
        if clear and _scattered(taken[: k + 1], readings.angles.size):
            outliers = k + 1
    named = sorted(i for i in taken[:outliers] if not is_summit(readings, i))
    left = np.setdiff1d(np.arange(readings.angles.size), named)
    return _leaving(readings, left, named, [_beside(readings, left, i) for i in named])


def is_summit(readings: Readings, index: int) -> bool:
    """Whether a reading beyond all others is where three on either side of it lead at least.

    So is the tip of a nose that is sharper than the readings stand apart, and no slip on a round
    one: a parabola through those on one side ends below it.
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
    """All readings, the outliers among them."""
    before = readings.outliers
    angles = np.append(readings.angles, [one.angle for one in before])
    lifts = np.append(readings.lifts, [one.lift - readings.zero for one in before])
    lines = np.append(readings.lines, np.array([one.line for one in before], dtype=np.int64))
    whole = replace(readings, angles=angles, lifts=lifts, lines=lines)
    return _leaving(whole, np.argsort(angles))


def judged_by(readings: Readings, law: Callable[[FloatArray], FloatArray]) -> Readings:
    """All readings, without those that look like outliers beside a law through them.

    The law (m) of angles (rad) may bend and kink as it likes: no neighbour is asked.
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
    """The readings that are left, the others named with how far they are off (m)."""
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
        gap=_widest_gap(readings.angles[left]),
        outliers=tuple(outliers),
    )


def _scattered(indices: list[int], count: int) -> bool:
    """Whether no two readings are neighbours: several in a row are where the law is not smooth."""
    apart = np.abs(np.subtract.outer(indices, indices))
    apart = np.minimum(apart, count - apart) + count * np.eye(len(indices), dtype=np.int64)
    return bool(apart.min() >= WINDOW // 2)


def _beside(readings: Readings, left: NDArray[np.int64], index: int) -> float:
    """How far (m) a reading is from the polynomial through three good neighbours on either side."""
    ahead = (readings.angles[left] - readings.angles[index] + 0.5 * TURN) % TURN - 0.5 * TURN
    half = WINDOW // 2
    order = np.argsort(ahead)
    place = int(np.searchsorted(ahead[order], 0.0))
    near = order[np.arange(place - half, place + half) % left.size]
    return float(readings.lifts[index]) - _through(readings, left[near], index)


def _through(readings: Readings, near: NDArray[np.int64], index: int) -> float:
    """The lift (m) at a reading's angle of the polynomial through others."""
    x = (readings.angles[near] - readings.angles[index] + 0.5 * TURN) % TURN - 0.5 * TURN
    lagrange = [np.prod(np.delete(x, i) / (np.delete(x, i) - x[i])) for i in range(x.size)]
    return float(np.dot(lagrange, readings.lifts[near]))


def gap_note(readings: Readings, arcs: bool) -> tuple[str, ...]:
    """What is assumed where the readings leave out a stretch: a sentence, or none."""
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
    """Whether the readings leave out a stretch that only a dwell can fill."""
    return readings.gap[1] > math.radians(WIDEST_GAP_DEG) + SAME_ANGLE

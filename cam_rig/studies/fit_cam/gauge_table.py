"""Reader of tables of gauge readings: columns, units, and the shaft of the angles."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.files import shorten
from cam_rig.schema.headings import Heading, parse_heading
from cam_rig.schema.instrument_table import NOTHING, CellTable, count_numbers, read_lines
from cam_rig.show.tables import pluralize
from cam_rig.units import TURN, FloatArray

Shaft = Literal["cam", "crank"]
#: Longest range without readings (rad) at which a column without a heading for angles is accepted
#: as cam angles in degrees. Line numbers, such as 1 to 120, leave a longer range.
MAX_GAP_OF_ASSUMED_ANGLES = 0.25 * TURN
#: Pattern of a radius or diameter of the base circle or the roller, stated in a line before the
#: readings. The words are in several languages.
STATED_LENGTH = re.compile(
    r"(?P<part>base|grundkreis|primitiv\w*|roller|rollen?|galet|rodillo|rullo)[\s_-]*"
    r"(?:circle|kreis)?[\s_-]*"
    r"(?P<length>radius|radio|rayon|raggio|halbmesser|diameter|diam|dia|durchmesser|diámetro|"
    r"diametro|diamètre|ø)(?![^\W\d])(?:\W*[(\[](?P<bracket>[a-z\"]+)[)\]])?[^\w-]*"
    r"(?P<number>\d+(?:[.,]\d+)?)\s*(?P<unit>[a-zµμ\"]*)",
    re.I,
)
#: Beginnings of words that mean the roller in a match of `STATED_LENGTH`. Other words mean the base
#: circle.
ROLLER_WORDS = ("roll", "galet", "rodillo", "rullo")
#: Beginnings of words that mean a diameter in a match of `STATED_LENGTH`. Other words mean a
#: radius.
DIAMETER_WORDS = ("dia", "diá", "durch", "ø")


@dataclass(frozen=True)
class TableOptions:
    """Options for reading a table of gauge readings.

    Parameters
    ----------
    column, angle_column
        Headings of the columns of lifts and of angles, None to recognise them by their words.
    shaft
        Shaft whose angle the table contains, None to recognise it by the heading. The crankshaft
        turns twice as fast as the cam.
    counts
        Counts of an encoder per turn of that shaft, None if angles are not counts.
    """

    column: str | None = None
    angle_column: str | None = None
    shaft: Shaft | None = None
    counts: float | None = None


@dataclass(frozen=True)
class GaugeColumn:
    """Column of gauge readings of one follower.

    `lifts` are in m, NaN for an empty cell. `resolution` is the step in m in which they are
    written. `is_radius` is True if the numbers are distances from the axis of the cam, not lifts.
    `name` is the heading.
    """

    name: str
    lifts: tuple[float, ...]
    resolution: float
    is_radius: bool = False


@dataclass(frozen=True)
class GaugeTable:
    """Contents of a file of gauge readings: cam angles in rad, and columns of lifts.

    `lines` are the line numbers in the file, one per angle. `notes` are sentences on the
    interpretation of the file. `stated` contains the lengths in m that the file states under "base
    radius" and "roller radius", each with a sentence on its source.
    """

    file: str
    angles: tuple[float, ...]
    columns: tuple[GaugeColumn, ...]
    lines: tuple[int, ...]
    notes: tuple[str, ...]
    stated: Mapping[str, tuple[float, str]] = field(default_factory=dict)


def read_gauge_table(path: Path, options: TableOptions | None = None) -> GaugeTable:
    """Read a file of gauge readings, written by a gauge, a spreadsheet or by hand.

    Raises ConfigError if the file cannot be interpreted. ``options`` override the interpretation of
    its headings.
    """
    lines, comments = read_lines(path, "cam angle and lift")
    return _GaugeReader(path.name, lines).table(options or TableOptions(), comments)


class _GaugeReader(CellTable):
    """Reader of one file of gauge readings, which converts its cells to numbers."""

    def table(self, options: TableOptions, comments: list[tuple[int, str]]) -> GaugeTable:
        """Return the gauge table of the file, with columns identified by their headings.

        ``comments`` are the line numbers and texts of comment lines, which may state radii.
        """
        if self.first is None:
            line, cells = max(self.rows[1:] or self.rows, key=lambda row: _count_digits(row[1]))
            only = ", of numbers only: units belong in the heading" if _count_digits(cells) else ""
            raise self.error(
                f"line {line}: {shorten(' | '.join(cells))} has no two numbers; allowed: lines of "
                f"cam angle and lift{only}"
            )
        headings = self.headings(len(self.rows[self.first][1]))
        angle, lifts, notes = self._assign(headings, options)
        used = [angle, *lifts]
        is_assumed = headings[angle].quantity == "other"
        self.require_clear(headings, lifts if is_assumed else used)
        self.require_no_minutes(headings, angle)
        body, skipped = self._body(used)
        self._require_one_heading(headings, used)
        texts = [self.numbers(line, cells, headings, used) for line, cells in body]
        for (line, _), row in zip(body, texts, strict=True):
            if row[angle] == NOTHING:
                raise self.error(
                    f"line {line}: {headings[angle].text} is empty next to a lift; allowed: an "
                    "angle, or # before the line"
                )
        angles = [float(row[angle]) for row in texts]
        factor, unit_notes = self._angle_factor(headings[angle], angles, options)
        if is_assumed and options.counts is None:
            self._require_turn(headings[angle], factor, angles)
        columns = [self._column(headings[i], [row[i] for row in texts]) for i in lifts]
        notes = [self.describe_format(body, used), *notes, *unit_notes]
        notes += _notes_on_lifts([headings[i] for i in lifts], columns)
        stated, ignored = self._lengths_in_comments(comments, headings[lifts[0]])
        return GaugeTable(
            file=self.file,
            angles=tuple(factor * value for value in angles),
            columns=tuple(columns),
            lines=tuple(line for line, _ in body),
            notes=(*notes, *skipped, *ignored),
            stated=stated,
        )

    def _body(self, used: list[int]) -> tuple[list[tuple[int, list[str]]], list[str]]:
        """Return the lines of readings, and a note on skipped lines of text.

        The skipped lines are those without a number between or after the readings. ``used`` are the
        indices of the columns that are read.
        """
        rows = self.rows[self.first :]
        text = [line for line, cells in rows if any(cells) and not count_numbers(cells)]
        body = [
            (line, cells)
            for line, cells in rows
            if line not in text and (max(used) >= len(cells) or any(cells[i] for i in used))
        ]
        if not text:
            return body, []
        first = shorten(" ".join(dict(rows)[text[0]]))
        more = f" and {len(text) - 1} more" if len(text) > 1 else ""
        return body, [f"line {text[0]}{more} without a number skipped: {first}"]

    def _require_one_heading(self, headings: list[Heading], used: list[int]) -> None:
        """Raise ConfigError for a second heading line with another unit or quantity.

        ``used`` are the indices of the columns that are read.
        """
        for line, cells in self.rows[self.first :]:
            if len(cells) != len(headings) or count_numbers(cells):
                continue
            for i in used:
                other, first = parse_heading(cells[i]), headings[i]
                is_unit = other.factor is not None and not other.unclear
                if is_unit and (other.quantity, other.factor) != (first.quantity, first.factor):
                    raise self.error(
                        f"line {line}: a second heading with another unit or quantity, "
                        f"{shorten(cells[i])} below {shorten(first.text)}; allowed: one table in "
                        "a file, so put the other into its own file"
                    )

    def _assign(
        self, headings: list[Heading], options: TableOptions
    ) -> tuple[int, list[int], list[str]]:
        """Return the index of the angle column, those of the lift columns, and notes.

        The notes report which columns were assumed without a clear heading.
        """
        columns = defaultdict[str, list[int]](list)
        for i, heading in enumerate(headings):
            columns[heading.quantity].append(i)
        lifts = columns["lift"] + columns["radius"]
        if options.angle_column is None and columns["x"] and columns["y"] and not lifts:
            raise self.error(
                f"columns are {_list_texts(headings)}: points of a contour, not lifts; allowed: "
                "an angle and a lift, or cam-rig profile CAM --from for a contour"
            )
        angle = self._angle_index(headings, columns, options)
        others, notes = [i for i in columns["other"] if i != angle], list[str]()
        if angle is None and columns["other"][:1] == [0]:
            angle, others = 0, others[1:]
            notes.append(f"no heading of an angle: {headings[0].text!r} assumed to be it")
        lifts = lifts or columns["y"] or columns["z"]
        if options.column is not None:
            lifts = self._column_indices(headings, options.column, [*lifts, *others])
        if not lifts and angle is not None:
            lifts = [i for i in others if count_numbers([self.rows[self.first or 0][1][i]])]
            names = ", ".join(repr(headings[i].text) for i in lifts)
            notes.append(f"no heading of a lift: {names} assumed to be it")
        lifts = [i for i in lifts if i != angle]
        if angle is None or not lifts:
            raise self.error(
                f"columns are {_list_texts(headings)}, allowed: one of an angle and at least one "
                "of a lift, such as angle_deg and lift_mm"
            )
        return angle, lifts, notes

    def _angle_index(
        self, headings: list[Heading], columns: Mapping[str, list[int]], options: TableOptions
    ) -> int | None:
        """Return the index of the angle column by option or heading, or None.

        ``columns`` are the indices of the columns by the quantity of their heading. Raises
        ConfigError for several angle columns.
        """
        angles = columns["angle"] + (columns["count"] if options.counts else [])
        if options.angle_column is not None:
            angles = self._column_indices(headings, options.angle_column, range(len(headings)))
        if not angles and columns["count"]:
            text = headings[columns["count"][0]].text
            raise self.error(
                f"{shorten(text)} has encoder counts; allowed: --counts, their number per turn"
            )
        if len(angles) > 1:
            raise self.error(
                f"columns are {_list_texts(headings)}, {len(angles)} of them are angles; allowed: "
                "one, such as angle_deg, so name it with --angle-column"
            )
        return angles[0] if angles else None

    def _column_indices(
        self, headings: list[Heading], name: str, allowed: Sequence[int]
    ) -> list[int]:
        """Return the indices of the columns with the heading `name`, at least one index.

        Only the indices ``allowed`` are considered. Raises ConfigError if there is no such column.
        """
        indices = [i for i in allowed if headings[i].text == name]
        if not indices:
            names = ", ".join(repr(headings[i].text) for i in allowed)
            raise ConfigError(f"{self.file}: has no column {name!r}; allowed: {names}")
        return indices

    def _column(self, heading: Heading, texts: list[str]) -> GaugeColumn:
        """Return a column of lifts in m from the texts of its cells.

        A heading without a unit is taken as mm.
        """
        factor = 1e-3 if heading.factor is None else heading.factor
        decimals = max(len(text.partition(".")[2]) if "e" not in text else 9 for text in texts)
        lifts = tuple(factor * float(text) for text in texts)
        is_radius = heading.quantity == "radius"
        return GaugeColumn(heading.text, lifts, factor * 10.0**-decimals, is_radius)

    def _angle_factor(
        self, heading: Heading, angles: list[float], options: TableOptions
    ) -> tuple[float, list[str]]:
        """Return the factor from the angle column to the cam angle in rad, and notes.

        The notes report the assumed unit, and whether the angle is that of the crankshaft.
        ``heading`` is that of the column, ``angles`` are its numbers, and ``options`` override the
        heading.
        """
        notes, factor = [], heading.factor
        if options.counts is not None:
            if heading.factor is not None:
                raise self.error(
                    f"{shorten(heading.text)} has a unit; allowed with --counts: a column of counts"
                )
            factor = TURN / options.counts
        elif factor is None:
            factor, unit = self.guess_angle_unit(heading, angles)
            notes.append(f"no unit of angle in {heading.text!r}: {unit} assumed")
        if options.shaft == "cam" and heading.is_crank:
            notes.append(f"{heading.text!r} taken as the angle of the cam, as requested")
        elif options.shaft == "crank" or heading.is_crank:
            factor *= 0.5
            notes.append(
                f"{heading.text!r} is the angle of the crank, which turns twice as fast as the "
                "cam: halved (--angle cam takes it as it is)"
            )
        elif options.shaft is None and max(angles) * factor > TURN > np.ptp(angles) * factor:
            notes.append(
                f"{heading.text!r} goes to {math.degrees(max(angles) * factor):.6g}° but not over "
                "a whole turn: taken as the angle of the cam (--angle crank halves it)"
            )
        return factor, notes

    def _require_turn(self, heading: Heading, factor: float, angles: list[float]) -> None:
        """Raise ConfigError if assumed cam angles leave too wide a gap in the turn.

        They are assumed if the heading of the column does not name an angle. The gap may be at most
        `MAX_GAP_OF_ASSUMED_ANGLES` (rad).
        """
        gap = widest_gap(np.unique(factor * np.array(angles) % TURN))[1]
        if gap > MAX_GAP_OF_ASSUMED_ANGLES:
            raise self.error(
                f"{shorten(heading.text)} is not named an angle, and goes from {min(angles):g} to "
                f"{max(angles):g}, which as deg would leave {math.degrees(gap):.4g} deg without "
                "readings; allowed: a heading such as angle_deg, or --counts if it counts steps"
            )

    def _lengths_in_comments(
        self, comments: list[tuple[int, str]], lift: Heading
    ) -> tuple[dict[str, tuple[float, str]], list[str]]:
        """Return the radii (m) that lines before the readings state, and notes.

        The radii are "base radius" and "roller radius", each with a sentence on its source. The
        notes report ignored statements. A radius without a unit is in the unit of the lifts.
        """
        title = [(line, " ".join(cells)) for line, cells in self.rows[: self.first]]
        stated, ignored = dict[str, tuple[float, str]](), list[str]()
        for line, text in sorted([*title, *comments]):
            for match in STATED_LENGTH.finditer(text):
                part = "roller" if match["part"].lower().startswith(ROLLER_WORDS) else "base"
                unit, note = match["unit"] or match["bracket"] or "", f"stated in line {line}"
                factor = parse_heading(f"radius [{unit}]").factor
                if factor is None and unit:
                    ignored.append(f"line {line} not used: {unit!r} is no unit of length")
                    continue
                if factor is None:
                    factor = 1e-3 if lift.factor is None else lift.factor
                    note += " without a unit: that of the lifts assumed"
                half = 0.5 if match["length"].lower().startswith(DIAMETER_WORDS) else 1.0
                radius = half * factor * float(match["number"].replace(",", "."))
                name = f"{part} radius"
                stated.setdefault(name, (radius, f"{name} {radius * 1e3:.6g} mm, {note}"))
        return stated, ignored


def widest_gap(angles: FloatArray) -> tuple[float, float]:
    """Return start and span (rad) of the longest range of the turn without readings.

    `angles` (rad) are in rising order, within one turn.
    """
    ahead = np.diff(angles, append=angles[0] + TURN)
    widest = int(np.argmax(ahead))
    return float(angles[widest]), float(ahead[widest])


def _count_digits(cells: list[str]) -> int:
    """Return the number of cells that start with a digit."""
    return sum(re.match(r"[-+−.,]?\d", cell) is not None for cell in cells)


def _list_texts(headings: list[Heading]) -> str:
    """Return the headings as one text for an error message."""
    return shorten(", ".join(heading.text for heading in headings))


def _notes_on_lifts(headings: list[Heading], columns: list[GaugeColumn]) -> Iterator[str]:
    """Yield notes on assumed units and on empty cells in the columns of lifts."""
    without_unit = [repr(heading.text) for heading in headings if heading.factor is None]
    if without_unit:
        yield f"no unit of length in {', '.join(without_unit)}: mm assumed"
    for column in columns:
        empty = sum(map(math.isnan, column.lifts))
        if empty:
            yield f"{pluralize(empty, 'empty cell')} in {column.name!r}: no reading"

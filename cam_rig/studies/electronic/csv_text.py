"""Cams of controllers as CSV: tables of points, and segments normalised by VDI 2143."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.files import shorten
from cam_rig.studies.electronic.building import DIGITS
from cam_rig.studies.electronic.controller import (
    DEFAULT_NAME,
    MAX_NUMBER,
    TURN_DEG,
    Boundary,
    ControllerCam,
    ControllerSegment,
    SegmentKind,
)
from cam_rig.studies.electronic.tables import MAX_INTERVALS, MIN_INTERVALS, PointTable
from cam_rig.units import TURN

#: Number of coefficients of a segment, c₀ to c₆: the largest degree of the form is 6.
COEFFICIENTS = 7
#: Heading of the columns of segments by VDI 2143.
SEGMENT_HEADING = ",".join(
    ["master_start_deg", "master_end_deg", "slave_start_mm", "stroke_mm"]
    + [f"c{k}" for k in range(COEFFICIENTS)]
)
#: Number of decimals of written increments. Increments of a controller are whole.
INCREMENT_DECIMALS = 6
#: Key of the line with the name of the cam.
NAME_KEY = "cam"
#: Key of the line with the number of rows.
COUNT_KEY = "points"
#: Keys of the line with the number of increments per mm of the slave.
INCREMENT_KEYS = ("increments_per_mm", "increments per mm", "inc/mm")
#: Keys of the line with the length of a turn of the master.
PERIOD_KEYS = ("master_period", "period", "modulo")
#: Length of a turn in the units of master positions that are recognised by their range.
PERIODS = (TURN_DEG, 1.0, TURN)
#: Turns of a master in increments that are recognised without the key `PERIOD_KEYS`: 360 times a
#: power of ten, and powers of two. Another multiple of 360 may be a table without its last point.
INCREMENT_PERIODS: tuple[float, ...] = (
    *(360.0 * 10.0**k for k in range(1, 8)),
    *(2.0**k for k in range(10, 33)),
)
#: Largest relative difference of a range of master positions from one turn.
PERIOD_RTOL = 1e-6
#: Largest difference of the ends of the slave, as a fraction of its range, that the digits of an
#: exported table explain. The last point is then moved, with a note if it is above `CLOSED_RTOL`.
CLOSING_RTOL = 1e-3
#: Largest difference that is not worth a note.
CLOSED_RTOL = 1e-9
#: Smallest difference, as a fraction of the range, of an index table, which does not return.
INDEX_FRACTION = 0.1
#: Pattern of a line with a key and its value.
KEY_LINE = re.compile(r"\s*([A-Za-z][\w /]*?)\s*[=:]\s*(\S.*?)\s*[;,]?\s*")
#: First characters of comment lines.
COMMENT_STARTS = ("#", "//", "(*", "%", "'", "!")


def number(value: float) -> str:
    """Return a number as it is written, with `DIGITS` digits."""
    return f"{value + 0.0:.{DIGITS}g}"


def _head(name: str, notes: tuple[str, ...]) -> list[str]:
    plain = ("".join(c if c.isprintable() else " " for c in note) for note in notes)
    return [*(f"# {note}" for note in plain), f"{NAME_KEY} = {name}"]


def write_segments(cam: ControllerCam) -> str:
    """Return the CSV text of segments with coefficients."""
    lines = [*_head(cam.name, cam.notes), SEGMENT_HEADING]
    for segment in cam.segments:
        stroke, *powers = segment.coefficients
        powers += [0.0] * (COEFFICIENTS - len(powers))
        cells = (segment.left.x, segment.right.x, segment.left.y, stroke, *powers)
        lines.append(",".join(map(number, cells)))
    return "\n".join(lines) + "\n"


def write_table(table: PointTable) -> str:
    """Return the CSV text of a table of points."""
    head, y = _head(table.name, table.notes), table.y
    if table.increments is not None:
        head.append(f"{INCREMENT_KEYS[0]} = {number(table.increments)}")
        y = np.round(y * table.increments, INCREMENT_DECIMALS)
    rows = [f"{number(a)};{number(b)}" for a, b in zip(table.x, y, strict=True)]
    heading = "master_deg;" + ("slave_mm" if table.increments is None else "slave_increments")
    return "\n".join([*head, f"{COUNT_KEY} = {len(rows)}", heading, *rows]) + "\n"


class NumberLines:
    """Lines of a file of numbers: comments, keys and rows of numbers with their line numbers.

    Attributes
    ----------
    file : str
        Name of the file, for messages.
    notes : tuple of str
        Comment lines that start with ``#``.
    keys : dict of str to (int, str)
        Line and value of the lines ``key = value``, by key in small letters.
    count : tuple of (int, int) or None
        Line and value of a line with a single whole number before the rows.
    rows : list of (int, list of float)
        Line number and numbers of each row.
    separator : str
        Separator of the columns.
    has_decimal_point : bool
        True if a number of a row has a decimal point.
    """

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self.keys: dict[str, tuple[int, str]] = {}
        self.count: tuple[int, int] | None = None
        self.rows: list[tuple[int, list[float]]] = []
        notes: list[str] = []
        self.separator, self.has_decimal_point = "", False
        for line, raw in enumerate(text.splitlines(), 1):
            content = raw.strip().removesuffix(";")
            if not content:
                continue
            if content.startswith(COMMENT_STARTS):
                notes += [content[2:]] if content.startswith("# ") else []
            elif match := KEY_LINE.fullmatch(content):
                self.keys[match[1].lower()] = line, match[2]
                if match[1].lower() == COUNT_KEY and match[2].isdigit():
                    self.count = line, int(match[2])
            elif not self.rows and content.isdigit():
                self.count = line, int(content)
            elif self.rows or re.match(r"[-+.,\d]", content):
                self.separator = self.separator or _separator(content)
                self.has_decimal_point |= "." in content
                self.rows.append((line, self._numbers(line, content, self.separator)))
        self.notes = tuple(notes)
        if not self.rows:
            raise ConfigError(f"{file}: line 1: no row of numbers; allowed: master and slave")
        if self.count is not None and self.count[1] != len(self.rows):
            raise self.error(
                self.count[0], f"{self.count[1]} points are announced, {len(self.rows)} follow"
            )

    @property
    def name(self) -> str:
        """Name of the cam in the file."""
        return self.keys.get(NAME_KEY, (0, DEFAULT_NAME))[1]

    def error(self, line: int, problem: str) -> ConfigError:
        """Return the error of a problem in a line."""
        return ConfigError(f"{self.file}: line {line}: {problem}")

    def _numbers(self, line: int, content: str, separator: str) -> list[float]:
        cells = content.split(None if separator == " " else separator)
        numbers = []
        for cell in cells:
            plain = cell.strip() if separator == "," else cell.strip().replace(",", ".")
            try:
                numbers.append(float(plain))
            except ValueError:
                numbers.append(math.nan)
            if not abs(numbers[-1]) <= MAX_NUMBER:
                raise self.error(
                    line, f"{shorten(cell.strip())} is not a number up to {MAX_NUMBER:g}"
                )
        if self.rows and len(numbers) != len(self.rows[0][1]):
            raise self.error(
                line,
                f"has {len(numbers)} numbers, the row before {len(self.rows[0][1])}; "
                "separate columns by a semicolon if numbers have a decimal comma",
            )
        return numbers

    def value(self, keys: tuple[str, ...]) -> float | None:
        """Return the value of the first of some keys as a positive number, or None."""
        for key in keys:
            if key in self.keys:
                line, text = self.keys[key]
                try:
                    value = float(text.replace(",", ".").split()[0])
                except ValueError:
                    value = math.nan
                if not 1.0 / MAX_NUMBER <= value <= MAX_NUMBER:
                    raise self.error(line, f"{key} is {shorten(text)}; allowed: a positive number")
                return value
        return None


def _separator(content: str) -> str:
    """Return the separator of a row: a semicolon, a tab, spaces or a comma."""
    for separator in (";", "\t"):
        if separator in content:
            return separator
    return " " if len(content.split()) > 1 and not re.search(r",\s", content) else ","


def read_segments(file: str, text: str) -> ControllerCam:
    """Return the cam of a CSV text of segments with coefficients.

    Raises
    ------
    ConfigError
        If the text has another form, or a number is wrong.
    """
    if SEGMENT_HEADING.split(",")[0] not in text:
        raise ConfigError(
            f"{file}: line 1: no heading {SEGMENT_HEADING[:33]},…; allowed: a text for vdi2143"
        )
    lines = NumberLines(file, text)
    segments: list[ControllerSegment] = []
    for line, row in lines.rows:
        if len(row) != COEFFICIENTS + 4:
            raise lines.error(line, f"has {len(row)} numbers; allowed: {COEFFICIENTS + 4}")
        start, end, y, *coefficients = row
        before = segments[-1].right.x if segments else start
        if not (end > start == before):
            raise lines.error(
                line,
                f"is from {start:g}° to {end:g}° after {before:g}°; allowed: rising, without a gap",
            )
        right = y + coefficients[0] * sum(coefficients[1:])
        ends = Boundary(start, y), Boundary(end, right)
        segments.append(ControllerSegment(SegmentKind.COEFFICIENTS, *ends, tuple(coefficients)))
    return ControllerCam(lines.name, tuple(segments), lines.notes)


def read_table(file: str, text: str) -> PointTable:
    """Return a table of points as a controller exports it.

    Master positions may be degrees, rad, turns from 0 to 1, or increments with 3600, 36000, … or
    1024, 2048, … per turn. The key ``master_period`` declares another turn. Slave positions are mm,
    or increments if a line contains their number per mm. A table whose slave does not return is an
    index table. It is followed by its mirror image, so that one turn of the result is two turns of
    the master.

    Raises
    ------
    ConfigError
        If a row is wrong, the master does not rise, or its last point is missing.
    """
    lines = NumberLines(file, text)
    columns = len(lines.rows[0][1])
    if columns < 2 or not MIN_INTERVALS < len(lines.rows) <= MAX_INTERVALS + 1:
        raise lines.error(
            lines.rows[0][0],
            f"has {len(lines.rows)} rows of {columns} numbers; allowed: "
            f"{MIN_INTERVALS + 1} to {MAX_INTERVALS + 1} rows of master and slave",
        )
    for (_, before), (line, after) in pairwise(lines.rows):
        if not after[0] > before[0]:
            raise lines.error(
                line, f"the master is at {after[0]:g} after {before[0]:g}; allowed: rising"
            )
    _require_master_and_slave(lines)
    x, y = np.array([row[:2] for _, row in lines.rows]).T
    x *= TURN_DEG / _period(lines, float(x[-1] - x[0]))
    x[-1] = x[0] + TURN_DEG
    increments = lines.value(INCREMENT_KEYS)
    y /= increments or 1.0
    notes, name = lines.notes, lines.name
    gap, extent = abs(float(y[-1] - y[0])), float(np.ptp(y))
    if CLOSING_RTOL * extent < gap < INDEX_FRACTION * extent:
        raise lines.error(
            lines.rows[-1][0],
            f"the slave ends {gap:.6g} from its start; allowed: up to {CLOSING_RTOL * extent:.3g}, "
            f"or an index table that ends at least {INDEX_FRACTION * extent:.3g} from it",
        )
    if CLOSED_RTOL * extent < gap <= CLOSING_RTOL * extent:
        notes += (f"the last point was moved by {gap:.3g} to close the turn",)
    if gap >= INDEX_FRACTION * extent > 0.0:
        x = np.concatenate([0.5 * (x - x[0]), TURN_DEG - 0.5 * (x - x[0])[-2::-1]])
        y = np.concatenate([y, y[-2::-1]])
        notes += ("index table, followed by its mirror image: run it at half the master's speed",)
    y[-1] = y[0]
    return PointTable(name, x, y, notes, increments)


def _require_master_and_slave(lines: NumberLines) -> None:
    """Raise ConfigError if the first two of several columns may not be master and slave.

    Case 1: numbers with a decimal comma between commas, such as ``3,6,0,020``. Case 2: a first
    column that counts the rows.
    """
    line, first = lines.rows[0]
    if len(first) < 3:
        return
    if lines.separator == "," and not lines.has_decimal_point:
        raise lines.error(
            line,
            f"has {len(first)} whole numbers between commas; separate the columns by a semicolon "
            "if numbers have a decimal comma",
        )
    counts = [row[0] for _, row in lines.rows]
    if counts in ([*range(len(counts))], [*range(1, len(counts) + 1)]):
        raise lines.error(
            line, "the first column counts the rows; allowed: master and slave in the first two"
        )


def _period(lines: NumberLines, span: float) -> float:
    """Return the length of a turn in the unit of the master positions, which cover ``span``."""
    declared: float | None = lines.value(PERIOD_KEYS)
    periods: tuple[float, ...] = PERIODS if declared is None else (declared,)
    recognised: tuple[float, ...] = INCREMENT_PERIODS if declared is None else ()
    for period in (*periods, *recognised):
        if abs(span - period) <= PERIOD_RTOL * period:
            return period
    allowed = ", ".join(f"{period:g}" for period in periods)
    line, (last, *_) = lines.rows[-1]
    raise lines.error(
        line,
        f"the last master position is {last:g}, {span:g} after the first; allowed: one turn "
        f"({allowed}, or 3600, 36000, … or 1024, 2048, … increments) with the closing point, or a "
        f"line such as {PERIOD_KEYS[0]} = 360000",
    )

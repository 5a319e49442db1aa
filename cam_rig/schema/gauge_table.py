"""Tables of gauge readings as they come: any separator, decimal comma, unit, language.

A column of cam angles and one or more of lifts. What a file does not say is assumed, and said.
The points of a cam's own file have one form: `cam_rig.schema.points`.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

from cam_rig.errors import ConfigError
from cam_rig.files import read_bytes, shown
from cam_rig.schema.headings import Heading, heading
from cam_rig.schema.points import MAX_BYTES
from cam_rig.units import TURN

SEPARATORS = {";": "semicolon", "\t": "tab", ",": "comma", " ": "space"}
NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?")
#: Angles without a unit are rad where they go round in so much at most, else deg.
MOST_RAD = 1.02 * TURN
#: Two lines above the numbers may be one heading: names, and units under them.
HEADING_LINES = 2
#: Lines of a file, at most.
MAX_LINES = 100_000


@dataclass(frozen=True)
class GaugeColumn:
    """Readings of one follower: ``lifts`` in m, and the step (m) in which they are written."""

    name: str
    lifts: tuple[float, ...]
    resolution: float


@dataclass(frozen=True)
class GaugeTable:
    """A file of readings.

    Parameters
    ----------
    file : its name
    angles : rad, in the order of the file
    columns : one for each follower
    lines : line of the file of each reading
    notes : how it was read, and what was assumed, a sentence each
    """

    file: str
    angles: tuple[float, ...]
    columns: tuple[GaugeColumn, ...]
    lines: tuple[int, ...]
    notes: tuple[str, ...]

    def column(self, name: str | None) -> GaugeColumn:
        """The column of a name, or the only one.

        Raises
        ------
        ConfigError : there is none of that name, or there are several and none is named
        """
        names = ", ".join(repr(column.name) for column in self.columns)
        found = [column for column in self.columns if name in (None, column.name)]
        if not found:
            raise ConfigError(f"{self.file}: has no column {name!r}; allowed: {names}")
        if len(found) > 1:
            raise ConfigError(
                f"{self.file}: has {len(found)} columns of lifts; allowed: one, so name it with "
                f"--column ({names}), or take all with --shape arcs"
            )
        return found[0]


def read_gauge_table(path: Path) -> GaugeTable:
    """Read a table of readings as it was written by a gauge, a spreadsheet or by hand.

    Raises
    ------
    ConfigError : one line with the file, the line, the value, what is allowed, and which
        separator was seen
    """
    lines = [(i, line) for i, line in enumerate(_text(path).splitlines(), 1) if line.strip()]
    lines = [(i, line) for i, line in lines if not line.lstrip().startswith("#")]
    if not 0 < len(lines) <= MAX_LINES:
        has = f"has {len(lines)} lines" if lines else "is empty"
        raise ConfigError(
            f"{path.name}: {has}; allowed: a heading and up to {MAX_LINES} lines of cam angle and "
            "lift"
        )
    return _Reader(path.name, lines).table()


def _text(path: Path) -> str:
    try:
        data = read_bytes(path, MAX_BYTES)
    except FileNotFoundError:
        near = ", ".join(sorted(other.name for other in path.parent.glob("*.csv"))[:10])
        there = f"; there are: {near}" if near else ""
        raise ConfigError(f"{path}: no such file{there}") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")  # what Windows programs write


class _Reader:
    """One file's lines, cut into cells; `table` makes numbers of them."""

    def __init__(self, file: str, lines: list[tuple[int, str]]) -> None:
        self.file = file
        declared = re.fullmatch(r"sep=(.)", lines[0][1].strip(), re.I)  # as Excel writes it
        if declared:
            lines = lines[1:]
        self.separator = declared[1] if declared else _separator([line for _, line in lines])
        self.seen = SEPARATORS.get(self.separator, repr(self.separator))
        self.rows = [(i, self._cells(i, line)) for i, line in lines]
        self.first = next(
            (k for k, (_, cells) in enumerate(self.rows) if _count_numbers(cells) > 1), None
        )

    def table(self) -> GaugeTable:
        """Headings to columns, cells to numbers."""
        if self.first is None:
            line, cells = self.rows[-1]
            raise ConfigError(
                f"{self.file}: line {line}: {shown(' | '.join(cells))} has no two numbers; "
                f"allowed: lines of cam angle and lift (separator seen: {self.seen})"
            )
        width = len(self.rows[self.first][1])
        headings = self._headings(width)
        angle, lifts, notes = self._assigned(headings)
        body = self.rows[self.first :]
        texts = [self._numbers(line, cells, headings) for line, cells in body]
        angles = [float(row[angle]) for row in texts]
        factor, words = _angle_factor(headings[angle], angles)
        columns = [self._column(headings[i], [row[i] for row in texts]) for i in lifts]
        unnamed = [headings[i].text for i in lifts if headings[i].factor is None]
        if unnamed:
            words += [f"no unit of length in {', '.join(map(repr, unnamed))}: mm assumed"]
        mark = self._decimal_mark(body, [angle, *lifts])
        read = f"{len(body)} lines read, separator {self.seen}, decimal {mark}"
        return GaugeTable(
            self.file,
            tuple(factor * value for value in angles),
            tuple(columns),
            tuple(line for line, _ in body),
            (read, *notes, *words),
        )

    def _decimal_mark(self, body: list[tuple[int, list[str]]], used: list[int]) -> str:
        """Comma or point; a file has one of them."""
        marked = [(line, cells[i]) for line, cells in body for i in used]
        commas = [(line, cell) for line, cell in marked if "," in cell]
        points = [(line, cell) for line, cell in marked if "." in cell]
        if commas and points:
            line, cell = points[0]
            raise ConfigError(
                f"{self.file}: line {line}: {shown(cell)} has a decimal point, {commas[0][1]!r} in "
                f"line {commas[0][0]} a decimal comma; allowed: one of them (separator seen: "
                f"{self.seen})"
            )
        return "comma" if commas else "point"

    def _cells(self, line: int, text: str) -> list[str]:
        if self.separator == " ":
            return text.split()
        try:
            cells = next(csv.reader([text], delimiter=self.separator))
        except csv.Error as error:
            raise ConfigError(f"{self.file}: line {line}: cannot be read ({error})") from None
        return [cell.strip() for cell in cells]

    def _headings(self, width: int) -> list[Heading]:
        """Of each column, from up to two lines above the numbers; "column 2" without any."""
        above = [cells for _, cells in self.rows[: self.first]][-HEADING_LINES:]
        line = self.rows[self.first or 0][0]
        if above and len(above[-1]) > 1 and len(above[-1]) != width:
            raise self._uneven(line, width, len(above[-1]))
        above = [cells for cells in above if len(cells) == width]
        joined = [_printable(" ".join(parts)) for parts in zip(*above, strict=True)]
        if not joined:
            return [Heading(f"column {i + 1}", "other", None) for i in range(width)]
        return [heading(text) for text in joined]

    def _assigned(self, headings: list[Heading]) -> tuple[int, list[int], list[str]]:
        """Index of the angles' column, those of lifts, and what had to be assumed."""
        angles = [i for i, one in enumerate(headings) if one.kind == "angle"]
        lifts = [i for i, one in enumerate(headings) if one.kind == "lift"]
        others = [i for i, one in enumerate(headings) if one.kind == "other"]
        notes = []
        if len(angles) > 1:
            raise self._unclear(headings, f"{len(angles)} of them are angles; allowed: one")
        if not angles and others[:1] == [0]:
            angles, others = [0], others[1:]
            notes.append(f"no heading of an angle: {headings[0].text!r} assumed to be it")
        if not lifts and angles:
            lifts = [i for i in others if _count_numbers([self.rows[self.first or 0][1][i]])]
            names = ", ".join(repr(headings[i].text) for i in lifts)
            notes.append(f"no heading of a lift: {names} assumed to be it")
        if not angles or not lifts:
            raise self._unclear(headings, "allowed: one of an angle and at least one of a lift")
        return angles[0], lifts, notes

    def _unclear(self, headings: list[Heading], words: str) -> ConfigError:
        found = shown(", ".join(one.text for one in headings))
        return ConfigError(
            f"{self.file}: columns are {found}, {words}, such as angle_deg and lift_mm "
            f"(separator seen: {self.seen})"
        )

    def _numbers(self, line: int, cells: list[str], headings: list[Heading]) -> list[str]:
        """The cells of a line as texts of numbers with a decimal point; others stay empty."""
        if len(cells) != len(headings):
            raise self._uneven(line, len(cells), len(headings))
        found = []
        for cell, one in zip(cells, headings, strict=True):
            text = _plain_number(cell)
            if text is None and one.kind != "other":
                raise ConfigError(
                    f"{self.file}: line {line}: {one.text} is {shown(cell)}; allowed: a number, so "
                    f"correct the line or put # before it (separator seen: {self.seen})"
                )
            found.append(text or "nan")
        return found

    def _uneven(self, line: int, cells: int, columns: int) -> ConfigError:
        return ConfigError(
            f"{self.file}: line {line}: has {cells} cells under {columns} columns (separator seen: "
            f"{self.seen}); allowed: as many, and ; or tab between them where the comma is the "
            "decimal mark"
        )

    def _column(self, one: Heading, texts: list[str]) -> GaugeColumn:
        factor = 1e-3 if one.factor is None else one.factor
        decimals = max(len(text.partition(".")[2]) if "e" not in text else 9 for text in texts)
        lifts = tuple(factor * float(text) for text in texts)
        return GaugeColumn(one.text, lifts, factor * 10.0**-decimals)


def _printable(text: str) -> str:
    """A heading in one line, as files and messages can hold it."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _separator(lines: list[str]) -> str:
    """The one that cuts most lines; a comma between digits may be a decimal mark."""
    for mark in (";", "\t"):
        if 2 * sum(mark in line for line in lines) > len(lines):
            return mark
    numbers = [line.split() for line in lines if line.lstrip()[:1] in "+-−.0123456789"]
    if numbers and all(len(cells) > 1 and all(map(_plain_number, cells)) for cells in numbers):
        return " "
    return ","


def _plain_number(cell: str) -> str | None:
    """A number's text with a decimal point; None for what is none."""
    text = cell.strip().removesuffix("°").strip().replace("−", "-").lower()
    return text.replace(",", ".") if NUMBER.fullmatch(text) else None


def _count_numbers(cells: list[str]) -> int:
    return sum(_plain_number(cell) is not None for cell in cells)


def _angle_factor(one: Heading, angles: list[float]) -> tuple[float, list[str]]:
    """Factor to rad, and what had to be assumed."""
    if one.factor is not None:
        return one.factor, []
    around = max(angles) - min(angles)
    unit, factor = ("rad", 1.0) if around <= MOST_RAD else ("deg", TURN / 360.0)
    return factor, [f"no unit of angle in {one.text!r}: {unit} assumed"]

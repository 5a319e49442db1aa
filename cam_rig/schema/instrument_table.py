"""A table of numbers as gauges, spreadsheets and people write it: lines cut into cells.

Any separator, decimal comma or point, UTF-8, UTF-16 or what Windows writes. `headings` has the
grammar of the headings.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

from cam_rig.errors import ConfigError
from cam_rig.files import read_bytes, shown
from cam_rig.schema.headings import Heading, parse_heading
from cam_rig.schema.segment_base import MAX_BYTES

SEPARATORS = {";": "semicolon", "\t": "tab", ",": "comma", " ": "space"}
NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?")
#: The number of an empty cell.
NOTHING = "nan"
#: Two lines above the numbers may be one heading: names, and units under them.
HEADING_LINES = 2
#: Lines of a file, at most.
MAX_LINES = 100_000


def read_lines(
    path: Path, wanted: str, max_bytes: int = MAX_BYTES
) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Return the lines of a file with their numbers, and those that are comments (#)."""
    lines = [
        (i, line) for i, line in enumerate(_text(path, max_bytes).splitlines(), 1) if line.strip()
    ]
    comments = [(i, line) for i, line in lines if line.lstrip().startswith("#")]
    lines = [(i, line) for i, line in lines if not line.lstrip().startswith("#")]
    if not 0 < len(lines) <= MAX_LINES:
        has = f"has {len(lines)} lines" if lines else "is empty"
        raise ConfigError(
            f"{path.name}: {has}; allowed: a heading and up to {MAX_LINES} lines of {wanted}"
        )
    return lines, comments


def _text(path: Path, max_bytes: int) -> str:
    try:
        data = read_bytes(path, max_bytes)
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


class CellTable:
    """One file's lines, cut into cells; ``first`` is the first row of numbers, None without any."""

    def __init__(self, file: str, lines: list[tuple[int, str]]) -> None:
        self.file = file
        declared = re.fullmatch(r"sep=(.)", lines[0][1].strip(), re.I)  # as Excel writes it
        if declared:
            lines = lines[1:]
        self.separator = declared[1] if declared else _separator([line for _, line in lines])
        self.seen = SEPARATORS.get(self.separator, repr(self.separator))
        self.rows = [(i, self._cells(i, line)) for i, line in lines]
        self.first = self._first()

    def _first(self) -> int | None:
        """The first row of numbers: two at least, or one among empty cells right above of such."""
        rows = [cells for _, cells in self.rows]
        first = next((k for k, cells in enumerate(rows) if count_numbers(cells) > 1), None)
        while first and len(rows[first - 1]) == len(rows[first]):
            said = [cell for cell in rows[first - 1] if cell]
            if not said or count_numbers(said) < len(said):
                break
            first -= 1
        return first

    def refused(self, words: str) -> ConfigError:
        """What is wrong in the file, and which separator it was read with."""
        return ConfigError(f"{self.file}: {words} (separator seen: {self.seen})")

    def how_read(self, body: list[tuple[int, list[str]]], used: list[int]) -> str:
        """A note of lines, separator, and decimal comma or point: a file has one of them."""
        marked = [(line, cells[i]) for line, cells in body for i in used]
        commas = [(line, cell) for line, cell in marked if "," in cell]
        points = [(line, cell) for line, cell in marked if "." in cell]
        if commas and points:
            line, cell = points[0]
            raise self.refused(
                f"line {line}: {shown(cell)} has a decimal point, {commas[0][1]!r} in line "
                f"{commas[0][0]} a decimal comma; allowed: one of them"
            )
        mark = "comma" if commas else "point"
        return f"{len(body)} lines read, separator {self.seen}, decimal {mark}"

    def _cells(self, line: int, text: str) -> list[str]:
        if self.separator == " ":
            return text.split()
        try:
            cells = next(csv.reader([text], delimiter=self.separator))
        except csv.Error as error:
            raise ConfigError(f"{self.file}: line {line}: cannot be read ({error})") from None
        return [cell.strip() for cell in cells]

    def headings(self, width: int) -> list[Heading]:
        """Of each column, from up to two lines above the numbers; "column 2" without any."""
        above = [cells for _, cells in self.rows[: self.first]][-HEADING_LINES:]
        line = self.rows[self.first or 0][0]
        if above and len(above[-1]) > 1 and len(above[-1]) != width:
            raise self._uneven(line, width, len(above[-1]))
        above = [cells for cells in above if len(cells) == width]
        if not above:
            return [Heading(f"column {i + 1}", "other", None) for i in range(width)]
        found = []
        for name, *unit in zip(*above, strict=True):
            text = f"{name} [{unit[0]}]" if name and unit and unit[0] else " ".join((name, *unit))
            # in one line, as files and messages can hold it
            printable = "".join(c if c.isprintable() else " " for c in text)
            found.append(parse_heading(" ".join(printable.split())))
        return found

    def require_clear(self, headings: list[Heading], used: list[int]) -> None:
        """Refuse headings of used columns that are not understood."""
        for i in used:
            if headings[i].unclear:
                raise self.refused(
                    f"the heading {shown(headings[i].text)} is unclear, because "
                    f"{headings[i].unclear}; allowed: words of the quantity, and its unit"
                )

    def numbers(
        self, line: int, cells: list[str], headings: list[Heading], used: list[int]
    ) -> list[str]:
        """The cells of a line as texts of numbers, `NOTHING` of an empty one; unused ones as is."""
        if len(cells) != len(headings):
            raise self._uneven(line, len(cells), len(headings))
        found = []
        for i, (cell, one) in enumerate(zip(cells, headings, strict=True)):
            text = plain_number(cell)
            if text is None and cell and i in used:
                raise self.refused(
                    f"line {line}: {one.text} is {shown(cell)}; allowed: a number, so correct the "
                    "line or put # before it"
                )
            found.append(text or NOTHING)
        return found

    def _uneven(self, line: int, cells: int, columns: int) -> ConfigError:
        return ConfigError(
            f"{self.file}: line {line}: has {cells} cells under {columns} columns (separator seen: "
            f"{self.seen}); allowed: as many, and ; or tab between them where the comma is the "
            "decimal mark"
        )


def _separator(lines: list[str]) -> str:
    """The one that cuts most lines; a comma between digits may be a decimal mark."""
    for mark in (";", "\t"):
        if 2 * sum(mark in line for line in lines) > len(lines):
            return mark
    numbers = [line.split() for line in lines if line.lstrip()[:1] in "+-−.0123456789"]
    if numbers and all(len(cells) > 1 and all(map(plain_number, cells)) for cells in numbers):
        return " "
    return ","


def plain_number(cell: str) -> str | None:
    """A number's text with a decimal point; None for what is none."""
    text = cell.strip().removesuffix("°").strip().replace("−", "-").lower()
    return text.replace(",", ".") if NUMBER.fullmatch(text) else None


def count_numbers(cells: list[str]) -> int:
    """How many cells are numbers."""
    return sum(plain_number(cell) is not None for cell in cells)

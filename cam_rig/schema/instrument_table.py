"""Reader of tables of numbers from gauges, spreadsheets and text editors.

A file is divided into lines and cells. Its separator may be semicolon, tab, comma or space, its
decimal mark comma or point, and its encoding UTF-8, UTF-16 or Windows-1252. The module `headings`
contains the grammar of the headings.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

from cam_rig.errors import ConfigError
from cam_rig.files import MIB, read_bytes, shorten
from cam_rig.schema.headings import Heading, parse_heading
from cam_rig.units import TURN

#: Separators of cells, and their names in messages.
SEPARATORS = {";": "semicolon", "\t": "tab", ",": "comma", " ": "space"}
#: Pattern of a number with decimal point or comma.
NUMBER = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?")
#: Pattern of a number whose comma or point could separate thousands or decimals, such as 1,084.
GROUPED = re.compile(r"[-+−]?[1-9]\d{0,2}[.,]\d{3}")
#: Pattern of an integer of two digits or more.
LARGE_INTEGER = re.compile(r"[-+−]?[1-9]\d+")
#: Text that represents an empty cell among the numbers of a line.
NOTHING = "nan"
#: Smallest range of angles without a unit that means rad: three quarters of a turn. A table of a
#: smaller range could be in another unit.
MIN_RANGE_RAD = 0.75 * TURN
#: Largest range of angles without a unit that means rad: one turn, and a step of the readings.
MAX_RANGE_RAD = 1.02 * TURN
#: Largest range of angles without a unit that means deg: four turns, of cam or crank.
MAX_RANGE_DEG = 1440.0
#: Units other than deg and rad -> their name, by the number of them in one turn. Angles without a
#: unit whose range is near this number are not read as deg.
OTHER_UNITS_PER_TURN = {100.0: "percent", 400.0: "gon"}
#: Relative tolerance within which a range of angles counts as one turn in another unit. A table
#: without its closing reading lacks one step, 0.5 % of 200 steps.
OTHER_UNITS_RTOL = 0.005
#: Pattern of words by which a heading indicates an angle in turns, from 0 to 1.
PHASE_WORDS = re.compile("phase|fase|cycle|zyklus|ciclo|takt", re.I)
#: Smallest range of an angle under such a heading that is read as turns, if it has no unit. A
#: smaller range could be in another unit.
MIN_PHASE_RANGE = 0.75
#: Largest range of an angle under such a heading that is read as turns: one turn and a step.
MAX_PHASE_RANGE = 1.02
#: Smallest range of an angle under such a heading that is read as deg. A smaller range could be in
#: percent.
MIN_PHASE_RANGE_DEG = 250.0
#: Pattern of the heading of a column with minutes of arc, next to the column of degrees.
MINUTES = re.compile(r"\W*(?:min|mins|minutes?|minuten|minutos?|minuti|arcmin|['′])\W*", re.I)
#: Largest size of a file in bytes, more than a million characters of numbers.
MAX_BYTES = 2 * MIB
#: Largest number of lines of a heading: names, and units under them.
HEADING_LINES = 2
#: Largest number of lines of a file.
MAX_LINES = 100_000
#: Largest number of cells of a line. Logs of many channels have fewer than 1000.
MAX_COLUMNS = 1000


def read_lines(
    path: Path, content: str, max_bytes: int = MAX_BYTES
) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Return two lists: the lines of a table, and its comment lines (#).

    Each line has its line number. Empty lines are left out. `content` describes the lines of
    numbers for messages. Raise
    ConfigError if the file cannot be read, is empty, or has more than `MAX_LINES` lines.
    """
    lines = [
        (i, line)
        for i, line in enumerate(_read_text(path, max_bytes).splitlines(), 1)
        if line.strip()
    ]
    comments = [(i, line) for i, line in lines if line.lstrip().startswith("#")]
    lines = [(i, line) for i, line in lines if not line.lstrip().startswith("#")]
    if not 0 < len(lines) <= MAX_LINES:
        has = f"has {len(lines)} lines" if lines else "is empty"
        raise ConfigError(
            f"{path.name}: {has}; allowed: a heading and up to {MAX_LINES} lines of {content}"
        )
    return lines, comments


def _read_text(path: Path, max_bytes: int) -> str:
    """Return the text of a file in UTF-16 with a mark, UTF-8, or Windows-1252."""
    try:
        data = read_bytes(path, max_bytes)
    except FileNotFoundError:
        names = ", ".join(sorted(other.name for other in path.parent.glob("*.csv"))[:10])
        listing = f"; there are: {names}" if names else ""
        raise ConfigError(f"{path}: no such file{listing}") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")  # as Windows programs write


class CellTable:
    """Lines of a file, divided into cells.

    Attributes
    ----------
    file : str
        Name of the file, for messages.
    separator : str
    separator_name : str
        Name of the separator, for messages.
    rows : list of (int, list of str)
        Line number and cells of each line.
    first : int or None
        Index in `rows` of the first row of numbers, or None.
    """

    def __init__(self, file: str, lines: list[tuple[int, str]], separator: str = "") -> None:
        self.file = file
        declared = re.fullmatch(r"sep=(.)", lines[0][1].strip(), re.I)  # as Excel writes it
        if declared:
            lines = lines[1:]
        self.separator = separator or (declared[1] if declared else _separator(lines))
        self.separator_name = SEPARATORS.get(self.separator, repr(self.separator))
        self.rows = [(i, self._cells(i, line)) for i, line in lines]
        self.first = self._find_first()

    def _find_first(self) -> int | None:
        """Return the index of the first row of numbers.

        It has at least two numbers. Rows directly above it with the same number of cells belong
        to the numbers too, if they contain only numbers and empty cells.
        """
        rows = [cells for _, cells in self.rows]
        first = next((k for k, cells in enumerate(rows) if count_numbers(cells) > 1), None)
        while first and len(rows[first - 1]) == len(rows[first]):
            filled = [cell for cell in rows[first - 1] if cell]
            if not filled or count_numbers(filled) < len(filled):
                break
            first -= 1
        return first

    def error(self, problem: str) -> ConfigError:
        """Return the error for a problem in the file, with the detected separator."""
        return ConfigError(f"{self.file}: {problem} (separator seen: {self.separator_name})")

    def describe_format(self, body: list[tuple[int, list[str]]], used: list[int]) -> str:
        """Return a note on the number of lines, the separator and the decimal mark.

        `used` are the indices of the used columns. Raise ConfigError if some of their cells have a
        decimal comma and others a decimal point, or if a mark could separate thousands.
        """
        used_cells = [(line, cells[i]) for line, cells in body for i in used]
        commas = [(line, cell) for line, cell in used_cells if "," in cell]
        points = [(line, cell) for line, cell in used_cells if "." in cell]
        if commas and points:
            line, cell = points[0]
            raise self.error(
                f"line {line}: {shorten(cell)} has a decimal point, {commas[0][1]!r} in line "
                f"{commas[0][0]} a decimal comma; allowed: one of them"
            )
        for i in used:
            self._require_decimals([(line, cells[i]) for line, cells in body if i < len(cells)])
        mark = "comma" if commas else "point"
        return f"{len(body)} lines read, separator {self.separator_name}, decimal {mark}"

    def _require_decimals(self, column: list[tuple[int, str]]) -> None:
        """Raise ConfigError if the mark in the cells of a column could separate thousands.

        All cells with a mark have three digits after it, and the others have an integer of two
        digits or more, as in 486, 751, 1,084.
        """
        marked = [(line, cell) for line, cell in column if "," in cell or "." in cell]
        whole = [cell for _, cell in column if LARGE_INTEGER.fullmatch(cell)]
        if not marked or not whole or not all(GROUPED.fullmatch(cell) for _, cell in marked):
            return
        line, cell = marked[0]
        raise self.error(
            f"line {line}: {cell!r} next to {whole[0]!r} in the same column could be a number of "
            "thousands or a decimal number; allowed: numbers without a separator of thousands, or "
            "all with decimals, such as 12.000"
        )

    def _cells(self, line: int, text: str) -> list[str]:
        try:
            cells = (
                text.split()
                if self.separator == " "
                else next(csv.reader([text], delimiter=self.separator))
            )
        except csv.Error as error:
            raise ConfigError(f"{self.file}: line {line}: cannot be read ({error})") from None
        if len(cells) > MAX_COLUMNS:
            raise self.error(
                f"line {line}: has {len(cells)} columns; allowed: at most {MAX_COLUMNS}, and a "
                "line for each angle"
            )
        return [cell.strip() for cell in cells]

    def headings(self, width: int) -> list[Heading]:
        """Return the heading of each of `width` columns.

        Up to `HEADING_LINES` lines above the numbers are the heading. Without such a line, the
        headings are "column 1", "column 2" and so on.
        """
        above = [cells for _, cells in self.rows[: self.first]][-HEADING_LINES:]
        line = self.rows[self.first or 0][0]
        if above and len(above[-1]) > 1 and len(above[-1]) != width:
            raise self._width_error(line, width, len(above[-1]))
        above = [cells for cells in above if len(cells) == width]
        if not above:
            return [Heading(f"column {i + 1}", "other", None) for i in range(width)]
        headings = []
        for name, *unit in zip(*above, strict=True):
            text = f"{name} [{unit[0]}]" if name and unit and unit[0] else " ".join((name, *unit))
            # one line of printable characters, for files and messages
            printable = "".join(c if c.isprintable() else " " for c in text)
            headings.append(parse_heading(" ".join(printable.split())))
        return headings

    def require_clear(self, headings: list[Heading], used: list[int]) -> None:
        """Raise ConfigError if the heading of a used column is not understood."""
        for i in used:
            if headings[i].unclear:
                raise self.error(
                    f"the heading {shorten(headings[i].text)} is unclear, because "
                    f"{headings[i].unclear}; allowed: words of the quantity, and its unit"
                )

    def guess_angle_unit(self, heading: Heading, angles: list[float]) -> tuple[float, str]:
        """Return the unit of angles without a unit, determined from their range.

        The result is the factor to rad and the name of the unit. Raise ConfigError if the range
        could be of several units.
        """
        span = max(angles) - min(angles)
        is_phase = PHASE_WORDS.search(heading.text) is not None
        if is_phase and MIN_PHASE_RANGE <= span <= MAX_PHASE_RANGE:
            return TURN, "turn"
        if MIN_RANGE_RAD <= span <= MAX_RANGE_RAD:
            return 1.0, "rad"
        other = [
            name
            for turn, name in OTHER_UNITS_PER_TURN.items()
            if abs(span - turn) <= OTHER_UNITS_RTOL * turn
        ]
        if is_phase and MAX_RANGE_RAD < span < MIN_PHASE_RANGE_DEG:
            other = other or ["percent" if span <= 100.0 else "a part of a turn in deg"]
        if span < MIN_RANGE_RAD or span > MAX_RANGE_DEG or other:
            could_be = f", which could be {other[0]}" if other else ""
            raise self.error(
                f"{shorten(heading.text)} has no unit of angle and goes from {min(angles):g} to "
                f"{max(angles):g}{could_be}; allowed: the unit in the heading, such as deg, rad, "
                "turn or %, or --counts"
            )
        return TURN / 360.0, "deg"

    def require_no_minutes(self, headings: list[Heading], angle: int) -> None:
        """Raise ConfigError if the column after the angle contains its minutes of arc."""
        after = headings[angle + 1 : angle + 2]
        if after and MINUTES.fullmatch(after[0].text):
            raise self.error(
                f"{shorten(after[0].text)} next to {shorten(headings[angle].text)} looks like "
                "minutes of arc; allowed: the angle in one column, degrees + minutes / 60"
            )

    def numbers(
        self, line: int, cells: list[str], headings: list[Heading], used: list[int]
    ) -> list[str]:
        """Return the cells of a line as texts of numbers with a decimal point.

        An empty cell, and a text in an unused column, gives `NOTHING`. Raise ConfigError for a text
        in a used column, or a wrong number of cells.
        """
        if len(cells) != len(headings):
            raise self._width_error(line, len(cells), len(headings))
        numbers = []
        for i, (cell, heading) in enumerate(zip(cells, headings, strict=True)):
            text = plain_number(cell)
            if text is None and cell and i in used:
                raise self.error(
                    f"line {line}: {heading.text} is {shorten(cell)}; allowed: a number, so "
                    "correct the line or put # before it"
                )
            numbers.append(text or NOTHING)
        return numbers

    def _width_error(self, line: int, cells: int, columns: int) -> ConfigError:
        """Return the error for a line with a wrong number of cells."""
        return ConfigError(
            f"{self.file}: line {line}: has {cells} cells under {columns} columns (separator seen: "
            f"{self.separator_name}); allowed: as many, and ; or tab between them where the comma "
            "is the decimal mark"
        )


def _separator(lines: list[tuple[int, str]]) -> str:
    """Return the separator of the lines.

    It is a semicolon or tab if most lines contain it, a space if it divides each line of numbers
    into numbers, and otherwise a comma. The comma is last, because it may be a decimal mark.
    """
    for mark in (";", "\t"):
        if 2 * sum(mark in line for _, line in lines) > len(lines):
            return mark
    numbers = [line.split() for _, line in lines if line.lstrip()[:1] in "+-−.0123456789"]
    if numbers and all(len(cells) > 1 and all(map(plain_number, cells)) for cells in numbers):
        return " "
    return ","


def plain_number(cell: str) -> str | None:
    """Return the number in a cell as text with a decimal point.

    Returns None if the cell is not a number.
    """
    text = cell.strip().removesuffix("°").strip().replace("−", "-").lower()
    return text.replace(",", ".") if NUMBER.fullmatch(text) else None


def count_numbers(cells: list[str]) -> int:
    """Return the number of cells that are numbers."""
    return sum(plain_number(cell) is not None for cell in cells)

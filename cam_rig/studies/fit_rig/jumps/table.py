"""Tables of measured jump speeds, with optional columns of added mass, spring and preload."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cam_rig.files import shorten
from cam_rig.schema.headings import Heading
from cam_rig.schema.instrument_table import NOTHING, CellTable, read_lines
from cam_rig.show.tables import pluralize
from cam_rig.units import RPM, FloatArray, to_rpm

#: Name of the table's column by the physical quantity of its heading. Except for the speed, this is
#: the rig-file key of the parameter.
PARAMETER_OF_QUANTITY = {
    "speed": "speed",
    "mass": "mass",
    "stiffness": "spring_stiffness",
    "preload": "preload",
}
#: Unit that is assumed if a heading has none, and the factor from this unit to SI, by quantity.
ASSUMED_UNITS = {"speed": ("rpm", RPM), "mass": ("kg", 1.0), "stiffness": ("N/m", 1.0)}
ASSUMED_UNITS["preload"] = ("N", 1.0)
#: Largest number of lines without a jump speed whose line numbers a note lists.
MAX_LISTED_LINES = 5


@dataclass(frozen=True)
class JumpReading:
    """Measured jump speed in rad/s, and the set-up in which it was measured.

    ``line`` is the line number in the file. ``setup`` are the values (SI) of the table's other
    columns by rig-file key: added mass, spring, preload.
    """

    line: int
    speed: float
    setup: dict[str, float]

    @property
    def rpm(self) -> float:
        """Measured jump speed in rpm."""
        return to_rpm(self.speed)


@dataclass(frozen=True)
class JumpTable:
    """Table of measured jump speeds.

    ``columns`` are the rig-file keys of its columns other than the speed. ``notes`` report how the
    file was read.
    """

    file: str
    readings: tuple[JumpReading, ...]
    columns: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def rpm(self) -> FloatArray:
        """Measured jump speeds in rpm, ``(n,)``."""
        return np.array([reading.rpm for reading in self.readings])


def read_jump_table(path: Path) -> JumpTable:
    """Read a table of measured jump speeds from a text file.

    The values are converted to SI by the units in the headings. Raises a `ConfigError` with the
    line of an invalid cell.
    """
    lines, _ = read_lines(path, "mass, spring and jump speed")
    return _JumpReader(path.name, lines).table()


class _JumpReader(CellTable):
    """Reader of a text file with a table of measured jump speeds."""

    def table(self) -> JumpTable:
        """Return the table with all readings of the file.

        Lines with an empty jump speed are skipped and reported in a note.
        """
        if self.first is None or self.first == 0:
            raise self.error("the columns must have a heading, such as mass_kg, spring_N/m, rpm")
        headings = self.headings(len(self.rows[self.first][1]))
        columns_by_name, notes = self._assign(headings)
        body = self.rows[self.first :]
        used = [index for index, _ in columns_by_name.values()]
        speed, readings, empty = columns_by_name["speed"][0], list[JumpReading](), list[int]()
        for line, cells in body:
            texts = self.numbers(line, cells, headings, used)
            if texts[speed] == NOTHING and not cells[speed]:
                empty.append(line)
                continue
            values = {
                name: self._value(line, name, cells[index], texts[index], factor)
                for name, (index, factor) in columns_by_name.items()
            }
            readings.append(JumpReading(line, values.pop("speed"), values))
        read = self.describe_format(body, used)
        if not readings:
            raise self.error("the table must have at least one jump speed, got 0")
        if empty:
            lines = ", ".join(map(str, empty[:MAX_LISTED_LINES])) + ", …" * (
                len(empty) > MAX_LISTED_LINES
            )
            notes.append(
                f"{pluralize(len(empty), 'empty cell')} of the speed: no reading in {lines}"
            )
        columns = tuple(name for name in columns_by_name if name != "speed")
        return JumpTable(self.file, tuple(readings), columns, (read, *notes))

    def _assign(self, headings: list[Heading]) -> tuple[dict[str, tuple[int, float]], list[str]]:
        """Return the column index and the factor to SI of each column by name, and notes.

        The notes report which units were assumed because a heading has none.
        """
        columns, notes = dict[str, tuple[int, float]](), list[str]()
        for index, heading in enumerate(headings):
            name = PARAMETER_OF_QUANTITY.get(heading.quantity)
            if name is None:
                continue
            if name in columns:
                other = shorten(headings[columns[name][0]].text)
                raise self.error(
                    f"{shorten(heading.text)} and {other} are both the {name}; remove one"
                )
            factor = heading.factor
            if factor is None:
                unit, factor = ASSUMED_UNITS[heading.quantity]
                notes.append(f"no unit in {heading.text!r}: {unit} assumed")
            columns[name] = index, factor
        self.require_clear(headings, [index for index, _ in columns.values()])
        if "speed" not in columns:
            texts = ", ".join(heading.text for heading in headings)
            raise self.error(
                f"the table must have a column of jump speeds, such as rpm, got {shorten(texts)}; "
                "further columns may be mass_kg, spring_N/m and preload_N"
            )
        return columns, notes

    def _value(self, line: int, name: str, cell: str, text: str, factor: float) -> float:
        """Return the value of a cell in SI.

        ``cell`` is the text of the file and ``text`` its number in standard notation. ``factor``
        converts it to SI. Raises an error for an empty cell or a value outside its range.
        """
        if not cell:
            raise self.error(
                f"line {line}: the {name} is empty next to a jump speed; enter a number, or "
                "comment out the line with #"
            )
        value = float(text) * factor
        may_be_zero = name in ("mass", "preload")
        if not (math.isfinite(value) and (value > 0.0 or (may_be_zero and value == 0.0))):
            rule = "0 or more" if may_be_zero else "above 0"
            raise self.error(f"line {line}: the {name} must be {rule}, got {shorten(cell)}")
        return value

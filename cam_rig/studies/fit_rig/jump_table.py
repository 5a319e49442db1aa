"""Tables of jump speeds as a bench gives them: mass put on, spring, speed at which it jumps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cam_rig.files import shown
from cam_rig.schema.headings import Heading
from cam_rig.schema.instrument_table import NOTHING, CellTable, read_lines
from cam_rig.show.tables import pluralize
from cam_rig.units import RPM, FloatArray, to_rpm

#: Quantities of a heading to the numbers of a rig, and the unit if the heading has none.
NUMBERS = {"speed": "speed", "mass": "mass", "stiffness": "spring_stiffness", "preload": "preload"}
ASSUMED_UNITS = {"speed": ("rpm", RPM), "mass": ("kg", 1.0), "stiffness": ("N/m", 1.0)}
ASSUMED_UNITS["preload"] = ("N", 1.0)
#: Lines without a reading that are named.
MOST_LINES = 5


@dataclass(frozen=True)
class JumpReading:
    """A jump speed (rad/s) and what was put on for it, SI; ``line`` of the file."""

    line: int
    speed: float
    known: dict[str, float]

    @property
    def rpm(self) -> float:
        """The jump speed in rpm."""
        return to_rpm(self.speed)


@dataclass(frozen=True)
class JumpTable:
    """A file of jump speeds; ``columns`` are the numbers it gives, ``notes`` how it was read."""

    file: str
    readings: tuple[JumpReading, ...]
    columns: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def rpm(self) -> FloatArray:
        """The jump speeds, ``(n,)``."""
        return np.array([reading.rpm for reading in self.readings])


def read_jump_table(path: Path) -> JumpTable:
    """Read a table of jump speeds."""
    lines, _ = read_lines(path, "mass, spring and jump speed")
    return _JumpReader(path.name, lines).table()


class _JumpReader(CellTable):
    """A file of jump speeds; `table` makes numbers of its cells."""

    def table(self) -> JumpTable:
        """Headings to columns, cells to numbers."""
        if self.first is None or self.first == 0:
            raise self.refused(
                "has no heading over its numbers; allowed: a heading, such as mass_kg, "
                "spring_N/m, rpm"
            )
        headings = self.headings(len(self.rows[self.first][1]))
        found, notes = self._assign(headings)
        body = self.rows[self.first :]
        used = [index for index, _ in found.values()]
        speed, readings, empty = found["speed"][0], list[JumpReading](), list[int]()
        for line, cells in body:
            texts = self.numbers(line, cells, headings, used)
            if texts[speed] == NOTHING and not cells[speed]:
                empty.append(line)
                continue
            values = {
                name: self._value(line, name, cells[index], texts[index], factor)
                for name, (index, factor) in found.items()
            }
            readings.append(JumpReading(line, values.pop("speed"), values))
        read = self.how_read(body, used)
        if not readings:
            raise self.refused("has no jump speed; allowed: one or more")
        if empty:
            where = ", ".join(map(str, empty[:MOST_LINES])) + ", …" * (len(empty) > MOST_LINES)
            notes.append(
                f"{pluralize(len(empty), 'empty cell')} of the speed: no reading in {where}"
            )
        columns = tuple(name for name in found if name != "speed")
        return JumpTable(self.file, tuple(readings), columns, (read, *notes))

    def _assign(self, headings: list[Heading]) -> tuple[dict[str, tuple[int, float]], list[str]]:
        """Return column and factor of each number, and notes on assumed units."""
        found, notes = dict[str, tuple[int, float]](), list[str]()
        for index, heading in enumerate(headings):
            name = NUMBERS.get(heading.quantity)
            if name is None:
                continue
            if name in found:
                other = shown(headings[found[name][0]].text)
                raise self.refused(
                    f"{shown(heading.text)} and {other} both hold a {name}; allowed: one of them"
                )
            factor = heading.factor
            if factor is None:
                unit, factor = ASSUMED_UNITS[heading.quantity]
                notes.append(f"no unit in {heading.text!r}: {unit} assumed")
            found[name] = index, factor
        self.require_clear(headings, [index for index, _ in found.values()])
        if "speed" not in found:
            texts = ", ".join(heading.text for heading in headings)
            raise self.refused(
                f"columns are {shown(texts)}; allowed: one of the jump speed, such as rpm, and "
                "those of what was put on: mass_kg, spring_N/m, preload_N"
            )
        return found, notes

    def _value(self, line: int, name: str, cell: str, text: str, factor: float) -> float:
        if not cell:
            raise self.refused(
                f"line {line}: the {name} is empty beside a speed; allowed: a number, or # before "
                "the line"
            )
        value = float(text) * factor
        least = 0.0 if name in ("mass", "preload") else math.ulp(0.0)
        if not (math.isfinite(value) and value >= least):
            above = "≥" if least == 0.0 else ">"
            raise self.refused(f"line {line}: {name} is {shown(cell)}; allowed: a number {above} 0")
        return value

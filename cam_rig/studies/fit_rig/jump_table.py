"""Tables of jump speeds as a bench gives them: mass put on, spring, speed at which it jumps."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cam_rig.files import shown
from cam_rig.schema.instrument_table import NOTHING, CellTable, plain_words, read_lines
from cam_rig.show.tables import pluralize
from cam_rig.units import RPM, TURN, FloatArray, to_rpm

#: What a heading's words begin with, in English, Spanish, German, French, Italian, Portuguese.
WORDS = {
    "speed": re.compile("rpm|speed|drehzahl|velocidad|vitesse|velocita|giri|jump|omega"),
    "mass": re.compile("mass|masa|gewicht|weight|peso|poids"),
    "spring_stiffness": re.compile("spring|stiff|feder|muelle|resorte|rigid|ressort|molla"),
    "preload": re.compile("preload|vorspann|precarga|precharge|precarico"),
}
#: Units of each to SI; the first is taken where a heading names none.
UNITS = {
    "speed": {"rpm": RPM, "1/min": RPM, "u/min": RPM, "rad/s": 1.0, "hz": TURN, "1/s": TURN},
    "mass": {"kg": 1.0, "g": 1e-3, "lb": 0.45359237},
    "spring_stiffness": {"n/m": 1.0, "n/mm": 1e3, "n/cm": 1e2, "kn/m": 1e3, "lbf/in": 175.126835},
    "preload": {"n": 1.0, "kn": 1e3, "lbf": 4.4482216},
}
#: Lines without a reading that are named.
MOST_LINES = 5
#: A last word of a heading that is no longer than this is meant as a unit.
SHORT = 3
#: A unit as headings have it: in brackets, or behind the last blank or underscore.
BRACKETS = re.compile(r"[\[(]([^\])]+)[\])]\s*$")


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
    return _JumpReader(path.name, read_lines(path, "mass, spring and jump speed")).table()


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
        found, notes = self._assigned([one.text for one in headings])
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

    def _assigned(self, headings: list[str]) -> tuple[dict[str, tuple[int, float]], list[str]]:
        found, notes = dict[str, tuple[int, float]](), list[str]()
        for index, text in enumerate(headings):
            words = plain_words(text)
            names = [n for n, starts in WORDS.items() if any(map(starts.match, words))]
            name = names[-1] if names else None  # "spring preload" is a preload
            if name is None:
                continue
            if name in found:
                other = shown(headings[found[name][0]])
                raise self.refused(
                    f"{shown(text)} and {other} both hold a {name}; allowed: one of them"
                )
            unit = self._unit(text, name)
            if unit is None:
                unit = next(iter(UNITS[name]))
                notes.append(f"no unit in {text!r}: {unit} assumed")
            found[name] = index, UNITS[name][unit]
        if "speed" not in found:
            raise self.refused(
                f"columns are {shown(', '.join(headings))}; allowed: one of the jump speed, such "
                "as rpm, and those of what was put on: mass_kg, spring_N/m, preload_N"
            )
        return found, notes

    def _unit(self, text: str, name: str) -> str | None:
        plain = text.strip().casefold().replace("·", "*").replace("min-1", "1/min")
        bracket = BRACKETS.search(plain)
        last = (bracket[1] if bracket else re.split(r"[\s_]", plain)[-1]).replace(" ", "")
        if last in UNITS[name]:
            return last
        if bracket or "/" in last or (last != plain and len(last) <= SHORT):
            allowed = ", ".join(UNITS[name])
            raise self.refused(f"{shown(text)} has no unit of a {name}; allowed: {allowed}")
        return None

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

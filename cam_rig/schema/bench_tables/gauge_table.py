"""Tables of gauge readings as they come: any separator, decimal comma, unit, language.

A column of cam angles and one or more of lifts. What a file does not say is assumed, and said.
The points of a cam's own file have one form: `cam_rig.schema.points`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cam_rig.errors import ConfigError
from cam_rig.files import shown
from cam_rig.schema.bench_tables.cells import NOTHING, CellTable, count_numbers, read_lines
from cam_rig.schema.bench_tables.headings import Heading
from cam_rig.tables import counted
from cam_rig.units import TURN

#: Angles without a unit are rad where they go round in so much at most, else deg.
MOST_RAD = 1.02 * TURN


@dataclass(frozen=True)
class GaugeColumn:
    """Readings of one follower: ``lifts`` in m, NaN where a cell is empty, and their written step.

    The step is in m.
    """

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

    def only_column(self) -> GaugeColumn:
        """The column of lifts, where there is one.

        Raises
        ------
        ConfigError : there are several
        """
        if len(self.columns) > 1:
            names = ", ".join(repr(column.name) for column in self.columns)
            raise ConfigError(
                f"{self.file}: has {len(self.columns)} columns of lifts; allowed: one, so name it "
                f"with --column ({names}), or take all with --shape arcs"
            )
        return self.columns[0]


def read_gauge_table(path: Path, column: str | None = None) -> GaugeTable:
    """Read a table of readings as it was written by a gauge, a spreadsheet or by hand.

    Parameters
    ----------
    column : heading of the one column of lifts that is read, whatever the others hold; all if None

    Raises
    ------
    ConfigError : one line with the file, the line, the value, what is allowed, and which
        separator was seen
    """
    return _GaugeReader(path.name, read_lines(path, "cam angle and lift")).table(column)


class _GaugeReader(CellTable):
    """A file of readings; `table` makes numbers of its cells."""

    def table(self, column: str | None) -> GaugeTable:
        """Headings to columns, cells to numbers."""
        if self.first is None:
            line, cells = self.rows[-1]
            raise ConfigError(
                f"{self.file}: line {line}: {shown(' | '.join(cells))} has no two numbers; "
                f"allowed: lines of cam angle and lift (separator seen: {self.seen})"
            )
        width = len(self.rows[self.first][1])
        headings = self.headings(width)
        angle, lifts, notes = self._assigned(headings, column)
        used = [angle, *lifts]
        body = [(line, cells) for line, cells in self.rows[self.first :] if self._says(cells, used)]
        texts = [self.numbers(line, cells, headings, used) for line, cells in body]
        for (line, _), row in zip(body, texts, strict=True):
            if row[angle] == NOTHING:
                raise ConfigError(
                    f"{self.file}: line {line}: {headings[angle].text} is empty beside a lift; "
                    f"allowed: an angle, or # before the line (separator seen: {self.seen})"
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
                words.append(f"{counted(empty, 'empty cell')} in {headings[i].text!r}: no reading")
        mark = self.decimal_mark(body, used)
        read = f"{len(body)} lines read, separator {self.seen}, decimal {mark}"
        return GaugeTable(
            self.file,
            tuple(factor * value for value in angles),
            tuple(columns),
            tuple(line for line, _ in body),
            (read, *notes, *words),
        )

    def _says(self, cells: list[str], used: list[int]) -> bool:
        """Whether a line has a reading: of another width, which is an error, or not all empty."""
        return max(used) >= len(cells) or any(cells[i] for i in used)

    def _assigned(
        self, headings: list[Heading], column: str | None
    ) -> tuple[int, list[int], list[str]]:
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
        return ConfigError(
            f"{self.file}: columns are {found}, {words}, such as angle_deg and lift_mm "
            f"(separator seen: {self.seen})"
        )

    def _column(self, one: Heading, texts: list[str]) -> GaugeColumn:
        factor = 1e-3 if one.factor is None else one.factor
        decimals = max(len(text.partition(".")[2]) if "e" not in text else 9 for text in texts)
        lifts = tuple(factor * float(text) for text in texts)
        return GaugeColumn(one.text, lifts, factor * 10.0**-decimals)


def _angle_factor(one: Heading, angles: list[float]) -> tuple[float, list[str]]:
    """Factor to rad, and what had to be assumed."""
    if one.factor is not None:
        return one.factor, []
    around = max(angles) - min(angles)
    unit, factor = ("rad", 1.0) if around <= MOST_RAD else ("deg", TURN / 360.0)
    return factor, [f"no unit of angle in {one.text!r}: {unit} assumed"]

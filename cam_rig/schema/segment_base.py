"""Base classes of segments, and the law ``table`` through measured points."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field, FiniteFloat, ValidationInfo, model_validator

from cam_rig.files import shorten
from cam_rig.schema.instrument_table import CellTable, read_lines
from cam_rig.schema.quantity import MANY, UNITS, Quantity, Strict, must_be
from cam_rig.units import TURN

#: Cam angle of a segment, up to one turn.
Span = Annotated[Quantity, must_be("angle", gt=0.0, le=TURN * (1.0 + 1e-12))]
#: Ordinates or coefficients, as fractions of the lift.
Ratios = Annotated[Quantity, must_be("ratio", counts=(1, MANY), ge=-100.0, le=100.0)]
#: Positive dimension of the cam's shape, such as a radius.
Length = Annotated[Quantity, must_be("length", gt=0.0, le=100.0)]


class SegmentBase(Strict):
    """Base class of the segments of a cam.

    `span` is the cam angle of the segment, rad.
    """

    span: Span


class WholeTurn(SegmentBase):
    """Base class of the laws of a whole turn, which is the only segment of its cam."""

    @model_validator(mode="after")
    def _check_span(self) -> WholeTurn:
        degrees = math.degrees(self.span.si)
        if abs(degrees - 360.0) > 1e-9:
            raise ValueError(f"span: is {degrees:.9g}°; allowed: 360°, this law is a whole turn")
        return self


class OtherFile(Strict):
    """Base class of the content of another file, whose numbers are not those of the cam."""


def iterate_quantities(node: BaseModel, prefix: str) -> Iterator[tuple[str, Quantity]]:
    """Yield path and number for each number of a config model, without other files.

    A path is a text such as "segments[0].span". `prefix` precedes it.
    """
    for key, value in node:
        items: list[tuple[str, object]] = [("", value)]
        if isinstance(value, list):
            items = [(f"[{i}]", item) for i, item in enumerate(value)]
        elif isinstance(value, dict):
            items = [(f".{name}", item) for name, item in value.items()]
        for suffix, item in items:
            if isinstance(item, Quantity):
                yield f"{prefix}{key}{suffix}", item
            elif isinstance(item, BaseModel) and not isinstance(item, OtherFile):
                yield from iterate_quantities(item, f"{prefix}{key}{suffix}.")


#: Columns of a file of points -> dimension.
COLUMNS = {"angle": "angle", "lift": "length"}


def read_points(path: Path) -> tuple[list[float], list[float]]:
    """Return angles (rad) and lifts (m) of a CSV file.

    Its first line names columns and units, such as ``angle_deg,lift_mm``. Further columns are
    ignored. Raise ValueError if the file or a number is wrong.
    """
    lines, _ = read_lines(path, "points")
    (_, header), *rows = CellTable(path.name, lines, separator=",").rows
    columns = [_column(path.name, header, kind) for kind in COLUMNS]
    numbers: list[list[float]] = [[], []]
    for line, cells in rows:
        for (index, factor), column in zip(columns, numbers, strict=True):
            column.append(_number(path.name, line, cells, header, index) * factor)
    return numbers[0], numbers[1]


def _column(name: str, header: list[str], kind: str) -> tuple[int, float]:
    """Return the index of a column of `COLUMNS`, and the factor of its unit to SI."""
    units = UNITS[COLUMNS[kind]]
    indices = [i for i, cell in enumerate(header) if cell.split("_")[0] == kind]
    if len(indices) == 1:
        unit = header[indices[0]].removeprefix(f"{kind}_")
        if unit in units:
            return indices[0], units[unit]
    allowed = ", ".join(f"{kind}_{unit}" for unit in units)
    raise ValueError(
        f"{name}: columns are {shorten(', '.join(header), False)}; allowed: one of {allowed}"
    )


def _number(name: str, line: int, cells: list[str], header: list[str], index: int) -> float:
    """Return the number of a cell. Raise ValueError if it is not a finite number."""
    cell = cells[index] if index < len(cells) else ""
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(
            f"{name}: line {line}: {header[index]} is {shorten(cell)}; allowed: a finite number"
        )
    return number


#: Smallest number of points of a law. Fewer points do not determine the law of a cam.
MIN_POINTS = 12
#: Largest number of points of a law. More points increase the computing time, not the accuracy.
MAX_POINTS = 7200
#: Widest gap (deg) between points. The law within a wider gap would be arbitrary.
MAX_GAP_DEG = 45.0
#: Largest number of dwells of a law.
MAX_DWELLS = 36
#: Smallest distance (deg) between two dwells.
MIN_EVENT_DEG = 1.0
#: Absolute tolerance (rad) within which a point at an end of a dwell counts as inside it.
DWELL_ATOL_RAD = 1e-9
#: Largest difference between the lifts at 0° and 360°, in multiples of the table's tolerance.
MAX_CLOSING_TOLERANCES = 3.0
#: Largest tolerance as a fraction of the lift. With a larger tolerance the spline would no longer
#: represent the measured cam.
MAX_TOLERANCE = 0.05


class MeasuredPoints(Strict):
    """Content of a file of points: rising cam angles in rad, and lifts in m."""

    file: str
    angles: tuple[FiniteFloat, ...] = Field(min_length=MIN_POINTS)
    lifts: tuple[FiniteFloat, ...] = Field(min_length=MIN_POINTS)


def read_measured_points(value: Any, info: ValidationInfo) -> Any:
    """Read the CSV file of measured points that a cam's file names.

    A value that is not a text is returned unchanged, because a copied config contains the points.
    """
    if not isinstance(value, str):
        return value
    if Path(value).name != value or not value.endswith(".csv"):
        raise ValueError(f"is {value!r}; allowed: the name of a .csv file next to the cam's file")
    folder = (info.context or {}).get("folder", Path())
    angles, lifts = read_points(folder / value)
    if not MIN_POINTS <= len(angles) <= MAX_POINTS:
        raise ValueError(
            f"{value}: has {len(angles)} points; allowed: {MIN_POINTS} to {MAX_POINTS}"
        )
    degrees = [math.degrees(angle) for angle in angles]
    for i, (before, after) in enumerate(pairwise(degrees)):
        if after <= before:
            raise ValueError(
                f"{value}: point {i + 2} is at {after:g}° after {before:g}°; allowed: rising "
                "angles, so sort the points and leave out repeated ones"
            )
    if degrees[0] < 0.0 or degrees[-1] > 360.0 + 1e-9:
        raise ValueError(
            f"{value}: angles are {degrees[0]:g}° to {degrees[-1]:g}°; allowed: 0° to 360°"
        )
    return {"file": value, "angles": angles, "lifts": lifts}


class MeasuredDwell(Strict):
    """Exact dwell in a measured law.

    Parameters
    ----------
    start, span : Quantity
        Cam angle of the start, and length, rad.
    level : Quantity
        Constant lift, relative to the same zero as the lifts of the file, m.
    """

    start: Annotated[Quantity, must_be("angle", ge=0.0, le=TURN)]
    span: Annotated[Quantity, must_be("angle", gt=0.0, le=TURN)]
    level: Annotated[Quantity, must_be("length", ge=-100.0, le=100.0)]

    def contains(self, start: float, stop: float) -> bool:
        """Return True if an interval of cam angles (rad) is within the dwell."""
        offset = (start - self.start.si + DWELL_ATOL_RAD) % TURN
        return offset + (stop - start) <= self.span.si + 2.0 * DWELL_ATOL_RAD


class Table(WholeTurn):
    """Smooth periodic spline through measured points of a whole turn.

    Parameters
    ----------
    file : MeasuredPoints
        Points (angle, lift). A cam's file contains the name of their file.
    tolerance : Quantity
        R.m.s. distance of the spline from the points, m: the uncertainty of a reading. With 0 the
        spline passes through every point.
    dwells : list of MeasuredDwell
        Exact dwells, in the order of the cam angle. A dwell may contain a gap of the points.
    source : str
        Source of the points.
    """

    law: Literal["table"]
    file: Annotated[MeasuredPoints, BeforeValidator(read_measured_points)]
    tolerance: Annotated[Quantity, must_be("length", ge=0.0, le=1.0)]
    dwells: list[MeasuredDwell] = Field(default=[], max_length=MAX_DWELLS)
    source: str = Field(min_length=1)

    @model_validator(mode="after")
    def _check_gaps(self) -> Table:
        degrees = [math.degrees(angle) for angle in self.file.angles]
        ends = zip(degrees, [*degrees[1:], degrees[0] + 360.0], strict=True)
        open_gaps = [
            (end - start, start)
            for start, end in ends
            if not any(d.contains(math.radians(start), math.radians(end)) for d in self.dwells)
        ]
        gap, start = max(open_gaps, default=(0.0, 0.0))
        if gap > MAX_GAP_DEG:
            raise ValueError(
                f"{self.file.file}: has no point for {gap:.4g}° after {start:.4g}°; allowed: gaps "
                f"of at most {MAX_GAP_DEG:g}° all around, so measure there too"
            )
        return self

    @model_validator(mode="after")
    def _check_dwells(self) -> Table:
        if self.dwells and self.tolerance.si == 0.0:
            raise ValueError("tolerance: is 0; allowed with dwells: greater than 0")
        starts = [dwell.start.si for dwell in self.dwells]
        nexts = [*starts[1:], *(start + TURN for start in starts[:1])]
        for i, (dwell, next_start) in enumerate(zip(self.dwells, nexts, strict=True)):
            end = math.degrees(dwell.start.si + dwell.span.si)
            if end > math.degrees(next_start) - MIN_EVENT_DEG:
                raise ValueError(
                    f"dwells[{i}]: ends at {end:g}°, the next starts at "
                    f"{math.degrees(next_start):g}°; allowed: dwells in the order of the cam "
                    f"angle, at least {MIN_EVENT_DEG:g}° apart"
                )
        return self

    @model_validator(mode="after")
    def _check_lifts(self) -> Table:
        angles, lifts = self.file.angles, self.file.lifts
        height = max(lifts) - min(lifts)
        if not height > 0.0:
            raise ValueError(f"{self.file.file}: all lifts are {lifts[0]:g} m; allowed: a lift")
        if self.tolerance.si > MAX_TOLERANCE * height:
            raise ValueError(
                f"tolerance: is {self.tolerance.si:g} m; allowed: at most "
                f"{MAX_TOLERANCE * height:g} m, {MAX_TOLERANCE:g} of the points' lift"
            )
        limit = MAX_CLOSING_TOLERANCES * self.tolerance.si + 1e-12 * height
        step = lifts[-1] - lifts[0]
        is_repeated = abs(angles[-1] - angles[0] - TURN) < 1e-9
        if is_repeated and abs(step) > limit:
            raise ValueError(
                f"{self.file.file}: does not close, the lift at 360° is {step:.6g} m above that "
                f"at 0°; allowed: {limit:.3g} m ({MAX_CLOSING_TOLERANCES:g} tolerances)"
            )
        return self

"""What all segments have: a span, and numbers by key; a law measured point by point."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field, FiniteFloat, ValidationInfo, model_validator

from cam_rig.errors import ConfigError
from cam_rig.files import MIB, read_bytes, shown
from cam_rig.schema.quantity import UNITS, Quantity, Strict, must_be
from cam_rig.units import TURN

Span = Annotated[Quantity, must_be("angle", gt=0.0, le=TURN * (1.0 + 1e-12))]
#: Ordinates, levels and coefficients in fractions of the lift.
Ratios = Annotated[Quantity, must_be("ratio", is_list=True, ge=-100.0, le=100.0)]
#: A length of the cam's own shape.
Length = Annotated[Quantity, must_be("length", gt=0.0, le=100.0)]


class SegmentBase(Strict):
    """A part of the turn."""

    span: Span


class WholeTurn(SegmentBase):
    """A law that goes once around: no other segment has a place beside it."""

    @model_validator(mode="after")
    def _whole(self) -> WholeTurn:
        degrees = math.degrees(self.span.si)
        if abs(degrees - 360.0) > 1e-9:
            raise ValueError(f"span: is {degrees:.9g}°; allowed: 360°, this law is a whole turn")
        return self


def quantities(node: BaseModel, prefix: str) -> Iterator[tuple[str, Quantity]]:
    """Every number of a config model by its key."""
    for key, value in node:
        items: list[tuple[str, object]] = [("", value)]
        if isinstance(value, list):
            items = [(f"[{i}]", item) for i, item in enumerate(value)]
        elif isinstance(value, dict):
            items = [(f".{name}", item) for name, item in value.items()]
        for at, item in items:
            if isinstance(item, Quantity):
                yield f"{prefix}{key}{at}", item
            elif isinstance(item, BaseModel):
                yield from quantities(item, f"{prefix}{key}{at}.")


#: Bytes of a file: of as many points as a law may have, each has room for 290.
MAX_BYTES = 2 * MIB
COLUMNS = {"angle": "angle", "lift": "length"}


def read_points(path: Path) -> tuple[list[float], list[float]]:
    """Angles (rad) and lifts (m) of a CSV file whose first line is as ``angle_deg,lift_mm``."""
    lines = _lines(path)
    if not lines:
        raise ValueError(f"{path.name}: is empty; allowed: a header line, then points")
    header = [cell.strip() for cell in lines[0][1]]
    columns = [_column(path.name, header, kind) for kind in COLUMNS]
    numbers: list[list[float]] = [[], []]
    for line, cells in lines[1:]:
        for (index, factor), into in zip(columns, numbers, strict=True):
            into.append(_number(path.name, line, cells, header, index) * factor)
    return numbers[0], numbers[1]


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """Cells of each line that holds any, with its number."""
    try:
        text = read_bytes(path, MAX_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        near = sorted(other.name for other in path.parent.glob("*.csv"))
        known = f"; there are: {', '.join(near)}" if near else ""
        raise ValueError(f"{path.name}: no such file beside the cam's file{known}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name}: cannot be read ({error})") from None
    except ConfigError as error:
        raise ValueError(f"{path.name}: {error}") from None
    found = []
    for line, row in enumerate(text.splitlines(), start=1):
        if row.strip() and not row.lstrip().startswith("#"):
            try:
                found.append((line, next(csv.reader([row]))))
            except csv.Error as error:  # a cell that is too long, or of bytes that are not text
                raise ValueError(f"{path.name}: line {line}: cannot be read ({error})") from None
    return found


def _column(name: str, header: list[str], kind: str) -> tuple[int, float]:
    """Index of the column of a kind, and the factor from its unit to SI."""
    units = UNITS[COLUMNS[kind]]
    found = [i for i, cell in enumerate(header) if cell.split("_")[0] == kind]
    if len(found) == 1:
        unit = header[found[0]].removeprefix(f"{kind}_")
        if unit in units:
            return found[0], units[unit]
    allowed = ", ".join(f"{kind}_{unit}" for unit in units)
    raise ValueError(
        f"{name}: columns are {shown(', '.join(header), False)}; allowed: one of {allowed}"
    )


def _number(name: str, line: int, cells: list[str], header: list[str], index: int) -> float:
    cell = cells[index].strip() if index < len(cells) else ""
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(
            f"{name}: line {line}: {header[index]} is {shown(cell)}; allowed: a finite number"
        )
    return number


#: Fewer points than this over a turn do not hold a cam's law, more are slow to no use.
FEWEST_POINTS, MAX_POINTS = 12, 7200
#: A wider gap than this (deg) leaves the law there to chance.
WIDEST_GAP_DEG = 45.0
#: Dwells of one turn, at most.
MAX_DWELLS = 36
#: Two dwells are so far apart (deg) at least, ...
LEAST_EVENT_DEG = 1.0
#: ... and a point at a dwell's end (rad) is in it.
ROUNDING = 1e-9
#: Where a table repeats its first point at 360°, the two may differ by so many tolerances.
CLOSING_TOLERANCES = 3.0
#: A spline that may be further from the points than this fraction of their lift is another cam.
MAX_TOLERANCE = 0.05


class MeasuredPoints(Strict):
    """What a file of points holds: cam angles in rad, rising, and lifts in m."""

    file: str
    angles: tuple[FiniteFloat, ...] = Field(min_length=FEWEST_POINTS)
    lifts: tuple[FiniteFloat, ...] = Field(min_length=FEWEST_POINTS)


def _read(value: Any, info: ValidationInfo) -> Any:
    """The points of a file name; already read ones as they are (a config that was copied)."""
    if not isinstance(value, str):
        return value
    if Path(value).name != value or not value.endswith(".csv"):
        raise ValueError(f"is {value!r}; allowed: the name of a .csv file beside the cam's file")
    folder = (info.context or {}).get("folder", Path())
    angles, lifts = read_points(folder / value)
    if not FEWEST_POINTS <= len(angles) <= MAX_POINTS:
        raise ValueError(
            f"{value}: has {len(angles)} points; allowed: {FEWEST_POINTS} to {MAX_POINTS}"
        )
    degrees = [math.degrees(angle) for angle in angles]
    for i, (one, other) in enumerate(pairwise(degrees)):
        if other <= one:
            raise ValueError(
                f"{value}: point {i + 2} is at {other:g}° after {one:g}°; allowed: rising angles, "
                "so sort the points and leave out repeated ones"
            )
    if degrees[0] < 0.0 or degrees[-1] > 360.0 + 1e-9:
        raise ValueError(
            f"{value}: angles are {degrees[0]:g}° to {degrees[-1]:g}°; allowed: 0° to 360°"
        )
    return {"file": value, "angles": angles, "lifts": lifts}


class MeasuredDwell(Strict):
    """A stretch in which the follower rests, exactly: ``level`` as the file's lifts have it."""

    start: Annotated[Quantity, must_be("angle", ge=0.0, le=TURN)]
    span: Annotated[Quantity, must_be("angle", gt=0.0, le=TURN)]
    level: Annotated[Quantity, must_be("length", ge=-100.0, le=100.0)]

    def holds(self, start: float, stop: float) -> bool:
        """Whether a stretch of the turn (rad) lies inside."""
        before = (start - self.start.si + ROUNDING) % TURN
        return before + (stop - start) <= self.span.si + 2.0 * ROUNDING


class Table(WholeTurn):
    """Points (angle, lift) of a whole turn, joined by a smooth periodic spline.

    ``tolerance`` is the r.m.s. distance (m) of the spline from the points: what a reading of
    them is worth. With 0 the spline goes through every point. ``dwells``, in the order of the cam
    angle, are exact; a stretch without points is allowed inside of one.
    """

    law: Literal["table"]
    file: Annotated[MeasuredPoints, BeforeValidator(_read)]
    tolerance: Annotated[Quantity, must_be("length", ge=0.0, le=1.0)]
    dwells: list[MeasuredDwell] = Field(default=[], max_length=MAX_DWELLS)
    source: str = Field(min_length=1)

    @model_validator(mode="after")
    def _all_around(self) -> Table:
        degrees = [math.degrees(angle) for angle in self.file.angles]
        ends = zip(degrees, [*degrees[1:], degrees[0] + 360.0], strict=True)
        open_gaps = [
            (end - start, start)
            for start, end in ends
            if not any(d.holds(math.radians(start), math.radians(end)) for d in self.dwells)
        ]
        gap, start = max(open_gaps, default=(0.0, 0.0))
        if gap > WIDEST_GAP_DEG:
            raise ValueError(
                f"{self.file.file}: has no point for {gap:.4g}° after {start:.4g}°; allowed: gaps "
                f"of at most {WIDEST_GAP_DEG:g}° all around, so measure there too"
            )
        return self

    @model_validator(mode="after")
    def _apart(self) -> Table:
        if self.dwells and self.tolerance.si == 0.0:
            raise ValueError("tolerance: is 0; allowed beside dwells: greater than 0")
        starts = [dwell.start.si for dwell in self.dwells]
        nexts = [*starts[1:], *(start + TURN for start in starts[:1])]
        for i, (dwell, after) in enumerate(zip(self.dwells, nexts, strict=True)):
            end = math.degrees(dwell.start.si + dwell.span.si)
            if end > math.degrees(after) - LEAST_EVENT_DEG:
                raise ValueError(
                    f"dwells[{i}]: ends at {end:g}°, the next begins at {math.degrees(after):g}°; "
                    "allowed: dwells in the order of the cam angle, at least "
                    f"{LEAST_EVENT_DEG:g}° apart"
                )
        return self

    @model_validator(mode="after")
    def _closes(self) -> Table:
        angles, lifts = self.file.angles, self.file.lifts
        height = max(lifts) - min(lifts)
        if not height > 0.0:
            raise ValueError(f"{self.file.file}: all lifts are {lifts[0]:g} m; allowed: a lift")
        if self.tolerance.si > MAX_TOLERANCE * height:
            raise ValueError(
                f"tolerance: is {self.tolerance.si:g} m; allowed: at most "
                f"{MAX_TOLERANCE * height:g} m, {MAX_TOLERANCE:g} of the points' lift"
            )
        limit = CLOSING_TOLERANCES * self.tolerance.si + 1e-12 * height
        step = lifts[-1] - lifts[0]
        repeated = abs(angles[-1] - angles[0] - TURN) < 1e-9
        if repeated and abs(step) > limit:
            raise ValueError(
                f"{self.file.file}: does not close, the lift at 360° is {step:.6g} m above that "
                f"at 0°; allowed: {limit:.3g} m ({CLOSING_TOLERANCES:g} tolerances)"
            )
        return self

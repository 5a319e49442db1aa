"""Measured points from a CSV file: a column of angles and one of lifts, units in the header."""

from __future__ import annotations

import csv
import math
from pathlib import Path

from cam_rig.errors import ConfigError
from cam_rig.files import MIB, read_bytes, shown
from cam_rig.schema.quantity import UNITS

#: Bytes of a file: of as many points as a law may have, each has room for 290.
MAX_BYTES = 2 * MIB
COLUMNS = {"angle": "angle", "lift": "length"}


def read_points(path: Path) -> tuple[list[float], list[float]]:
    """Angles (rad) and lifts (m) of a CSV file.

    The first line that is not empty and no ``#`` comment names the columns with their units,
    as in ``angle_deg,lift_mm``, in any order; other columns are not read.

    Raises
    ------
    ValueError : one line that names the file, the line and what is allowed
    """
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
    rows = enumerate(text.splitlines(), start=1)
    kept = [(i, row) for i, row in rows if row.strip() and not row.lstrip().startswith("#")]
    return [(i, _cells(path.name, i, row)) for i, row in kept]


def _cells(name: str, line: int, row: str) -> list[str]:
    try:
        return next(csv.reader([row]))
    except csv.Error as error:  # a cell that is too long, or of bytes that are not text
        raise ValueError(f"{name}: line {line}: cannot be read ({error})") from None


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

"""Contours and laws as CSV: full precision, units in the names of the columns."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError, ProfileError
from cam_rig.files import MIB, read_bytes, shown
from cam_rig.profile.curves.path import ContourPath
from cam_rig.schema.quantity import UNITS
from cam_rig.units import TURN

MM = 1e3
#: Bytes of a file of contours that is read: 80 000 points as `write_contour` writes them.
MAX_BYTES = 8 * MIB
HEADER = ("angle_deg", "x_mm", "y_mm", "curvature_radius_mm", "pressure_angle_deg")


def write_contour(path: Path, curves: list[ContourPath], count: int) -> None:
    """One row for each of ``count`` equal steps of the cam angle; a column more for two discs."""
    several = len(curves) > 1
    degrees = np.arange(count) * (360.0 / count)
    with path.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("disc", *HEADER) if several else HEADER)
        for number, curve in enumerate(curves, start=1):
            points, radius, pressure = curve.uniform(count)
            columns = (degrees, *(MM * points), MM * radius, np.degrees(pressure))
            for row in zip(*(column.tolist() for column in columns), strict=True):
                rows.writerow((number, *row) if several else row)


def write_law(path: Path, angle: FloatArray, lift: FloatArray) -> None:
    """Cam angles (rad) and lifts (m) as degrees and millimetres."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("angle_deg", "lift_mm"))
        rows.writerows(zip((angle * (360.0 / TURN)).tolist(), (MM * lift).tolist(), strict=True))


def read_contour(path: Path) -> list[FloatArray]:
    """The contours of a CSV file with columns ``x_mm`` and ``y_mm`` (or m, cm, in), in m.

    A column ``disc`` tells the contours apart.

    Raises
    ------
    ProfileError : no such columns, or something else than numbers in them
    """
    try:
        text = io.StringIO(read_bytes(path, MAX_BYTES).decode("utf-8-sig"), newline="")
        rows = [row for row in csv.reader(text) if row and not row[0].startswith("#")]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ProfileError(f"{path}: cannot be read ({error})") from None
    except ConfigError as error:
        raise ProfileError(f"{path}: {error}") from None
    names = [name.strip() for name in rows[0]] if rows else []
    unit = next((u for u in UNITS["length"] if {f"x_{u}", f"y_{u}"} <= set(names)), None)
    if unit is None:
        there = shown(", ".join(names), False) or "none"
        raise ProfileError(
            f"{path}: its columns are {there}; allowed: among them x_mm and y_mm (or m, cm, in)"
        )
    wanted = [names.index(f"x_{unit}"), names.index(f"y_{unit}")]
    points = np.array([_numbers(path, row, wanted) for row in rows[1:]]).reshape(-1, 2)
    discs = [_disc(path, row, names) for row in rows[1:]]
    labels = np.array(discs, dtype=str)
    factor = UNITS["length"][unit]
    return [factor * points[labels == name].T for name in dict.fromkeys(discs)]


def _disc(path: Path, row: list[str], names: list[str]) -> str:
    """Which disc a row is of."""
    if "disc" not in names:
        return ""
    if len(row) <= names.index("disc"):
        raise ProfileError(
            f"{path}: has the row {shown(','.join(row))}; allowed: {shown(','.join(names), False)}"
        )
    return row[names.index("disc")]


def _numbers(path: Path, row: list[str], columns: list[int]) -> list[float]:
    try:
        values = [float(row[column]) for column in columns]
    except (ValueError, IndexError):
        values = [np.nan]
    if not np.isfinite(values).all():
        raise ProfileError(f"{path}: has the row {shown(','.join(row))}; allowed: finite numbers")
    return values

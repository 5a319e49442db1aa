"""Closed polylines as DXF and SVG, mm, true to scale; contours and laws as CSV."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import ezdxf
import numpy as np
from ezdxf import units
from ezdxf.document import Drawing
from ezdxf.entities import LWPolyline, Polyline, Spline
from ezdxf.lldxf.const import DXFError
from ezdxf.path import make_path
from shapely import LineString, segmentize

from cam_rig.errors import ConfigError, OutputError, ProfileError
from cam_rig.files import MIB, read_bytes, shown
from cam_rig.profile.contact import Motion
from cam_rig.profile.polyline import ContourPath
from cam_rig.schema.quantity import UNITS
from cam_rig.units import TURN, FloatArray

# SVG drawings of closed polylines at scale 1: black on white, one unit of the page is 1 mm.

MM = 1e3
MARGIN_MM = 5.0
#: Decimals of a millimetre that there are at least: the lines are 0.25 mm wide.
COARSEST_DIGITS = 2
PAGE = """\
<?xml version="1.0" encoding="utf-8"?>
<svg xmlns="http://www.w3.org/2000/svg" width="{0}mm" height="{1}mm" viewBox="0 0 {0} {1}">
<rect width="{0}" height="{1}" fill="white"/>
<g fill="none" stroke="black" stroke-width="0.25" stroke-linejoin="round">
{2}
</g>
</svg>
"""


def write_svg(path: Path, curves: dict[str, FloatArray], rounding: float) -> None:
    """Write closed polylines by name, ``(2, n)`` points in m, as one path each.

    The page is of whole millimetres, 5 of them free around the curves. Points are absolute, so that
    what a reader rounds does not add up, and off by ``rounding`` (m) at most.
    """
    digits = max(COARSEST_DIGITS, math.ceil(-math.log10(math.sqrt(2.0) * MM * rounding)))
    every = MM * np.concatenate(list(curves.values()), axis=1)
    corner = np.array([every[0].min() - MARGIN_MM, every[1].max() + MARGIN_MM])
    width, height = np.ceil(np.ptp(every, axis=1) + 2.0 * MARGIN_MM).astype(int)
    paths = []
    for name, points in curves.items():
        placed = (MM * points.T - corner) * [1.0, -1.0]  # y of a page is down
        words = " ".join(f"{x:.{digits}f},{y:.{digits}f}" for x, y in placed.tolist())
        paths.append(f'<path id="{name}" d="M {words} Z"/>')
    path.write_text(PAGE.format(width, height, "\n".join(paths)), encoding="utf-8")


#: Units of length that are read, in m.
METRES = {units.MM: 1e-3, units.CM: 1e-2, units.M: 1.0, units.IN: 0.0254}
#: Arcs of a polyline (bulges) are read as chords with this error, m, and the whole of such a
#: polyline at so many points at least.
ARC_ERROR, ON_ARCS = 1e-9, 20_000
#: Thirds of the Bézier curves that stand for an arc: with 32 of them it is off by 1e-9 radii.
IN_ARC = 96
#: Points that are read of a spline, for each of its control points.
PER_CONTROL_POINT = 16


def to_document(curves: dict[str, FloatArray]) -> Drawing:
    """DXF R2010 with one closed polyline on each layer; points ``(2, n)`` in m."""
    document = ezdxf.new("R2010", units=units.MM)
    for layer, points in curves.items():
        document.layers.add(layer)
        space, attributes = document.modelspace(), {"layer": layer}
        space.add_lwpolyline((MM * points).T, close=True, dxfattribs=attributes)
    audit = document.audit()
    if audit.has_issues:
        raise OutputError(f"the drawing fails its audit: {audit.errors + audit.fixes}")
    return document


def read_dxf(path: Path) -> list[FloatArray]:
    """The closed curves of a drawing, ``(2, n)`` points in m each, in the file's order."""
    try:
        document = ezdxf.readfile(path)
    except (OSError, DXFError, UnicodeDecodeError) as error:
        raise ProfileError(f"{path}: cannot be read as DXF ({error})") from None
    if document.units not in METRES:
        raise ProfileError(
            f"{path}: its unit ($INSUNITS) is {units.unit_name(document.units)}; allowed: "
            "millimetres, centimetres, metres or inches"
        )
    factor = METRES[document.units]
    curves = [_points(entity, 1.0 / factor) for entity in document.modelspace() if _closed(entity)]
    if not curves:
        raise ProfileError(f"{path}: has no closed polyline or spline in its model space")
    return [factor * curve for curve in curves]


def _closed(entity: object) -> bool:
    if isinstance(entity, Polyline):
        return bool(entity.is_closed and (entity.is_2d_polyline or entity.is_3d_polyline))
    return isinstance(entity, LWPolyline | Spline) and bool(entity.closed)


def _points(entity: object, metre: float) -> FloatArray:
    """Points of a closed entity in its own unit; ``metre`` is one metre in it."""
    if isinstance(entity, Spline):  # the outer knots of an unclamped one lie beyond its range
        tool = entity.construction_tool()
        knots, degree = tool.knots(), tool.degree
        count = PER_CONTROL_POINT * len(tool.control_points)
        on = tool.points(np.linspace(knots[degree], knots[-degree - 1], count).tolist())
        return np.array([(p.x, p.y) for p in on], dtype=np.float64).T
    assert isinstance(entity, LWPolyline | Polyline)
    vertices = list(make_path(entity, segments=IN_ARC).flattening(ARC_ERROR * metre))
    points = np.array([(p.x, p.y) for p in vertices], dtype=np.float64)
    if entity.has_arc:  # its straight parts are meant as such: a spline through ends would bulge
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        points = np.array(segmentize(LineString(points), length / ON_ARCS).coords)
    return points[:-1].T if np.array_equal(points[0], points[-1]) else points.T


# Contours and laws as CSV: full precision, units in the names of the columns.

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
            points, radius, pressure = curve.of(Motion.uniform(curve.law, count))
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
    """The contours (m) of a CSV file with columns ``x_mm``, ``y_mm`` (or m, …) and ``disc``."""
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
    disc = names.index("disc") if "disc" in names else None
    for row in rows[1:]:
        if disc is not None and len(row) <= disc:
            allowed = shown(",".join(names), False)
            raise ProfileError(f"{path}: has the row {shown(','.join(row))}; allowed: {allowed}")
    discs = ["" if disc is None else row[disc] for row in rows[1:]]
    labels, factor = np.array(discs, dtype=str), UNITS["length"][unit]
    return [factor * points[labels == name].T for name in dict.fromkeys(discs)]


def _numbers(path: Path, row: list[str], columns: list[int]) -> list[float]:
    try:
        values = [float(row[column]) for column in columns]
    except (ValueError, IndexError):
        values = [np.nan]
    if not np.isfinite(values).all():
        raise ProfileError(f"{path}: has the row {shown(','.join(row))}; allowed: finite numbers")
    return values

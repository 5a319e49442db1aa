"""Files of contours and laws: drawings true to scale (DXF, SVG), and CSV tables.

A drawing consists of closed polylines in mm.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import ezdxf
import numpy as np
from ezdxf import units
from ezdxf.document import Drawing

from cam_rig.errors import OutputError
from cam_rig.profile.contact import Motion
from cam_rig.profile.polyline import ContourPath
from cam_rig.units import TURN, FloatArray

# SVG drawings of closed polylines at scale 1: black on white, one unit of the page is 1 mm.

#: Millimetres per metre.
MM = 1e3
#: Free margin of the page around the curves, mm.
MARGIN_MM = 5.0
#: Smallest number of decimals of the coordinates in an SVG drawing, in mm. It is sufficient for
#: lines of 0.25 mm.
COARSEST_DIGITS = 2
#: Template of an SVG page, with its width (mm), its height (mm) and its paths.
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
    """Write closed polylines by name as an SVG drawing, one path each.

    The points ``(2, n)`` are in m. The page has whole millimetres and a margin of 5 mm around the
    curves. Coordinates are absolute, so the rounding of a reader does not accumulate. They differ
    from the points by at most `rounding` (m).
    """
    digits = max(COARSEST_DIGITS, math.ceil(-math.log10(math.sqrt(2.0) * MM * rounding)))
    all_points = MM * np.concatenate(list(curves.values()), axis=1)
    corner = np.array([all_points[0].min() - MARGIN_MM, all_points[1].max() + MARGIN_MM])
    width, height = np.ceil(np.ptp(all_points, axis=1) + 2.0 * MARGIN_MM).astype(int)
    paths = []
    for name, points in curves.items():
        placed = (MM * points.T - corner) * [1.0, -1.0]  # y of a page points down
        coordinates = " ".join(f"{x:.{digits}f},{y:.{digits}f}" for x, y in placed.tolist())
        paths.append(f'<path id="{name}" d="M {coordinates} Z"/>')
    path.write_text(PAGE.format(width, height, "\n".join(paths)), encoding="utf-8")


def to_document(curves: dict[str, FloatArray]) -> Drawing:
    """Return a drawing (DXF R2010) with one closed polyline on each layer.

    The keys of `curves` are the layers. The points ``(2, n)`` are in m.
    """
    document = ezdxf.new("R2010", units=units.MM)
    for layer, points in curves.items():
        document.layers.add(layer)
        space, attributes = document.modelspace(), {"layer": layer}
        space.add_lwpolyline((MM * points).T, close=True, dxfattribs=attributes)
    audit = document.audit()
    if audit.has_issues:
        raise OutputError(f"the drawing fails its audit: {audit.errors + audit.fixes}")
    return document


# Contours and laws as CSV: full precision, units in the names of the columns.

#: Columns of a CSV table of a contour. A table of two discs has the column ``disc`` before them.
HEADER = ("angle_deg", "x_mm", "y_mm", "curvature_radius_mm", "pressure_angle_deg")


def write_contour(path: Path, curves: list[ContourPath], count: int) -> None:
    """Write contours as CSV, one row for each of `count` equal steps of the cam angle.

    The columns are those of `HEADER`. If there are two discs, the first column is the number of the
    disc, 1 or 2.
    """
    has_discs = len(curves) > 1
    degrees = np.arange(count) * (360.0 / count)
    with path.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("disc", *HEADER) if has_discs else HEADER)
        for number, curve in enumerate(curves, start=1):
            points, radius, pressure = curve.of(Motion.uniform(curve.law, count))
            columns = (degrees, *(MM * points), MM * radius, np.degrees(pressure))
            for row in zip(*(column.tolist() for column in columns), strict=True):
                rows.writerow((number, *row) if has_discs else row)


def write_law(path: Path, angle: FloatArray, lift: FloatArray) -> None:
    """Write cam angles (rad) and lifts (m) as CSV in degrees and millimetres."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("angle_deg", "lift_mm"))
        rows.writerows(zip((angle * (360.0 / TURN)).tolist(), (MM * lift).tolist(), strict=True))

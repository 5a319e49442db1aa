"""DXF drawings of closed polylines, mm, true to scale."""

from __future__ import annotations

from pathlib import Path

import ezdxf
import numpy as np
from ezdxf import units
from ezdxf.document import Drawing
from ezdxf.entities import LWPolyline, Polyline, Spline
from ezdxf.lldxf.const import DXFError
from ezdxf.path import make_path
from shapely import LineString, segmentize

from cam_rig.arrays import FloatArray
from cam_rig.errors import OutputError, ProfileError

MM = 1e3
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
    """A drawing with one closed polyline on each layer; points ``(2, n)`` in m.

    Raises
    ------
    OutputError : it would not pass its own audit
    """
    document = ezdxf.new("R2010", units=units.MM)
    for layer, points in curves.items():
        document.layers.add(layer)
        attributes = {"layer": layer}
        space = document.modelspace()
        space.add_lwpolyline((MM * points).T, close=True, dxfattribs=attributes)
    audit = document.audit()
    if audit.has_issues:
        raise OutputError(f"the drawing fails its audit: {audit.errors + audit.fixes}")
    return document


def write_dxf(path: Path, curves: dict[str, FloatArray]) -> None:
    """Write the drawing as DXF R2010."""
    to_document(curves).saveas(path)


def read_dxf(path: Path) -> list[FloatArray]:
    """The closed curves of a drawing, ``(2, n)`` points in m each, in the file's order.

    Raises
    ------
    ProfileError : it is no DXF file, names no unit of length, or has no closed curve
    """
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
    if isinstance(entity, LWPolyline | Spline):
        return bool(entity.closed)
    if isinstance(entity, Polyline) and (entity.is_2d_polyline or entity.is_3d_polyline):
        return bool(entity.is_closed)
    return False


def _points(entity: object, metre: float) -> FloatArray:
    """Points of a closed entity in its own unit; ``metre`` is one metre in it."""
    if isinstance(entity, Spline):
        return _on_spline(entity)
    assert isinstance(entity, LWPolyline | Polyline)
    vertices = list(make_path(entity, segments=IN_ARC).flattening(ARC_ERROR * metre))
    points = np.array([(p.x, p.y) for p in vertices], dtype=np.float64)
    if entity.has_arc:  # its straight parts are meant as such: a spline through ends would bulge
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        points = np.array(segmentize(LineString(points), length / ON_ARCS).coords)
    return points[:-1].T if np.array_equal(points[0], points[-1]) else points.T


def _on_spline(entity: Spline) -> FloatArray:
    """Points of its valid range: the outer knots of an unclamped spline lie beyond it."""
    tool = entity.construction_tool()
    knots, degree = tool.knots(), tool.degree
    count = PER_CONTROL_POINT * len(tool.control_points)
    points = tool.points(np.linspace(knots[degree], knots[-degree - 1], count).tolist())
    return np.array([(p.x, p.y) for p in points], dtype=np.float64).T

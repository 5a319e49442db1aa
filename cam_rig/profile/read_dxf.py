"""Reader of closed curves from DXF drawings of other programs."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import ezdxf
import numpy as np
from ezdxf import disassemble, units
from ezdxf.document import Drawing
from ezdxf.entities import (
    Arc,
    Circle,
    DXFEntity,
    DXFGraphic,
    Ellipse,
    Insert,
    Line,
    LWPolyline,
    Polyline,
    Spline,
)
from ezdxf.lldxf.const import DXFError
from ezdxf.path import make_path
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree
from shapely import LineString, segmentize

from cam_rig.errors import ProfileError
from cam_rig.files import read_bytes
from cam_rig.profile.contour_files import (
    MAX_BYTES,
    MAX_HEIGHT,
    MAX_SIZE,
    UNPLACED,
    ContourFile,
    Placement,
    encloses_axis,
    require_size,
)
from cam_rig.schema.quantity import UNITS
from cam_rig.units import FloatArray

#: Names of the accepted units of a drawing (DXF header variable $INSUNITS).
UNIT_NAMES = {units.MM: "mm", units.CM: "cm", units.M: "m", units.IN: "in"}
#: Types of DXF entities of which a contour can consist.
CURVES = (Line, Arc, Circle, Ellipse, Spline, LWPolyline, Polyline)
#: Largest accepted number of entities of a drawing, including those of its blocks.
MAX_ENTITIES = 100_000
#: Largest distance of an arc or a spline from the chords that replace it, m. It is below the errors
#: of a machine tool.
ARC_ERROR = 1e-9
#: Smallest number of points of a curve with arcs or splines. Its straight parts are divided into
#: many points, because a spline through only their ends would bulge.
ARC_POINTS = 20_000
#: Number of Bézier curves with which `ezdxf.path.make_path` replaces a circle, an arc or an
#: ellipse. An arc of a polyline gets a third of them, 32, whose error is at most 1e-9 of the
#: radius.
ARC_SEGMENTS = 96
#: Number of points of a curve at which the refinement of its chords stops.
MAX_POINTS = 1_000_000
#: Largest distance (m) between the ends of two entities of a drawing that are joined. Programs
#: write 3 to 16 decimals of mm.
JOIN_DISTANCE = 5e-6
#: Largest difference of the distances of a curve's points from the cam's axis (m) with which the
#: curve counts as a circle around the axis.
MAX_ECCENTRICITY = 1e-6
#: Largest radius of a bore with its keyway, as a fraction of the smallest radius of the curve
#: around it. A larger curve may be a contour inside of its pitch curve, because a roller is seldom
#: larger than its cam.
MAX_BORE_RATIO = 0.5
#: Smallest number of lines of a closed curve of straight lines that can be a contour. If the
#: drawing has other curves, a curve with fewer lines counts as a frame or a keyway.
MIN_LINES = 12


@dataclass
class _Curve:
    """Curve of one entity of a drawing, or of several joined entities."""

    points: FloatArray  #: points in the frame of the drawing, `(n, 2)`, m
    #: True if the curve contains arcs or splines. Its lines are then straight parts of the contour,
    #: and not chords of a curve.
    is_exact: bool
    tilted: str = ""  #: text on an entity that is not in a plane of constant z, or empty

    @property
    def is_closed(self) -> bool:
        """True if the first and the last point of the curve coincide.

        The tolerance is `JOIN_DISTANCE`.
        """
        gap = float(np.hypot(*(self.points[0] - self.points[-1])))
        return len(self.points) > 2 and gap <= JOIN_DISTANCE

    def outline(self) -> FloatArray:
        """Return the points `(2, n)` (m) of a closed curve, each once.

        The first point is not repeated at the end. A curve with arcs or splines has at least
        `ARC_POINTS` points.
        """
        points = self.points
        if self.is_exact:
            length = float(np.hypot(*np.diff(points, axis=0).T).sum())
            points = np.array(segmentize(LineString(points), length / ARC_POINTS).coords)
        return points[:-1].T


def read_dxf(
    path: Path,
    placement: Placement = UNPLACED,
    layer: str | None = None,
    count: int | None = None,
) -> ContourFile:
    """Read the closed curves of a DXF drawing, which may be contours of a cam.

    Closed curves are closed polylines, circles, ellipses and splines, and chains of lines, arcs,
    splines and open polylines whose ends meet. Blocks are resolved.

    Parameters
    ----------
    path
        The drawing, ASCII or binary, of any version that ezdxf reads.
    placement
        Unit of a drawing without one, axis and zero direction.
    layer
        Name of the only layer that is read, even if it is off or frozen. By default all visible
        entities are read.
    count
        Number of contours of the cam. If the drawing has more closed curves, its frame, and curves
        inside of another such as a bore, are left out (default: all curves are returned).

    Raises
    ------
    ProfileError
        The file is not a DXF drawing, has no known unit, or no closed curve.
    """
    document, every = _read_drawing(path)
    unit = _find_unit(path, document, placement)
    entities = (
        _select_visible(document, every) if layer is None else _select_layer(path, every, layer)
    )
    notes = list[str]()
    if hidden := len(every) - len(entities) if layer is None else 0:
        notes.append(
            f"{hidden} {'entity' if hidden == 1 else 'entities'} ignored: invisible, or on a layer "
            "that is off or frozen (--layer reads them)"
        )
    factor = UNITS["length"][unit]
    drawn = [_read_curve(path, entity, factor) for entity in entities if isinstance(entity, CURVES)]
    distinct = _without_duplicates(drawn)
    if duplicates := len(drawn) - len(distinct):
        noun = "entity" if duplicates == 1 else "entities"
        notes.append(f"{duplicates} {noun} ignored: drawn twice")
    curves = [curve for curve in distinct if curve.is_closed]
    loose = [curve for curve in distinct if not curve.is_closed]
    chains, ends = _join_chains(loose)
    curves += chains
    if not curves:
        more = "".join(f" {note}" for note in notes)
        raise ProfileError(
            f"{path}: has no closed curve: {_describe_contents(document, layer)}{ends}{more}"
        )
    outer = curves if count is None or len(curves) <= count else _select_outer(curves)
    if tilted := next((curve.tilted for curve in outer if curve.tilted), ""):
        raise ProfileError(f"{path}: {tilted}; allowed: a drawing in the xy plane")
    if len(outer) < len(curves):
        number = len(curves) - len(outer)
        noun = "closed curve" if number == 1 else "closed curves"
        notes.append(f"{number} {noun} left out: frames, or inside of another")
    if ends:
        notes.append(f"left out{ends}")
    notes.append(f"unit {unit}; {placement.note()}")
    placed = [placement.place(curve.outline()) for curve in outer]
    for points in placed:
        require_size(path, points)
    chosen = set(map(id, outer))
    others = [placement.place(curve.points.T) for curve in curves if id(curve) not in chosen]
    if any(_is_cam_inside(other, outline) for outline in placed for other in others):
        raise ProfileError(
            f"{path}: has a closed curve around the axis and, inside of it, another such as a "
            "contour inside of its pitch curve; allowed: one contour, so read its layer with "
            "--layer, or delete the other curve"
        )
    return ContourFile(placed, False, notes)


def _is_centred(points: FloatArray) -> bool:
    """Return True if points `(2, n)` (m) are on a circle around the cam's axis.

    Such a contour is that of a cam without lift.
    """
    return bool(np.ptp(np.hypot(*points)) <= MAX_ECCENTRICITY)


def _is_cam_inside(points: FloatArray, outline: FloatArray) -> bool:
    """Return True if a curve inside of an outline could be the contour of the cam.

    Both are points `(2, n)` (m) in the frame of the cam. A circle around the axis is not a contour,
    and neither is a small curve, which is a bore with a keyway. If the outline is a circle around
    the axis, it may be the blank of the cam, and a curve inside of it may have any size.
    """
    radius, outer = float(np.hypot(*points).max()), np.hypot(*outline)
    is_large = _is_centred(outline) or radius > MAX_BORE_RATIO * outer.min()
    is_inside = radius < outer.max()
    return bool(is_inside and is_large and encloses_axis(points) and not _is_centred(points))


#: Errors that ezdxf raises for damaged files. It raises many types, because it reads the tags of a
#: file before it checks their structure.
DAMAGE_ERRORS = (
    *(OSError, DXFError, ValueError, ArithmeticError, LookupError),
    *(AttributeError, AssertionError, StopIteration),
)
# ezdxf logs unknown entities, which do not belong to a contour
logging.getLogger("ezdxf").addHandler(logging.NullHandler())


def _read_drawing(path: Path) -> tuple[Drawing, list[DXFEntity]]:
    """Return a drawing and the curve entities of its model space and its blocks.

    Raises
    ------
    ProfileError
        If the file does not exist, cannot be read, or has too many entities.
    """
    try:
        data = read_bytes(path, MAX_BYTES)  # rejects large files, pipes and devices
        document = ezdxf.readfile(path)
        if b"$INSUNITS" not in data:  # ezdxf adds metres to a file without a header
            document.units = 0
        drawn = [e for e in document.modelspace() if isinstance(e, (*CURVES, Insert))]
        count = _count_entities(document, drawn, {})
        every = disassemble.recursive_decompose(drawn)  # expands the blocks
        entities = list(islice(every, MAX_ENTITIES + 1 if count <= MAX_ENTITIES else 0))
    except FileNotFoundError:
        raise ProfileError(f"{path}: no such file") from None
    except DAMAGE_ERRORS as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise ProfileError(f"{path}: cannot be read as DXF ({text})") from None
    except RecursionError:
        raise ProfileError(f"{path}: a block contains itself; allowed: blocks of curves") from None
    if max(count, len(entities)) > MAX_ENTITIES:
        raise ProfileError(f"{path}: has more than {MAX_ENTITIES} entities; allowed: fewer")
    return document, entities


def _count_entities(
    document: Drawing, entities: Iterable[DXFEntity], of_blocks: dict[str, int]
) -> int:
    """Return the number of entities, including those of blocks, without expanding them.

    An empty block counts as an entity. `of_blocks` stores the number of entities of each block that
    has been counted, by its name.
    """
    total = 0
    for entity in entities:
        number = 1
        if isinstance(entity, Insert):
            name = entity.dxf.name
            if name not in of_blocks:
                of_blocks[name] = _count_entities(
                    document, document.blocks.get(name) or (), of_blocks
                )
            number = entity.mcount * max(1, of_blocks[name])
        total += number
    return total


def _find_unit(path: Path, document: Drawing, placement: Placement) -> str:
    unit = UNIT_NAMES.get(document.units)
    if unit is not None and placement.unit not in (None, unit):
        raise ProfileError(
            f"{path}: its unit ($INSUNITS) is {unit}, not {placement.unit}; allowed: --unit for a "
            "drawing without a unit"
        )
    name = unit or (placement.unit if document.units == 0 else None)
    if name is None:
        text = units.unit_name(document.units) if document.units else "not stated"
        raise ProfileError(
            f"{path}: its unit ($INSUNITS) is {text}; allowed: millimetres, centimetres, metres or "
            "inches, or --unit mm, cm, m or in for a drawing without a unit"
        )
    return name


def _select_visible(document: Drawing, entities: list[DXFEntity]) -> list[DXFEntity]:
    """Return the entities of a drawing that a CAD program displays."""
    off = {layer.dxf.name.lower() for layer in document.layers if layer.is_off()}
    frozen = {layer.dxf.name.lower() for layer in document.layers if layer.is_frozen()}

    def is_visible(entity: DXFEntity) -> bool:
        names = list[str]()  # layers of the entity and of the blocks around it
        part: DXFEntity | None = entity
        while part is not None:
            if part.dxf.get("invisible", 0):
                return False
            names.append(part.dxf.get("layer", "0").lower())
            part = part.source_block_reference
        name = next((name for name in names if name != "0"), "0")  # layer 0 is that of the block
        return name not in off and frozen.isdisjoint(names)

    return [entity for entity in entities if is_visible(entity)]


def _select_layer(path: Path, entities: list[DXFEntity], layer: str) -> list[DXFEntity]:
    layers = sorted({entity.dxf.get("layer", "0") for entity in entities})
    if layer not in layers:
        raise ProfileError(f"{path}: has no layer {layer!r}; allowed: {', '.join(layers[:20])}")
    return [entity for entity in entities if entity.dxf.get("layer", "0") == layer]


def _without_duplicates(curves: list[_Curve]) -> list[_Curve]:
    """Return the curves without those that repeat another one.

    A curve with the same points in the opposite order is a repetition too.
    """
    distinct = dict[bytes, _Curve]()
    for curve in curves:
        if curve.points[::-1].tobytes() not in distinct:
            distinct.setdefault(curve.points.tobytes(), curve)
    return list(distinct.values())


def _read_curve(path: Path, entity: DXFGraphic, factor: float) -> _Curve:
    """Return an entity of a drawing as a curve.

    `factor` is the unit of the drawing in m. `path` is the file in the message of a `ProfileError`
    for an entity that cannot be read.
    """
    try:
        return _convert_to_curve(path, entity, factor)
    except ProfileError:
        raise
    except DAMAGE_ERRORS as error:
        text = str(error) or type(error).__name__
        raise ProfileError(f"{path}: {_name(entity)} cannot be read ({text})") from None


def _convert_to_curve(path: Path, entity: DXFGraphic, factor: float) -> _Curve:
    if isinstance(entity, Spline):
        points = _flatten(path, entity, factor)
        require_size(path, points)
        z = factor * np.array([p.z for p in entity.construction_tool().control_points])
        return _Curve(points, True, _describe_tilt(entity, z))
    outline = make_path(entity, segments=ARC_SEGMENTS)
    control = factor * np.array([(p.x, p.y) for p in outline.control_vertices()]).reshape(-1, 2)
    if not control.size or not np.isfinite(control).all() or np.abs(control).max() > MAX_SIZE:
        raise _no_points_error(path, entity)
    vertices = islice(outline.flattening(ARC_ERROR / factor), MAX_POINTS)
    points = factor * np.array([(p.x, p.y) for p in vertices]).reshape(-1, 2)
    is_closed = isinstance(entity, LWPolyline | Polyline) and entity.is_closed
    if is_closed and not np.array_equal(points[0], points[-1]):
        points = np.append(points, points[:1], axis=0)
    z = factor * np.array([p.z for p in outline.control_vertices()])
    return _Curve(points, outline.has_curves, _describe_tilt(entity, z))


def _flatten(path: Path, entity: Spline, factor: float) -> FloatArray:
    """Return points `(n, 2)` (m) of a spline whose chords are within `ARC_ERROR` of it.

    Each chord is divided into thirds until the distance of the spline from the chord at both thirds
    is at most `ARC_ERROR`. A cubic curve that is on its chord at both thirds is straight. `factor`
    is the unit of the drawing in m.
    """
    tool = entity.construction_tool()
    control = factor * np.array([(p.x, p.y) for p in tool.control_points])
    if not np.isfinite(control).all() or np.abs(control).max() > MAX_SIZE:
        raise _no_points_error(path, entity)
    weight = np.array(tool.weights() or np.ones(len(control)))[:, None]
    if not (weight > 0.0).all():
        raise ValueError("a weight is not positive")
    knots, degree = np.array(tool.knots()), tool.degree
    spline = BSpline(knots, np.hstack([control * weight, weight]), degree)
    # the outer knots of an unclamped spline lie beyond its range
    parameters = np.unique(knots[degree : len(knots) - degree])
    points = _evaluate(spline, parameters)
    divided = np.arange(len(parameters) - 1)  # indices of the chords that are still to be checked
    while divided.size and len(parameters) < MAX_POINTS:
        thirds = (
            parameters[divided, None]
            + np.diff(parameters)[divided, None] * np.array([1.0, 2.0]) / 3.0
        )
        inner = _evaluate(spline, thirds.ravel()).reshape(-1, 2, 2)
        start, chord = points[divided, None], np.diff(points, axis=0)[divided, None]
        foot = start + chord * np.array([1.0, 2.0])[:, None] / 3.0
        (x, y), (u, v) = np.moveaxis(inner - foot, -1, 0), np.moveaxis(chord, -1, 0)
        length = np.hypot(u, v)
        across = np.abs(u * y - v * x) / np.maximum(length, ARC_ERROR)
        distance = np.where(length > ARC_ERROR, across, np.hypot(x, y))
        far = (distance > ARC_ERROR).any(axis=1)
        where = np.repeat(divided[far] + 1, 2)
        parameters = np.insert(parameters, where, thirds[far].ravel())
        points = np.insert(points, where, inner[far].reshape(-1, 2), axis=0)
        first = divided[far] + 2 * np.arange(np.count_nonzero(far))
        divided = (first[:, None] + np.arange(3)).ravel()
    return points


def _evaluate(spline: BSpline, parameters: FloatArray) -> FloatArray:
    """Return points `(n, 2)` of a rational spline at n parameter values.

    `spline` has homogeneous coordinates (x w, y w, w) with the weight w.
    """
    x, y, weight = spline(parameters).T
    return np.column_stack([x / weight, y / weight])


def _no_points_error(path: Path, entity: DXFEntity) -> ProfileError:
    return ProfileError(
        f"{path}: {_name(entity)} has no finite points within {MAX_SIZE:g} m; allowed: a "
        "contour of a cam, so check unit and bulges"
    )


def _describe_tilt(entity: DXFEntity, z: FloatArray) -> str:
    """Return a text on an entity that is not parallel to the xy plane, or an empty text.

    `z` are its coordinates z in m. The text contains the name of the entity and the range of z.
    """
    height = float(np.ptp(z))
    if height <= MAX_HEIGHT:
        return ""
    return f"{_name(entity)} is not parallel to the xy plane: its z varies by {height * 1e3:.4g} mm"


def _name(entity: DXFEntity) -> str:
    return f"{entity.dxftype()} of layer {entity.dxf.get('layer', '0')!r}"


def _join_chains(loose: list[_Curve]) -> tuple[list[_Curve], str]:
    """Join open curves whose ends meet to closed curves.

    Returns the closed curves, and a text on the chains that remain open, for a message. The text is
    empty if there are none.
    """
    if not loose:
        return [], ""
    # Row 2i contains the first point of curve i, row 2i + 1 its last point.
    ends = np.array([[curve.points[0], curve.points[-1]] for curve in loose]).reshape(-1, 2)
    tree = cKDTree(ends)
    meeting = [tree.query_ball_point(end, JOIN_DISTANCE) for end in ends]
    free, closed, open_chains = set(range(len(loose))), list[_Curve](), list[_Curve]()
    while free:
        first = min(free)
        free.remove(first)
        behind = _walk(2 * first + 1, meeting, free)
        before = [end ^ 1 for end in reversed(_walk(2 * first, meeting, free))]
        entered = [*before, 2 * first, *behind]  # the end at which the chain enters each curve
        parts = [loose[end // 2].points[:: 1 if end % 2 == 0 else -1] for end in entered]
        points = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
        members = [loose[end // 2] for end in entered]
        tilted = next((curve.tilted for curve in members if curve.tilted), "")
        chain = _Curve(points, any(curve.is_exact for curve in members), tilted)
        (closed if chain.is_closed else open_chains).append(chain)
    if not open_chains:
        return closed, ""
    longest = max(open_chains, key=lambda chain: len(chain.points))
    (x, y), (u, v) = longest.points[0] * 1e3, longest.points[-1] * 1e3
    count = len(open_chains)
    several = f"{count} open curves, one" if count > 1 else "an open curve"
    return closed, f" {several} from ({x:.6g}, {y:.6g}) to ({u:.6g}, {v:.6g}) mm"


def _walk(tip: int, meeting: Sequence[list[int]], free: set[int]) -> list[int]:
    """Follow a chain of curves whose ends meet, from the end `tip` on.

    Ends are numbered: 2i is the start of curve i, 2i + 1 its end. `meeting` contains the numbers of
    the ends at the position of each end, and `free` the indices of the curves that are not yet in
    a chain. Returns the ends at which the chain enters the curves, which are removed from `free`.
    """
    entered = []
    while (end := next((e for e in meeting[tip] if e // 2 in free), None)) is not None:
        free.remove(end // 2)
        entered.append(end)
        tip = end ^ 1
    return entered


def _select_outer(every: list[_Curve]) -> list[_Curve]:
    """Return the curves that are not inside of another curve, without frames.

    A frame is a curve of few straight lines (see `MIN_LINES`). A curve is inside of another one if
    its bounding box is.
    """
    shaped = [curve for curve in every if curve.is_exact or len(curve.points) > MIN_LINES]
    curves = shaped or every
    boxes = [np.array([c.points.min(axis=0), c.points.max(axis=0)]) for c in curves]
    return [
        curve
        for curve, box in zip(curves, boxes, strict=True)
        if not any((other[0] < box[0]).all() and (box[1] < other[1]).all() for other in boxes)
    ]


def _describe_contents(document: Drawing, layer: str | None) -> str:
    """Return a text with the number of entities of each type in a drawing.

    The text also states which entities are needed. It is part of a message for a drawing without a
    closed curve. `layer` is the only layer that was read, or None.
    """
    counts = Counter(entity.dxftype() for entity in document.modelspace())
    listed = ", ".join(f"{count} {kind}" for kind, count in counts.most_common(8)) or "nothing"
    where = "" if layer is None else f" on layer {layer!r}"
    return (
        f"its model space has {listed}; allowed{where}: lines, arcs, circles, ellipses, splines "
        f"and polylines whose ends meet within {JOIN_DISTANCE * 1e3:g} mm."
    )

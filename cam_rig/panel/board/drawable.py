"""Cams whose law can be drawn: Bézier and B-spline segments, and dwells.

A cam that consists of these segments has ordinates (control values) in its file. Of any other cam,
each event is converted to a B-spline. An event is the part of the turn between two dwells. The
conversion is exact if the law consists of polynomials. Otherwise the result is the nearest B-spline
in s and s''.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline as Spline

from cam_rig.errors import ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import MAX_CONTINUITY, joints
from cam_rig.schema import CamConfig
from cam_rig.schema.load import quantity_data, validate_cam
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.segments import MAX_B_SPLINE_DEGREE, MAX_B_SPLINE_ORDINATES, Bezier, BSpline
from cam_rig.studies.design.result import spline_cam_data
from cam_rig.studies.design.space import LawEvent, events
from cam_rig.units import TURN, FloatArray

#: Smallest number of polynomial pieces of the B-spline of an event, the part of the turn between
#: two dwells.
MIN_PIECES = 16
#: Largest cam angle of a polynomial piece of a B-spline that can be drawn, rad: 12°.
MAX_PIECE_SPAN = TURN / 30
#: Smallest degree of the polynomial pieces. At this degree s''' stays continuous at the knots
#: between the joints of the law when any ordinate is moved.
MIN_DEGREE = 5
#: Highest derivative that stays continuous at a joint between two segments of the law when a user
#: drags a control point of the curve.
MAX_KEPT_CONTINUITY = 3
#: Number of Gauss points per polynomial piece at which the drawn law is compared with the law of
#: the cam file.
GAUSS_POINTS = 16
#: Weight of an error of s (in lifts) relative to an error of s'' (in its r.m.s. value). With s''
#: alone the error of a law of arcs, whose s'' has steps, is an eighth of the lift. With s alone the
#: B-spline oscillates between the steps.
LIFT_WEIGHT = 10.0
#: Number of points per turn at which the largest distance between the drawn law and the law of the
#: cam file is computed.
COMPARED_POINTS = 3600
#: Largest distance between the drawn law and the law of the cam file that counts as rounding,
#: relative to the lift.
ROUNDING_RTOL = 1e-12
#: Segment types whose ordinates can be drawn.
DRAWABLE_SEGMENTS = (Bezier, BSpline)
DrawableSegment = Bezier | BSpline


@dataclass(frozen=True, eq=False)
class DrawableCam:
    """Cam whose ordinates (control values) can be moved, with its law.

    If `has_file_ordinates` is True, the ordinates are those of the cam file. Otherwise they are
    those of B-splines whose largest distance from the file's law is `distance` (m).
    """

    cam: CamConfig
    law: Law
    has_file_ordinates: bool
    distance: float

    @property
    def exact(self) -> bool:
        """True if the drawn law equals the file's law within rounding."""
        return self.distance <= ROUNDING_RTOL * self.law.lift


def with_file_ordinates(cam: CamConfig) -> DrawableCam | None:
    """Return a cam whose file contains ordinates that can be moved.

    Returns None unless all segments are Bézier curves, B-splines or dwells, and at least one is not
    a dwell.
    """
    kinds = {type(segment) for segment in cam.segments if segment.law != "dwell"}
    if not kinds or not kinds <= set(DRAWABLE_SEGMENTS):
        return None
    return DrawableCam(cam, build_law(cam), True, 0.0)


def to_b_splines(cam: CamConfig) -> DrawableCam:
    """Convert a cam to a cam with one B-spline per event.

    An event is the part of the turn between two dwells. The B-splines are exact if the law consists
    of polynomials. Otherwise they are the nearest B-splines.
    """
    law = build_law(cam)
    law_events = events(law, 0)
    splines = [
        {
            "degree": int(spline.k),
            # without scipy's outermost knots
            "knots": quantity_data(
                "assumed", spline.t[1:-1].tolist(), "1", f"joints of {cam.name}, and between"
            ),
            "ordinates": quantity_data(
                "identified", (spline.c + 0.0).tolist(), "1", f"the law of {cam.name}"
            ),
        }
        for spline in (_nearest(law, event) for event in law_events)
    ]
    drawn = validate_cam(spline_cam_data(cam, law, law_events, splines, cam.name, cam.title))
    drawn_law = build_law(drawn)
    angles = np.linspace(0.0, TURN, COMPARED_POINTS, endpoint=False)
    distance = float(np.abs(drawn_law(angles) - law(angles)).max())
    return DrawableCam(drawn, drawn_law, False, distance)


def _nearest(law: Law, event: LawEvent) -> Spline:
    """Return the B-spline nearest to the law in one event.

    An event is the part of the turn between two dwells. The B-spline is in lifts over [0, 1]. It is
    a least-squares fit of s and s''. The derivatives at both ends are those of the law. Raises
    ConfigError if the event needs more ordinates than a cam file may contain.
    """
    degree = law.degree if MIN_DEGREE <= law.degree <= MAX_B_SPLINE_DEGREE else MIN_DEGREE
    knots, smooth = _knots(law, event, degree)
    count = knots.size - degree - 1
    if count > MAX_B_SPLINE_ORDINATES:
        raise ConfigError(
            f"{law.name}: its law has too many pieces from {math.degrees(event.start):.4g}° on, "
            f"which need {count} ordinates; allowed: {MAX_B_SPLINE_ORDINATES}; use cam-rig fit"
        )
    basis = Spline(knots, np.eye(count), degree)
    ends = [np.arange(smooth[0] + 1), count - 1 - np.arange(smooth[1] + 1)]
    ordinates = np.zeros(count)
    for end, fixed in enumerate(ends):
        rows = [basis(float(end), k)[fixed] for k in range(fixed.size)]
        derivatives = _end_derivatives(law, event, end, fixed.size)
        ordinates[fixed] = np.linalg.solve(np.array(rows), derivatives)
    nodes, edges = 0.5 * (np.polynomial.legendre.leggauss(GAUSS_POINTS)[0] + 1.0), np.unique(knots)
    u = (edges[:-1, None] + np.diff(edges)[:, None] * nodes).ravel()
    lift, curvature = (law(event.start + event.span * u, k) / law.lift for k in (0, 2))
    curvature *= event.span**2
    rms = math.sqrt(float(np.mean(curvature**2))) or 1.0
    target = np.concatenate([curvature / rms, LIFT_WEIGHT * lift])
    matrix = np.concatenate([basis(u, 2) / rms, LIFT_WEIGHT * basis(u)])
    free = np.setdiff1d(np.arange(count), np.concatenate(ends))
    ordinates[free] = np.linalg.lstsq(matrix[:, free], target - matrix @ ordinates)[0]
    return Spline(knots, ordinates, degree)


def _knots(law: Law, event: LawEvent, degree: int) -> tuple[FloatArray, list[int]]:
    """Return the knots of the B-spline of an event, and the continuity at its ends.

    The knots are in [0, 1]. They contain the joints of the law, and further knots between them. The
    continuity of an end is the order of the highest derivative that must stay continuous there.
    """
    continuity = {joint.angle: joint.continuity for joint in joints(law)}
    ends = [np.argmin(np.abs(law.breaks - event.start - u * event.span)) for u in (0, 1)]
    edges = law.breaks[ends[0] : ends[1] + 1].tolist()
    if law.degree > MAX_B_SPLINE_DEGREE:  # smooth seams come from a fit and are not joints
        inner = [angle for angle in edges[1:-1] if continuity[angle] < MAX_CONTINUITY]
        edges = [edges[0], *inner, edges[-1]]
    knots, max_span = [0.0] * (degree + 1), min(MAX_PIECE_SPAN, event.span / MIN_PIECES)
    for left, right in pairwise(edges):
        pieces = max(1, math.ceil((right - left) / max_span * (1.0 - ROUNDING_RTOL)))
        start, stop = ((angle - event.start) / event.span for angle in (left, right))
        steps = start + (stop - start) * np.arange(1, pieces + 1) / pieces
        multiplicity = 1 if right == edges[-1] else max(1, degree - max(0, continuity[right]))
        knots += [*steps[:-1].tolist(), *[float(steps[-1])] * multiplicity]
    knots[-1:] = [1.0] * (degree + 1)
    orders = [max(0, continuity[angle % TURN]) for angle in (edges[0], edges[-1])]
    return np.array(knots), [min(MAX_KEPT_CONTINUITY, order) for order in orders]


def _end_derivatives(law: Law, event: LawEvent, end: int, count: int) -> list[float]:
    """Return the lift s and its derivatives just outside one end of an event.

    An event is the part of the turn between two dwells. The unit of a derivative is
    lift/span^order, with the span of the event. `end` is 0 for the start and 1 for the end. `count`
    is the number of results, including s.
    """
    angle = event.start + end * event.span
    break_index = int(np.argmin(np.abs(law.breaks - angle)))
    piece, side = (break_index, 0) if end else (break_index - 1, -1)
    piece %= law.spans.size
    derivatives = [law.derivative_ordinates(k)[side, piece] for k in range(count)]
    return [float(d) * event.span**k / law.lift for k, d in enumerate(derivatives)]


def with_base_radius(cam: CamConfig, base_radius_mm: float, start: str) -> CamConfig:
    """Return a cam with another base radius (mm). `start` is the cam that the drawing changes."""
    source = f"drawn on the panel, from {start}"
    base = Quantity(assumed=base_radius_mm, unit="mm", source=source)
    follower = cam.follower.model_copy(update={"base_radius": base})
    return cam.model_copy(update={"follower": follower})

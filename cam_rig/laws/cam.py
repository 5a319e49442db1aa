"""Segments joined into one cam's law."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws import analytic, bernstein, rises
from cam_rig.laws.arcs import ConcaveFlankCam
from cam_rig.laws.bernstein import FloatArray
from cam_rig.laws.cycloidal import cycloidal
from cam_rig.laws.law import TURN, Law
from cam_rig.schema.cam import Bezier, CamConfig, Dwell, Rise, TangentArcs

#: Pieces of one segment: breakpoints in rad from the segment's start, ordinate columns in m.
Pieces = tuple[list[float], list[FloatArray]]

#: Rises that are one Bézier curve, and rises that are analytic curves.
POLYNOMIAL_RISES: dict[str, Callable[[], FloatArray]] = {
    "poly345": rises.poly345,
    "poly4567": rises.poly4567,
}
ANALYTIC_RISES: dict[str, analytic.Curve] = {"cycloidal": cycloidal}

#: A step between two segments smaller than this fraction of the lift is rounding.
STEP_TOLERANCE = 1e-9


def build_law(cam: CamConfig) -> Law:
    """The law of a cam file.

    Raises
    ------
    LawError : the segments do not join, or a segment's geometry does not exist
    """
    breaks: list[float] = [0.0]
    columns: list[FloatArray] = []
    lift = cam.lift.si
    level = _start_level(cam) * lift
    for i, segment in enumerate(cam.segments):
        steps, pieces = _segment(segment, level, cam)
        gap = float(pieces[0][0]) - level
        if abs(gap) > STEP_TOLERANCE * lift:
            raise LawError(_step_message(cam.name, f"segments[{i}]", gap, lift))
        breaks += [breaks[-1] + step for step in steps[1:]]
        columns += pieces
        level = float(pieces[-1][-1])
    gap = level - float(columns[0][0])
    if abs(gap) > STEP_TOLERANCE * lift:
        raise LawError(_step_message(cam.name, "the end of the turn", gap, lift))
    breaks[-1] = TURN
    degree = max(column.size - 1 for column in columns)
    ordinates = np.stack([bernstein.elevate(column, degree) for column in columns], axis=1)
    return Law(cam.name, np.array(breaks), ordinates)


def _step_message(name: str, where: str, gap: float, lift: float) -> str:
    return (
        f"cam {name!r}: {where} steps by {gap / lift:.6g} of the lift; allowed: no step, so let "
        "each segment begin where the one before it ends"
    )


def _start_level(cam: CamConfig) -> float:
    """Level (fraction of the lift) at θ = 0: the one the last segment leaves the turn with."""
    for segment in reversed(cam.segments):
        if isinstance(segment, Rise):
            return segment.to
        if isinstance(segment, Bezier):
            return segment.ordinates.numbers[-1]
        if isinstance(segment, TangentArcs):
            return 0.0
    return 0.0


def _segment(segment: Dwell | Rise | Bezier | TangentArcs, level: float, cam: CamConfig) -> Pieces:
    span, lift = float(segment.span.si), cam.lift.si
    if isinstance(segment, Dwell):
        return [0.0, span], [np.array([level])]
    if isinstance(segment, Bezier):
        return [0.0, span], [lift * np.array(segment.ordinates.numbers)]
    if isinstance(segment, TangentArcs):
        return _tangent_arcs(segment, cam)
    return _rise(segment.law, span, level, segment.to * lift - level)


def _rise(law: str, span: float, level: float, height: float) -> Pieces:
    if law in POLYNOMIAL_RISES:
        return [0.0, span], [level + height * POLYNOMIAL_RISES[law]()]
    breaks, pieces = analytic.fit(ANALYTIC_RISES[law], 0.0, 1.0)
    return [span * u for u in breaks], [level + height * piece for piece in pieces]


def arc_cam(cam: CamConfig) -> ConcaveFlankCam:
    """The circles of a cam that has a segment of tangent arcs, on its pitch curve.

    Raises
    ------
    LawError : it has no such segment
    """
    for segment in cam.segments:
        if isinstance(segment, TangentArcs):
            return _circles(segment, cam)
    raise LawError(f"cam {cam.name!r} has no tangent_arcs segment")


def _circles(segment: TangentArcs, cam: CamConfig) -> ConcaveFlankCam:
    base = cam.follower.base_radius.si + cam.follower.roller
    return ConcaveFlankCam(base, cam.lift.si, 0.5 * segment.span.si, 0.5 * segment.nose_span.si)


def _tangent_arcs(segment: TangentArcs, cam: CamConfig) -> Pieces:
    """Rising flank, nose, falling flank; the fall mirrors the rise bit for bit."""
    circles = _circles(segment, cam)
    base, half, nose_half = circles.base_radius, circles.event_half_angle, circles.nose_half_angle
    flank, nose = circles.arcs()
    at_flank, rising = analytic.fit(flank, -half, -nose_half)
    at_nose, over = analytic.fit(nose, -nose_half, 0.0)
    half_breaks = [x + half for x in at_flank] + [x + half for x in at_nose[1:]]
    half_pieces = [piece - base for piece in rising + over]
    breaks = half_breaks + [2.0 * half - x for x in reversed(half_breaks[:-1])]
    return breaks, half_pieces + [piece[::-1].copy() for piece in reversed(half_pieces)]

"""The pieces of each kind of segment that sets its own level."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws.arcs.from_segments import tangent_arcs, whole_turn_arcs
from cam_rig.laws.families import b_spline
from cam_rig.laws.families.polynomial import polynomial_through
from cam_rig.laws.families.scatter import require_above_scatter
from cam_rig.laws.families.table import Rest, Smoothed, smooth
from cam_rig.laws.families.trigonometric import trigonometric
from cam_rig.laws.fit import fit
from cam_rig.laws.pieces import Pieces
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Bezier, BSpline, Polynomial, Segment, Table, Trigonometric

#: Lift of a file and height of its own points may differ by this fraction, and by so many
#: tolerances: the errors of the highest and of the lowest point.
SAME_LIFT, SAME_LIFT_TOLERANCES = 1e-2, 8.0


def own_pieces(segment: Segment, cam: CamConfig) -> Pieces | None:
    """Breakpoints (rad, from the segment's start) and ordinates (m) of a segment.

    None for one that goes on from the level before it: a dwell, a named rise.

    Raises
    ------
    LawError : the segment's geometry does not exist, or does not fit cam and follower
    """
    build = BUILDERS.get(segment.law)
    return None if build is None else build(segment, cam)


def _bezier(segment: Bezier, cam: CamConfig) -> Pieces:
    return [0.0, segment.span.si], [cam.lift.si * np.array(segment.ordinates.numbers)]


def _b_spline(segment: BSpline, cam: CamConfig) -> Pieces:
    knots = np.array(segment.knots.numbers)
    knots = segment.span.si * ((knots - knots[0]) / (knots[-1] - knots[0]))
    return b_spline.pieces(knots, cam.lift.si * np.array(segment.ordinates.numbers), segment.degree)


def _polynomial(segment: Polynomial, cam: CamConfig) -> Pieces:
    span = segment.span.si
    u = [min(1.0, angle / span) for angle in segment.at.si_list]
    try:
        ordinates = polynomial_through(u, segment.order, segment.value.numbers)
    except LawError as error:
        raise LawError(f"cam {cam.name!r}: {error}") from None
    return [0.0, span], [cam.lift.si * ordinates]


def _trigonometric(segment: Trigonometric, cam: CamConfig) -> Pieces:
    lift = cam.lift.si
    cosine, sine = (
        [] if numbers is None else [lift * number for number in numbers.numbers]
        for numbers in (segment.cosine, segment.sine)
    )
    curve = trigonometric(lift * segment.mean.si, cosine, sine)
    return fit(curve, 0.0, segment.span.si)


def _table(segment: Table, cam: CamConfig) -> Pieces:
    return smoothed(segment, cam).pieces


def smoothed(segment: Table, cam: CamConfig) -> Smoothed:
    """The spline through a table's points, and how far from them it is.

    Raises
    ------
    LawError : no spline comes within the tolerance, or the file's lift is not the points'
    """
    points = segment.file
    height = max(points.lifts) - min(points.lifts)
    limit = SAME_LIFT * height + SAME_LIFT_TOLERANCES * segment.tolerance.si
    if abs(height - cam.lift.si) > limit:
        raise LawError(
            f"cam {cam.name!r}: lift is {cam.lift.si * 1e3:g} mm, the points of {points.file} "
            f"rise by {height * 1e3:g} mm; allowed: the same, so write that"
        )
    dwells = [Rest(dwell.start.si, dwell.span.si, dwell.level.si) for dwell in segment.dwells]
    angles, lifts = np.array(points.angles), np.array(points.lifts)
    try:
        require_above_scatter(angles, lifts, segment.tolerance.si)
        return smooth(angles, lifts, segment.tolerance.si, dwells)
    except LawError as error:
        raise LawError(f"cam {cam.name!r}: {points.file}: {error}") from None


#: A segment's ``law`` to what makes its pieces.
BUILDERS: dict[str, Callable[[Any, CamConfig], Pieces]] = {
    "bezier": _bezier,
    "b_spline": _b_spline,
    "polynomial": _polynomial,
    "trigonometric": _trigonometric,
    "tangent_arcs": tangent_arcs,
    "arcs_by_radii": whole_turn_arcs,
    "arcs_by_centres": whole_turn_arcs,
    "table": _table,
}

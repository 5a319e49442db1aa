"""The pieces of segments made of tangent arcs."""

from __future__ import annotations

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws.arcs.chain import Blend, Circle, close
from cam_rig.laws.arcs.law import ArcFollower, arc_pieces
from cam_rig.laws.arcs.tangent_arcs import ConcaveFlankCam
from cam_rig.laws.fit import fit
from cam_rig.laws.law import Law
from cam_rig.laws.peaks import extremes
from cam_rig.laws.pieces import Pieces, joined
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import ArcsByCentres, ArcsByRadii, ArcSpec, TangentArcs

#: Lift of a file and height of its own arcs may differ by this fraction.
SAME_LIFT = 1e-6


def circles(segment: TangentArcs, cam: CamConfig) -> ConcaveFlankCam:
    """The circles of a tangent_arcs segment, on the pitch curve.

    Raises
    ------
    LawError : the follower is flat
    """
    if arc_follower(cam).flat:
        raise LawError(
            f"cam {cam.name!r}: a flat face bridges the concave flanks of tangent_arcs; allowed: "
            "a roller or a point, or arcs_by_radii with convex flanks"
        )
    base = cam.follower.base_radius.si + cam.follower.roller
    return ConcaveFlankCam(base, cam.lift.si, 0.5 * segment.span.si, 0.5 * segment.nose_span.si)


def arc_follower(cam: CamConfig) -> ArcFollower:
    """The follower on a cam of arcs.

    Raises
    ------
    LawError : a follower that does not move along the cam's centre line
    """
    kind: str = cam.follower.type
    if kind not in ("roller", "point", "flat"):
        raise LawError(
            f"cam {cam.name!r}: arcs under a follower of type {kind!r}; allowed: roller, point, "
            "flat"
        )
    eccentricity = getattr(cam.follower, "eccentricity", None)
    if kind != "flat" and eccentricity is not None and eccentricity.si != 0.0:
        raise LawError(
            f"cam {cam.name!r}: arcs under a follower {eccentricity.si * 1e3:g} mm beside the "
            "cam's centre; allowed: eccentricity 0"
        )
    return ArcFollower(kind == "flat", cam.follower.roller)


def tangent_arcs(segment: TangentArcs, cam: CamConfig) -> Pieces:
    """Rising flank, nose, falling flank; the fall mirrors the rise bit for bit."""
    shape = circles(segment, cam)
    base, half, nose_half = shape.base_radius, shape.event_half_angle, shape.nose_half_angle
    flank, nose = shape.arcs()
    at_flank, rising = fit(flank, -half, -nose_half)
    at_nose, over = fit(nose, -nose_half, 0.0)
    half_breaks = [x + half for x in at_flank] + [x + half for x in at_nose[1:]]
    half_pieces = [piece - base for piece in rising + over]
    breaks = half_breaks + [2.0 * half - x for x in reversed(half_breaks[:-1])]
    return breaks, half_pieces + [piece[::-1].copy() for piece in reversed(half_pieces)]


def whole_turn_arcs(segment: ArcsByRadii | ArcsByCentres, cam: CamConfig) -> Pieces:
    """The law of a contour of arcs, by radii or by centres.

    Raises
    ------
    LawError : the arcs do not join, the follower cannot stay on them, or the lift is another
    """
    try:
        parts = _parts(segment, cam)
        pieces = arc_pieces(close(parts), cam.follower.base_radius.si, arc_follower(cam))
    except LawError as error:
        raise LawError(f"cam {cam.name!r}: {error}") from None
    _check_height(pieces, cam)
    return pieces


def _parts(segment: ArcsByRadii | ArcsByCentres, cam: CamConfig) -> list[Circle | Blend]:
    if isinstance(segment, ArcsByCentres):
        return [_part(arc) for arc in segment.arcs]
    base, nose = cam.follower.base_radius.si, segment.nose_radius.si
    most = base + 0.5 * cam.lift.si
    if nose >= most:
        raise LawError(
            f"nose_radius: is {nose * 1e3:g} mm; allowed: below {most * 1e3:g} mm, base radius "
            "and half the lift"
        )
    sign = -1.0 if segment.flank == "concave" else 1.0
    flank = Blend(None if segment.flank_radius is None else sign * segment.flank_radius.si)
    top = Circle(complex(-(base + cam.lift.si - nose), 0.0), nose)
    return [Circle(0j, base), flank, top, flank]


def _part(arc: ArcSpec) -> Circle | Blend:
    radius = None if arc.radius is None else arc.radius.si
    if radius is None or arc.x is None or arc.y is None:
        return Blend(radius)
    return Circle(complex(arc.y.si, arc.x.si), radius)


def _check_height(pieces: Pieces, cam: CamConfig) -> None:
    """The arcs' lowest and highest point are the base circle and the lift of the file."""
    breaks, columns = pieces
    low, high = extremes(Law(cam.name, np.array(breaks), joined(columns)), 0)
    lift, limit = cam.lift.si, SAME_LIFT * cam.lift.si
    if abs(low.value) > limit or abs(high.value - lift) > limit:
        raise LawError(
            f"cam {cam.name!r}: its arcs lift from {low.value * 1e3:.9g} mm to "
            f"{high.value * 1e3:.9g} mm above the base radius; allowed: from 0 to the lift, "
            f"{lift * 1e3:.9g} mm, so correct base_radius or lift"
        )

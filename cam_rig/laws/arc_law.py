"""The law of a follower on a contour of tangent arcs, which join with one slope: s'' jumps.

The lift of a roller's centre or a point is the polar radius of the arcs grown by the roller's
radius, over the pitch circle. A flat face touches where the outward normal points along the
follower, so its lift is ρ + Re(c·e^(−iθ)) − R_b: it skips what is not convex.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws.arcs import Arc, Blend, Chain, Circle, ConcaveFlankCam, Part, StraightLine, close
from cam_rig.laws.bernstein import Pieces, joined, turned_to_zero
from cam_rig.laws.law import Law, extremes
from cam_rig.laws.sampling import Curve, fit
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import ArcsByCentres, ArcsByRadii, ArcSpec, TangentArcs
from cam_rig.units import TURN, FloatArray

#: The pitch point of a joint and the polar radius of its parts agree to this, relative.
AGREE = 1e-9


@dataclass(frozen=True)
class ArcFollower:
    """The follower on the arcs: ``flat``, or a roller of a radius in m, 0 for a point."""

    flat: bool
    roller_radius: float


def arc_lift(
    chain: Chain, base_radius: float, follower: ArcFollower, angle: FloatArray
) -> FloatArray:
    """The lift (m) above the base circle at cam angles ``(n,)`` in rad, straight from the arcs."""
    angles = _flat_angles(chain) if follower.flat else _pitch_angles(chain, follower.roller_radius)
    inside = angles[0] + (angle - angles[0]) % TURN
    places = np.searchsorted(angles[1:-1], inside, side="right")
    out = np.empty(angle.size)
    for i in np.unique(places):
        here = places == i
        out[here] = _curve(chain.parts[i], base_radius, follower)(inside[here], 0)
    return out


def arc_pieces(chain: Chain, base_radius: float, follower: ArcFollower) -> Pieces:
    """The lift (m) above the base circle of ``base_radius`` (m), one whole turn from angle 0."""
    angles = _flat_angles(chain) if follower.flat else _pitch_angles(chain, follower.roller_radius)
    breaks, columns = [angles[0]], []
    for i, part in enumerate(chain.parts):
        start, stop = angles[i], angles[i + 1]
        if isinstance(part, Circle) and part.centre == 0.0:  # a dwell
            breaks.append(stop)
            columns.append(np.array([part.radius - base_radius]))
            continue
        steps, fitted = fit(_curve(part, base_radius, follower), start, stop)
        breaks += steps[1:]
        columns += fitted
    return turned_to_zero((breaks, columns), TURN)


def _curve(part: Part, base_radius: float, follower: ArcFollower) -> Curve:
    """The lift above the base circle while the follower is on a part."""
    reached: Curve
    if follower.flat:
        assert isinstance(part, Circle)
        zero, reached = base_radius - part.radius, partial(_reach, part.centre)
    else:
        roller = follower.roller_radius
        zero, reached = base_radius + roller, _polar_radius(part, roller)
    return lambda angle, order: reached(angle, order) - (zero if order == 0 else 0.0)


def _reach(centre: complex, angle: FloatArray, order: int) -> FloatArray:
    """How far a point is along the follower's direction, Re(c·e^(−iθ)), and its derivatives."""
    turned = angle - cmath.phase(centre) + 0.5 * math.pi * order
    return np.asarray(abs(centre) * np.cos(turned))


def _flat_angles(chain: Chain) -> list[float]:
    """Cam angles (rad) at which the face leaves each part, from where it meets the first."""
    for i, part in enumerate(chain.parts):
        if not (isinstance(part, Circle) and part.radius > 0.0):
            kind = "straight" if isinstance(part, StraightLine) else "concave"
            raise LawError(
                f"arcs[{i}]: is {kind}, which a flat face bridges; allowed under a flat "
                "follower: convex arcs only"
            )
    return _rising([cmath.phase(n) for n in chain.normals])


def _pitch_angles(chain: Chain, roller: float) -> list[float]:
    points = []  # where the follower's centre is as each part meets the next
    for i, part in enumerate(chain.parts):
        if isinstance(part, Circle) and part.radius < 0.0 and part.radius + roller >= 0.0:
            raise LawError(
                f"arcs[{i}]: concave radius {-part.radius * 1e3:g} mm, the roller's is "
                f"{roller * 1e3:g} mm; allowed: a smaller roller"
            )
        circle = part if isinstance(part, Circle) else chain.parts[(i + 1) % len(chain.parts)]
        assert isinstance(circle, Circle)  # a line stands between circles
        points.append(circle.centre + (circle.radius + roller) * chain.normals[i])
    angles = _rising([cmath.phase(point) for point in points])
    for i, part in enumerate(chain.parts):
        with np.errstate(invalid="ignore"):
            reached = _polar_radius(part, roller)(np.array([angles[i], angles[i + 1]]), 0)
        expected = np.abs([points[i - 1], points[i]])
        if not (np.abs(reached - expected) <= AGREE * expected).all():
            raise _folds(i)
    return angles


def _rising(ends: list[float]) -> list[float]:
    """The angles at which parts end, each after the one before; the first part's start first."""
    angles = [ends[-1]]
    for i, end in enumerate(ends):
        span = (end - angles[-1]) % TURN
        if not span > 0.0 or angles[-1] + span - angles[0] > TURN * (1.0 + 1e-9):
            raise _folds(i)
        angles.append(angles[-1] + span)
    angles[-1] = angles[0] + TURN
    if not angles[-1] > angles[-2]:
        raise _folds(len(ends) - 1)
    return angles


def _folds(i: int) -> LawError:
    return LawError(
        f"arcs[{i}]: the contour folds back on itself there, so no follower stays on it; "
        "allowed: arcs in the order of the cam angle, clockwise from +y, seen from the cam's "
        "centre one behind the other"
    )


def _polar_radius(part: Part, roller: float) -> Curve:
    if isinstance(part, StraightLine):
        return _secant(part.distance + roller, cmath.phase(part.normal))
    direction = cmath.phase(part.centre) if part.centre else 0.0
    grown = part.radius + roller
    return Arc(abs(part.centre), direction, abs(grown), concave=grown < 0.0)


def _secant(distance: float, direction: float) -> Curve:
    """Polar radius of a straight line, p/cos δ, and its derivatives."""

    def curve(angle: FloatArray, order: int) -> FloatArray:
        secant = distance / np.cos(angle - direction)
        t = np.tan(angle - direction)
        return np.asarray(secant * (1.0, t, 1.0 + 2.0 * t**2, 5.0 * t + 6.0 * t**3)[order])

    return curve


# The pieces of segments made of tangent arcs.

#: Lift of a file and height of its own arcs may differ by this fraction.
SAME_LIFT = 1e-6


def circles(segment: TangentArcs, cam: CamConfig) -> ConcaveFlankCam:
    """The circles of a tangent_arcs segment, on the pitch curve."""
    if arc_follower(cam).flat:
        raise LawError(
            f"cam {cam.name!r}: a flat face bridges the concave flanks of tangent_arcs; allowed: "
            "a roller or a point, or arcs_by_radii with convex flanks"
        )
    base = cam.follower.base_radius.si + cam.follower.roller
    return ConcaveFlankCam(base, cam.lift.si, 0.5 * segment.span.si, 0.5 * segment.nose_span.si)


def arc_follower(cam: CamConfig) -> ArcFollower:
    """The follower on a cam of arcs."""
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
    """The law of a contour of arcs, by radii or by centres."""
    try:
        parts = _parts(segment, cam)
        pieces = arc_pieces(close(parts), cam.follower.base_radius.si, arc_follower(cam))
    except LawError as error:
        raise LawError(f"cam {cam.name!r}: {error}") from None
    breaks, columns = pieces
    low, high = extremes(Law(cam.name, np.array(breaks), joined(columns)), 0)
    lift, limit = cam.lift.si, SAME_LIFT * cam.lift.si
    if abs(low.value) > limit or abs(high.value - lift) > limit:
        raise LawError(
            f"cam {cam.name!r}: its arcs lift from {low.value * 1e3:.9g} mm to "
            f"{high.value * 1e3:.9g} mm above the base radius; allowed: from 0 to the lift, "
            f"{lift * 1e3:.9g} mm, so correct base_radius or lift"
        )
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

"""Laws of a follower on a contour of circular arcs, each tangent to the next.

The slope s' is continuous at the joints and s'' jumps.

Roller or point: the lift of its centre is the polar radius of the arcs, offset outwards by the
roller's radius, less the radius of the pitch circle. Flat face: it touches the contour where the
outward normal points along the follower, so its lift is ρ + Re(c·e^(−iθ)) − R_b. A flat face
bridges every part that is not convex.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws.arcs import (
    Arc,
    Blend,
    Chain,
    Circle,
    ConcaveFlankCam,
    Part,
    StraightLine,
    close_chain,
)
from cam_rig.laws.bernstein import Pieces, join_pieces, rotate_to_zero
from cam_rig.laws.law import Law, extremes
from cam_rig.laws.sampling import Curve, fit_curve
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import ArcsByCentres, ArcsByRadii, ArcSpec, TangentArcs
from cam_rig.units import TURN, FloatArray

#: Largest relative difference of the polar radii of two parts at their joint (rounding). It is
#: larger if the contour folds back on itself.
JOINT_RTOL = 1e-9


@dataclass(frozen=True)
class ArcFollower:
    """Follower on a contour of circular arcs.

    ``flat`` is True for a flat face. ``roller_radius`` is in m, 0 for a point.
    """

    flat: bool
    roller_radius: float


def arc_lift(
    chain: Chain, base_radius: float, follower: ArcFollower, angle: FloatArray
) -> FloatArray:
    """Compute the lift of a follower at cam angles directly from the arcs.

    No polynomial is used.

    Parameters
    ----------
    chain : Chain
        Closed contour, in m.
    base_radius : float
        Radius of the base circle, m.
    follower : ArcFollower
        Follower on the contour.
    angle : ndarray, shape (n,)
        Cam angles, rad.

    Returns
    -------
    ndarray, shape (n,)
        Lift above the base circle, m.

    Raises
    ------
    LawError
        If the follower cannot stay on the contour.
    """
    angles = _flat_angles(chain) if follower.flat else _pitch_angles(chain, follower.roller_radius)
    unwrapped = angles[0] + (angle - angles[0]) % TURN
    indices = np.searchsorted(angles[1:-1], unwrapped, side="right")
    out = np.empty(angle.size)
    for i in np.unique(indices):
        selected = indices == i
        out[selected] = _curve(chain.parts[i], base_radius, follower)(unwrapped[selected], 0)
    return out


def arc_pieces(chain: Chain, base_radius: float, follower: ArcFollower) -> Pieces:
    """Compute the lift of a follower on arcs over one turn, as Bernstein pieces.

    The turn starts at cam angle 0.

    Parameters
    ----------
    chain : Chain
        Closed contour, in m.
    base_radius : float
        Radius of the base circle, m.
    follower : ArcFollower
        Follower on the contour.

    Returns
    -------
    Pieces
        Breakpoints from 0 to 2π rad, and the ordinates (m) of the lift above the base circle.

    Raises
    ------
    LawError
        If the follower cannot stay on the contour.
    """
    angles = _flat_angles(chain) if follower.flat else _pitch_angles(chain, follower.roller_radius)
    breaks, columns = [angles[0]], []
    for i, part in enumerate(chain.parts):
        start, stop = angles[i], angles[i + 1]
        if isinstance(part, Circle) and part.centre == 0.0:  # a dwell
            breaks.append(stop)
            columns.append(np.array([part.radius - base_radius]))
            continue
        part_breaks, part_columns = fit_curve(_curve(part, base_radius, follower), start, stop)
        breaks += part_breaks[1:]
        columns += part_columns
    return rotate_to_zero((breaks, columns), TURN)


def _curve(part: Part, base_radius: float, follower: ArcFollower) -> Curve:
    """Return a function for the lift (m) of the follower on a part of the contour.

    The lift is that above the base circle.
    """
    position: Curve
    if follower.flat:
        assert isinstance(part, Circle)
        zero, position = base_radius - part.radius, partial(_project, part.centre)
    else:
        roller = follower.roller_radius
        zero, position = base_radius + roller, _polar_radius(part, roller)
    return lambda angle, order: position(angle, order) - (zero if order == 0 else 0.0)


def _project(centre: complex, angle: FloatArray, order: int) -> FloatArray:
    """Return the coordinate of a point along the follower (m), or its derivative.

    The coordinate is Re(c·e^(−iθ)) for the point c and the cam angle θ.
    """
    phase = angle - cmath.phase(centre) + 0.5 * math.pi * order
    return np.asarray(abs(centre) * np.cos(phase))


def _flat_angles(chain: Chain) -> list[float]:
    """Return the cam angles (rad) at which a flat face meets each next part.

    The first angle is the start of the first part.
    """
    for i, part in enumerate(chain.parts):
        if not (isinstance(part, Circle) and part.radius > 0.0):
            kind = "straight" if isinstance(part, StraightLine) else "concave"
            raise LawError(
                f"arcs[{i}]: is {kind}, which a flat face bridges; allowed under a flat "
                "follower: convex arcs only"
            )
    return _unwrap([cmath.phase(n) for n in chain.normals])


def _pitch_angles(chain: Chain, roller: float) -> list[float]:
    """Return the cam angles (rad) at which the roller meets each next part.

    The first angle is the start of the first part. At each joint the position of the roller's
    centre must agree with the polar radii of both parts.
    """
    points = []  # centre of the roller at the end of each part
    for i, part in enumerate(chain.parts):
        if isinstance(part, Circle) and part.radius < 0.0 and part.radius + roller >= 0.0:
            raise LawError(
                f"arcs[{i}]: concave radius {-part.radius * 1e3:g} mm, the roller's is "
                f"{roller * 1e3:g} mm; allowed: a smaller roller"
            )
        circle = part if isinstance(part, Circle) else chain.parts[(i + 1) % len(chain.parts)]
        assert isinstance(circle, Circle)  # a line lies between circles
        points.append(circle.centre + (circle.radius + roller) * chain.normals[i])
    angles = _unwrap([cmath.phase(point) for point in points])
    for i, part in enumerate(chain.parts):
        with np.errstate(invalid="ignore"):
            radii = _polar_radius(part, roller)(np.array([angles[i], angles[i + 1]]), 0)
        expected = np.abs([points[i - 1], points[i]])
        if not (np.abs(radii - expected) <= JOINT_RTOL * expected).all():
            raise _fold_error(i)
    return angles


def _unwrap(ends: list[float]) -> list[float]:
    """Return the end angles (rad) of all parts, so that they increase over one turn.

    The result starts with the start of the first part.
    """
    angles = [ends[-1]]
    for i, end in enumerate(ends):
        span = (end - angles[-1]) % TURN
        if not span > 0.0 or angles[-1] + span - angles[0] > TURN * (1.0 + 1e-9):
            raise _fold_error(i)
        angles.append(angles[-1] + span)
    angles[-1] = angles[0] + TURN
    if not angles[-1] > angles[-2]:
        raise _fold_error(len(ends) - 1)
    return angles


def _fold_error(i: int) -> LawError:
    """Return the error for a contour on which the cam angle does not increase."""
    return LawError(
        f"arcs[{i}]: the contour folds back on itself there, so no follower stays on it; "
        "allowed: arcs in the order of the cam angle, clockwise from +y, which do not overlap as "
        "seen from the cam's centre"
    )


def _polar_radius(part: Part, roller: float) -> Curve:
    """Return a function for the polar radius (m) of a part of a pitch curve.

    The part is offset outwards by the roller's radius (m).
    """
    if isinstance(part, StraightLine):
        return _secant(part.distance + roller, cmath.phase(part.normal))
    direction = cmath.phase(part.centre) if part.centre else 0.0
    grown = part.radius + roller
    return Arc(abs(part.centre), direction, abs(grown), concave=grown < 0.0)


def _secant(distance: float, direction: float) -> Curve:
    """Return a function for the polar radius (m) of a straight line, with derivatives.

    The radius is p/cos δ with the line's distance p (m) and the angle δ to its normal.
    """

    def curve(angle: FloatArray, order: int) -> FloatArray:
        secant = distance / np.cos(angle - direction)
        t = np.tan(angle - direction)
        return np.asarray(secant * (1.0, t, 1.0 + 2.0 * t**2, 5.0 * t + 6.0 * t**3)[order])

    return curve


# Pieces of the segments that are made of tangent arcs.

#: Largest difference between the lift of a cam file and that of its arcs, as a fraction of the
#: lift. It allows for lifts that are written with six digits.
LIFT_RTOL = 1e-6


def concave_flank_cam(segment: TangentArcs, cam: CamConfig) -> ConcaveFlankCam:
    """Return the circles of a tangent_arcs segment, for the pitch curve.

    Raises
    ------
    LawError
        If the follower has a flat face.
    """
    if arc_follower(cam).flat:
        raise LawError(
            f"cam {cam.name!r}: a flat face bridges the concave flanks of tangent_arcs; allowed: "
            "a roller or a point, or arcs_by_radii with convex flanks"
        )
    base = cam.follower.base_radius.si + cam.follower.roller
    return ConcaveFlankCam(base, cam.lift.si, 0.5 * segment.span.si, 0.5 * segment.nose_span.si)


def arc_follower(cam: CamConfig) -> ArcFollower:
    """Return the follower of a cam whose law is made of arcs.

    Raises
    ------
    LawError
        If the follower is neither a roller, a point nor a flat face, or is eccentric.
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
            f"cam {cam.name!r}: arcs under a follower of eccentricity "
            f"{eccentricity.si * 1e3:g} mm; allowed: eccentricity 0"
        )
    return ArcFollower(kind == "flat", cam.follower.roller)


def tangent_arcs(segment: TangentArcs, cam: CamConfig) -> Pieces:
    """Compute the pieces of a tangent_arcs segment: rising flank, nose, falling flank.

    The fall is the mirror image of the rise, bit for bit.
    """
    shape = concave_flank_cam(segment, cam)
    base, half, nose_half = shape.base_radius, shape.event_half_angle, shape.nose_half_angle
    flank, nose = shape.arcs()
    flank_breaks, flank_pieces = fit_curve(flank, -half, -nose_half)
    nose_breaks, nose_pieces = fit_curve(nose, -nose_half, 0.0)
    half_breaks = [x + half for x in flank_breaks] + [x + half for x in nose_breaks[1:]]
    half_pieces = [piece - base for piece in flank_pieces + nose_pieces]
    breaks = half_breaks + [2.0 * half - x for x in reversed(half_breaks[:-1])]
    return breaks, half_pieces + [piece[::-1].copy() for piece in reversed(half_pieces)]


def arc_contour_pieces(segment: ArcsByRadii | ArcsByCentres, cam: CamConfig) -> Pieces:
    """Compute the law's pieces for a contour that is given by radii or by centres.

    Raises
    ------
    LawError
        If the contour does not exist, or its lift is not that of the cam file.
    """
    try:
        parts = _parts(segment, cam)
        pieces = arc_pieces(close_chain(parts), cam.follower.base_radius.si, arc_follower(cam))
    except LawError as error:
        raise LawError(f"cam {cam.name!r}: {error}") from None
    breaks, columns = pieces
    low, high = extremes(Law(cam.name, np.array(breaks), join_pieces(columns)), 0)
    lift, limit = cam.lift.si, LIFT_RTOL * cam.lift.si
    if abs(low.value) > limit or abs(high.value - lift) > limit:
        raise LawError(
            f"cam {cam.name!r}: its arcs lift from {low.value * 1e3:.9g} mm to "
            f"{high.value * 1e3:.9g} mm above the base radius; allowed: from 0 to the lift, "
            f"{lift * 1e3:.9g} mm, so correct base_radius or lift"
        )
    return pieces


def _parts(segment: ArcsByRadii | ArcsByCentres, cam: CamConfig) -> list[Circle | Blend]:
    """Return the circles and blends of a segment in the order of the cam angle."""
    if isinstance(segment, ArcsByCentres):
        return [_part(arc) for arc in segment.arcs]
    base, nose = cam.follower.base_radius.si, segment.nose_radius.si
    max_nose = base + 0.5 * cam.lift.si
    if nose >= max_nose:
        raise LawError(
            f"nose_radius: is {nose * 1e3:g} mm; allowed: below {max_nose * 1e3:g} mm, base radius "
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

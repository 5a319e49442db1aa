"""A follower put on a finished contour: where does it rest? Nothing of the law is used.

A face or a roller rests on the point of the contour that holds it up farthest; a point on the
crossing of its path with the contour.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline
from shapely import LinearRing

from cam_rig.errors import ProfileError
from cam_rig.laws import Law
from cam_rig.profile.contact import Element, turn_angles
from cam_rig.profile.disc import Disc, contours
from cam_rig.profile.faces import GuidedCentre, SwungCentre
from cam_rig.schema.cam import Follower
from cam_rig.units import TURN, ComplexArray, FloatArray, rms

#: A closed curve in the cam's frame: parameters, of period 2π, to points x + iy, m.
Curve = Callable[[FloatArray], ComplexArray]
#: Points of the contour that are tried before the search is refined ...
COARSE = 4096
#: ... in rounds with this many points between the neighbours of the best one.
ROUNDS, FINE = 5, 33
#: Halvings that bring a crossing from 2π/COARSE to rounding.
HALVINGS = 44
#: Cam angles dealt with at a time.
BLOCK = 64


def closed_curve(points: FloatArray) -> Curve:
    """The periodic cubic spline through the ``(2, n)`` points of a closed contour, m."""
    step = np.hypot(*np.diff(np.append(points, points[:, :1], axis=1), axis=1))
    kept = points[:, step > 1e-9 * step.max(initial=0.0)]  # without repeated ones
    if kept.shape[1] < 8:
        raise ProfileError(
            f"contour has {kept.shape[1]} different points; allowed: at least 8, and for a "
            "measurement some hundreds"
        )
    kept = np.append(kept, kept[:, :1], axis=1)
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(kept, axis=1))))
    spline = CubicSpline(way * (TURN / way[-1]), kept.T, bc_type="periodic")

    def curve(at: FloatArray) -> ComplexArray:
        x, y = np.moveaxis(spline(at), -1, 0)
        return np.asarray(x + 1j * y)

    return curve


def rest(element: Element, curve: Curve, angle: FloatArray) -> FloatArray:
    """Displacement s (m) at cam angles (rad) of a follower resting on a contour."""
    at = turn_angles(COARSE)
    outline = curve(at)
    place = np.empty(angle.size)
    for begin in range(0, angle.size, BLOCK):
        turn = np.exp(1j * angle[begin : begin + BLOCK])[:, None]
        if isinstance(element, GuidedCentre | SwungCentre) and element.roller == 0.0:
            found = _crossing(element, curve, outline, turn)
        else:
            found = _highest(element, curve, outline, turn)
        place[begin : begin + BLOCK] = found
    if not np.isfinite(place).all():
        where = np.degrees(angle[np.argmin(np.isfinite(place))])
        raise ProfileError(
            f"the follower passes the contour by at {where:.4g}°; allowed: a contour that its "
            "path meets at every angle"
        )
    return element.lift_at(place)


def _highest(
    element: Element, curve: Curve, outline: ComplexArray, turn: ComplexArray
) -> FloatArray:
    """Place on the point of the contour that holds the follower up farthest, ``(k,)``."""
    best = np.argmax(element.place_on(outline * turn), axis=1)
    step = TURN / COARSE
    middle, rows = best * step, np.arange(turn.size)
    for _ in range(ROUNDS):
        at = middle[:, None] + step * np.linspace(-1.0, 1.0, FINE)
        places = element.place_on(curve(at % TURN) * turn)
        best = np.argmax(places, axis=1)
        middle, step = at[rows, best], 2.0 * step / (FINE - 1)
    return np.asarray(places[rows, best])


def _crossing(
    element: GuidedCentre | SwungCentre, curve: Curve, outline: ComplexArray, turn: ComplexArray
) -> FloatArray:
    """Place on the farthest crossing of the point's path with the contour, ``(k,)``."""
    points = outline * turn
    right = element.beside(points) >= 0.0
    crosses = right != np.roll(right, -1, axis=1)
    best = np.argmax(np.where(crosses, element.place_on(points), -np.inf), axis=1)
    rows = np.arange(turn.size)
    low = best * (TURN / COARSE)
    high, before = low + TURN / COARSE, right[rows, best]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = (element.beside(curve(middle % TURN) * turn[:, 0]) >= 0.0) == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    place = element.place_on(curve(low % TURN) * turn[:, 0])
    return np.where(crosses[rows, best], place, -np.inf)


# Rotation of a contour whose zero direction is unknown.

#: Cam angles of the first search for a rotation, and steps of Gauss and Newton that refine it.
ALIGN_ANGLES, ALIGN_STEPS = 720, 4


def find_rotation(element: Element, curve: Curve, law: Law) -> tuple[float, float]:
    """Return the rotation (rad) at which a contour gives the law, and the r.m.s. error left (m).

    The displacement at cam angle θ + rotation is that of the law at θ, by least squares.
    """
    angle = turn_angles(ALIGN_ANGLES)
    lift, wanted, slope = rest(element, curve, angle), law(angle), law(angle, 1)
    products = np.fft.irfft(np.fft.rfft(lift) * np.conj(np.fft.rfft(wanted)), angle.size)
    rotation = float(angle[int(np.argmax(products))])
    error = rest(element, curve, angle + rotation) - wanted
    for _ in range(ALIGN_STEPS):
        step = -float(np.sum(error * slope) / np.sum(slope**2))
        other = rest(element, curve, angle + rotation + step) - wanted
        if rms(other) >= rms(error):
            break
        rotation, error = rotation + step, other
    return rotation % TURN, rms(error)


# Whether points are a closed contour in order: what a measurement of them would not show.

#: A step from point to point beyond so many of the usual one is a gap. Contours written at equal
#: steps of the cam angle stay below 2.
WIDE = 10.0
#: A contour of fewer points is a guess.
FEWEST = 36


def doubts(points: FloatArray, table: bool) -> list[str]:
    """What ``(2, n)`` points (m) of a contour should not be: gaps, or few and so a guess."""
    found = []
    if not LinearRing(points.T).is_simple:
        found.append("the contour crosses itself; allowed: points in their order around the cam")
    step = np.hypot(*(np.roll(points, -1, axis=1) - points))
    usual, widest = float(np.median(step)), int(np.argmax(step))
    if table and step[widest] > WIDE * usual:
        follower = (widest + 1) % step.size + 1
        found.append(
            f"points {widest + 1} and {follower} are {step[widest] * 1e3:.4g} mm apart, the others "
            f"{usual * 1e3:.4g} mm (median); between them the contour is guessed; allowed: a whole "
            f"contour, no step above {WIDE:g} medians"
        )
    if table and points.shape[1] < FEWEST:
        found.append(
            f"{points.shape[1]} points; between them the contour is guessed, to a part of the "
            f"lift; allowed: {FEWEST} or more"
        )
    return found


# Backlash of a frame or a rocker that a cam moves both ways: whether both its elements touch.

#: Points of a finished contour, and cam angles at which both elements are put on theirs.
POINTS, READINGS = 3600, 360


def backlash(
    elements: tuple[Element, Element], curves: tuple[Curve, Curve], angle: FloatArray
) -> FloatArray:
    """How far (m of s; negative: not at all) the follower can move between its two contacts."""
    low, high = (rest(one, curve, angle) for one, curve in zip(elements, curves, strict=True))
    return high - low


def pair(plates: tuple[Disc, ...]) -> tuple[Element, Element]:
    """The two elements of a follower that its cam moves both ways."""
    second = plates[0].opposite if len(plates) == 1 else plates[1].element
    if second is None:
        raise ProfileError(
            "backlash of one element; allowed: a follower that its cam moves both ways"
        )
    return plates[0].element, second


def closure(follower: Follower, law: Law) -> FloatArray:
    """``(360,)`` backlash (m) over the turn, on contours that are splines of 3600 points."""
    found = contours(follower, law, POINTS)
    curves = [closed_curve(contour.points) for contour in found]
    elements = pair(tuple(contour.disc for contour in found))
    return backlash(elements, (curves[0], curves[-1]), turn_angles(READINGS))

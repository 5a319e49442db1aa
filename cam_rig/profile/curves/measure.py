"""A follower put on a finished contour: where does it rest? Nothing of the law is used.

The cam is turned, the follower lowered until it touches. A face or a roller rests on the point
of the contour that holds it up farthest; a point on the crossing of its path with the contour.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.errors import ProfileError
from cam_rig.profile.contact import Element
from cam_rig.profile.motion import turn_angles
from cam_rig.profile.roller import GuidedCentre, SwungCentre
from cam_rig.units import TURN

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
    """The periodic cubic spline through the ``(2, n)`` points of a closed contour, m.

    A last point equal to the first, and points that repeat the one before, are dropped.

    Raises
    ------
    ProfileError : fewer than 8 different points
    """
    closed = np.append(points, points[:, :1], axis=1)
    step = np.hypot(closed[0, 1:] - closed[0, :-1], closed[1, 1:] - closed[1, :-1])
    kept = closed[:, :-1][:, step > 1e-9 * step.max(initial=0.0)]
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
    """Displacement s (m) at cam angles (rad) of a follower resting on a contour.

    Raises
    ------
    ProfileError : the follower passes the contour by
    """
    at = turn_angles(COARSE)
    outline = curve(at)
    narrow = isinstance(element, GuidedCentre | SwungCentre) and element.roller == 0.0
    place = np.empty(angle.size)
    for begin in range(0, angle.size, BLOCK):
        turn = np.exp(1j * angle[begin : begin + BLOCK])[:, None]
        if narrow and isinstance(element, GuidedCentre | SwungCentre):
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

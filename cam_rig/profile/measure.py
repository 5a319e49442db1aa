"""Measurement of a finished contour by a follower that rests on it.

The result is the displacement s of the follower at each cam angle. The law of the cam is not used,
so the result can be compared with it. A face or a roller rests on the point of the contour that
lifts it farthest. A pointed follower rests where the path of its tip crosses the contour.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline
from shapely import LinearRing, Polygon

from cam_rig.errors import ProfileError
from cam_rig.laws import Law
from cam_rig.profile.contact import Element, turn_angles
from cam_rig.profile.contour_files import Placement, encloses_axis
from cam_rig.profile.disc import Disc, contours
from cam_rig.profile.faces import GuidedCentre, SwungCentre
from cam_rig.schema.cam import Follower
from cam_rig.units import TURN, ComplexArray, FloatArray, rms

#: Closed curve in the cam frame: a function of a parameter of period 2π that returns x + iy in m.
Curve = Callable[[FloatArray], ComplexArray]
#: Number of points of the contour in the first step of the search for the contact of a follower.
COARSE_POINTS = 4096
#: Number of rounds that refine the contact point on the contour after the first step.
ROUNDS = 5
#: Number of points of the contour in each round, between the neighbours of the best point of the
#: previous round.
ROUND_POINTS = 33
#: Number of bisections that locate the crossing of the contour with the path of a pointed follower,
#: from a step of 2π/COARSE_POINTS of the contour's parameter to rounding.
BISECTIONS = 44
#: Number of cam angles at which contact is computed together. It limits the memory.
BLOCK = 64


def closed_curve(points: FloatArray) -> Curve:
    """Return the periodic cubic spline through the points of a closed contour.

    Parameters
    ----------
    points : FloatArray
        Points in m, shape ``(2, n)``. Repeated points are left out.

    Returns
    -------
    callable
        The curve, a function of a parameter with period 2π.

    Raises
    ------
    ProfileError
        The contour has fewer than 8 different points.
    """
    step = np.hypot(*np.diff(np.append(points, points[:, :1], axis=1), axis=1))
    distinct = points[:, step > 1e-9 * step.max(initial=0.0)]  # without repeated points
    if distinct.shape[1] < 8:
        raise ProfileError(
            f"contour has {max(1, distinct.shape[1])} different points; allowed: at least 8, and "
            "for a measurement some hundreds"
        )
    distinct = np.append(distinct, distinct[:, :1], axis=1)
    arc_length = np.append(0.0, np.cumsum(np.hypot(*np.diff(distinct, axis=1))))
    spline = CubicSpline(arc_length * (TURN / arc_length[-1]), distinct.T, bc_type="periodic")

    def curve(parameter: FloatArray) -> ComplexArray:
        x, y = np.moveaxis(spline(parameter), -1, 0)
        return np.asarray(x + 1j * y)

    return curve


def rest_on_contour(element: Element, curve: Curve, angle: FloatArray) -> FloatArray:
    """Return the displacement s (m) of a follower that rests on a contour.

    Parameters
    ----------
    element : Element
        Element of the follower that touches the contour.
    curve : callable
        The contour in the cam frame, such as a `closed_curve`.
    angle : FloatArray
        Cam angles in rad, shape ``(n,)``.

    Returns
    -------
    FloatArray
        Displacements in m, shape ``(n,)``.

    Raises
    ------
    ProfileError
        The path of the follower does not meet the contour at one of the cam angles.
    """
    outline = curve(turn_angles(COARSE_POINTS))
    position = np.empty(angle.size)
    for start in range(0, angle.size, BLOCK):
        turn = np.exp(1j * angle[start : start + BLOCK])[:, None]
        if isinstance(element, GuidedCentre | SwungCentre) and element.roller == 0.0:
            block = _find_crossing(element, curve, outline, turn)
        else:
            block = _find_highest(element, curve, outline, turn)
        position[start : start + BLOCK] = block
    if not np.isfinite(position).all():
        failed_deg = np.degrees(angle[np.argmin(np.isfinite(position))])
        raise ProfileError(
            f"the path of the follower misses the contour at {failed_deg:.4g}°; allowed: a contour "
            "that it meets at every angle"
        )
    return element.lift_at(position)


def _find_highest(
    element: Element, curve: Curve, outline: ComplexArray, turn: ComplexArray
) -> FloatArray:
    """Return the position (m) of a roller or a face that rests on a contour, ``(k,)``.

    It rests on the point of the contour that lifts it farthest. ``turn`` are the k rotations e^{iθ}
    of the cam, ``(k, 1)``, and ``outline`` are coarse points of the contour. ``element`` is the
    roller or face, and ``curve`` the contour.
    """
    best = np.argmax(element.place_on(outline * turn), axis=1)
    step = TURN / COARSE_POINTS
    middle, rows = best * step, np.arange(turn.size)
    for _ in range(ROUNDS):
        parameter = middle[:, None] + step * np.linspace(-1.0, 1.0, ROUND_POINTS)
        positions = element.place_on(curve(parameter % TURN) * turn)
        best = np.argmax(positions, axis=1)
        middle, step = parameter[rows, best], 2.0 * step / (ROUND_POINTS - 1)
    return np.asarray(positions[rows, best])


def _find_crossing(
    element: GuidedCentre | SwungCentre, curve: Curve, outline: ComplexArray, turn: ComplexArray
) -> FloatArray:
    """Return the position (m) of a pointed follower that rests on a contour, ``(k,)``.

    It is the farthest position at which the path of its tip crosses the contour, or −∞ if there is
    no crossing. ``turn`` are the k rotations e^{iθ} of the cam, ``(k, 1)``, and ``outline`` are
    coarse points of the contour. ``element`` is the point of the follower, and ``curve`` the
    contour.
    """
    points = outline * turn
    right = element.offset_from_path(points) >= 0.0
    crosses = right != np.roll(right, -1, axis=1)
    best = np.argmax(np.where(crosses, element.place_on(points), -np.inf), axis=1)
    rows = np.arange(turn.size)
    low = best * (TURN / COARSE_POINTS)
    high, before = low + TURN / COARSE_POINTS, right[rows, best]
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        same_side = (element.offset_from_path(curve(middle % TURN) * turn[:, 0]) >= 0.0) == before
        low, high = np.where(same_side, middle, low), np.where(same_side, high, middle)
    position = element.place_on(curve(low % TURN) * turn[:, 0])
    return np.where(crosses[rows, best], position, -np.inf)


# Rotation of a contour from a file that does not state the direction of cam angle 0.

#: Number of cam angles at which the rotation of a contour is searched for and fitted.
ALIGN_ANGLES = 720
#: Largest number of Gauss-Newton steps that refine the rotation of a contour.
ALIGN_STEPS = 4


def find_rotation(element: Element, curve: Curve, law: Law) -> tuple[float, float]:
    """Return the rotation (rad) that aligns a contour with the law, and the residual.

    After the rotation, the displacement of the follower at cam angle θ + rotation is closest to
    that of the law at θ, by least squares. The residual is the r.m.s. difference in m. ``element``
    is the roller, point or face of the follower, and ``curve`` the contour.
    """
    angle = turn_angles(ALIGN_ANGLES)
    lift, expected, slope = rest_on_contour(element, curve, angle), law(angle), law(angle, 1)
    products = np.fft.irfft(np.fft.rfft(lift) * np.conj(np.fft.rfft(expected)), angle.size)
    rotation = float(angle[int(np.argmax(products))])
    error = rest_on_contour(element, curve, angle + rotation) - expected
    for _ in range(ALIGN_STEPS):
        step = -float(np.sum(error * slope) / np.sum(slope**2))
        next_error = rest_on_contour(element, curve, angle + rotation + step) - expected
        if rms(next_error) >= rms(error):
            break
        rotation, error = rotation + step, next_error
    return rotation % TURN, rms(error)


# Faults of the points of a contour that the measured displacement does not show.

#: Distance of two neighbouring points of a contour above which it counts as a gap, as a multiple of
#: the median distance. Contours written at equal steps of the cam angle stay below 2.
MAX_STEP_RATIO = 10.0
#: Smallest number of points of a contour without a warning.
MIN_POINTS = 36


#: Smallest area of a contour, as a fraction of the square of its diagonal. A smaller area is the
#: rounding error of points on a line.
MIN_AREA_FRACTION = 1e-6


def require_axis_inside(points: FloatArray, placement: Placement) -> None:
    """Raise `ProfileError` if a contour does not enclose the cam's axis, or has no area.

    ``points`` ``(2, n)`` (m) are in the frame of the cam. The message contains the coordinates of
    the file, to which ``placement`` converts them.
    """
    drawn = placement.in_file(points)
    low, high = drawn.min(axis=1), drawn.max(axis=1)
    area, extent = Polygon(points.T).area, float(np.hypot(*(high - low)))
    reach = ", ".join(
        f"{name} {1e3 * a:.6g} to {1e3 * b:.6g}" for name, a, b in zip("xy", low, high, strict=True)
    )
    if area < MIN_AREA_FRACTION * extent**2:
        raise ProfileError(
            f"the contour ({reach} mm) encloses no area; allowed: points around the cam"
        )
    if not encloses_axis(points):
        x, y = (1e3 * coordinate for coordinate in placement.axis)
        raise ProfileError(
            f"the axis of the cam ({x:g}, {y:g} mm) is outside of the contour ({reach} mm); "
            "allowed: --axis X,Y inside of it"
        )


def contour_warnings(points: FloatArray, is_table: bool) -> list[str]:
    """Return warnings about the points of a contour ``(2, n)`` (m), as texts.

    A contour must not cross itself. If ``is_table`` is True, the contour between the points is
    unknown. Then there must be no gaps between them, and at least `MIN_POINTS` points.
    """
    warnings = []
    if not LinearRing(points.T).is_simple:
        warnings.append("the contour crosses itself; allowed: points in their order around the cam")
    step = np.hypot(*(np.roll(points, -1, axis=1) - points))
    usual, widest = float(np.median(step)), int(np.argmax(step))
    if is_table and step[widest] > MAX_STEP_RATIO * usual:
        next_point = (widest + 1) % step.size + 1
        warnings.append(
            f"points {widest + 1} and {next_point} are {step[widest] * 1e3:.4g} mm apart, the "
            f"others {usual * 1e3:.4g} mm (median); the contour between them is unknown; allowed: "
            f"a closed contour without a step above {MAX_STEP_RATIO:g} medians"
        )
    if is_table and points.shape[1] < MIN_POINTS:
        warnings.append(
            f"the contour has {points.shape[1]} points, too few to interpolate between them; "
            f"allowed: {MIN_POINTS} or more"
        )
    return warnings


# Backlash of a frame or a rocker that a cam moves both ways.

#: Number of points of a contour through which a spline is drawn to compute the backlash.
CONTOUR_POINTS = 3600
#: Number of cam angles at which the backlash is computed.
READINGS = 360


def backlash(
    elements: tuple[Element, Element], curves: tuple[Curve, Curve], angle: FloatArray
) -> FloatArray:
    """Return the backlash (m) of a follower that a cam moves in both directions, ``(n,)``.

    It is the difference of the displacements s at which the two elements of the follower touch
    their contours. It is negative if the follower does not fit between them. ``angle`` are cam
    angles (rad), ``(n,)``.
    """
    low, high = (rest_on_contour(*pair, angle) for pair in zip(elements, curves, strict=True))
    return high - low


def both_elements(plates: tuple[Disc, ...]) -> tuple[Element, Element]:
    """Return the two elements of a follower that the cam moves in both directions.

    An element is a roller or a face.

    Raises
    ------
    ProfileError
        The cam moves the follower in one direction only.
    """
    second = plates[0].opposite if len(plates) == 1 else plates[1].element
    if second is None:
        raise ProfileError(
            "backlash needs two elements; allowed: a follower that its cam moves both ways"
        )
    return plates[0].element, second


def closure(follower: Follower, law: Law) -> FloatArray:
    """Return the backlash (m) of a follower on its computed contours, ``(360,)``.

    The backlash is the play of a follower that the cam moves in both directions. It is computed at
    `READINGS` equally spaced cam angles over the turn. The contours are splines through
    `CONTOUR_POINTS` points.
    """
    cam_contours = contours(follower, law, CONTOUR_POINTS)
    curves = [closed_curve(contour.points) for contour in cam_contours]
    elements = both_elements(tuple(contour.disc for contour in cam_contours))
    return backlash(elements, (curves[0], curves[-1]), turn_angles(READINGS))

"""Checks of a cam for reach, curvature and crossing, and its minimum base radius.

The reach checks ensure that the follower and its arm can be at all positions of the law.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.errors import ReachError
from cam_rig.extras import friendly_import_errors
from cam_rig.laws import Law
from cam_rig.laws.law import Extreme, extremes
from cam_rig.profile.contact import Element, Motion, Scan, Touch, greatest_between
from cam_rig.profile.disc import Contour, Disc, discs
from cam_rig.profile.faces import Swung, SwungCentre, SwungFace
from cam_rig.schema.cam import ConstantBreadth, Flat, Follower, InclinedFlat
from cam_rig.units import TURN, FloatArray

#: Relations of a checked value to its limit, by their text in messages.
RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "more than": operator.gt,
    "less than": operator.lt,
    "at most": operator.le,
}
#: Display units of checked values, and the factor that converts an SI value to each.
FACTORS = {"mm": 1e3, "mm/rad": 1e3, "°": 180.0 / np.pi, "1": 1.0, "crossings": 1.0}


@dataclass(frozen=True)
class Check:
    """Result of one check of a cam: a value and its limit.

    Parameters
    ----------
    name : str
        Name of the checked quantity.
    value, limit : float
        SI values. They are displayed in `unit`.
    relation : str
        Required relation of the value to the limit: a key of `RELATIONS`.
    unit : str
        Display unit: a key of `FACTORS`.
    angle : float, optional
        Cam angle of the value in rad. None for a check of the cam as a whole.
    remedy : str
        Change of the cam that is likely to help.
    is_fatal : bool
        True if a cam that fails cannot exist. Otherwise it is poor, but can be made.
    disc : str
        Name of the disc of conjugate cams, otherwise empty.

    Examples
    --------
    >>> check = Check("pressure angle", 0.6, "at most", 0.5, "°", 1.0, "let base_radius be larger")
    >>> check.passed, check.allowed
    (False, 'at most 28.648°')
    """

    name: str
    value: float
    relation: str
    limit: float
    unit: str
    angle: float | None
    remedy: str
    is_fatal: bool = True
    disc: str = ""

    @classmethod
    def at(
        cls, name: str, worst: Extreme, relation: str, limit: float, unit: str, remedy: str
    ) -> Check:
        """Return the check of an extreme value over the turn, at its cam angle.

        A cam that fails it cannot exist (``is_fatal`` is True). `worst` is the extreme value with
        its cam angle. It must have the `relation` to the `limit`, such as ≥. `remedy` is advice for
        the message.
        """
        return cls(name, worst.value, relation, limit, unit, worst.angle, remedy)

    @property
    def passed(self) -> bool:
        """True if the checked value satisfies the required relation to its limit."""
        return RELATIONS[self.relation](self.value, self.limit)

    @property
    def title(self) -> str:
        """Name of the check, for conjugate cams with the name of the disc."""
        return f"{self.disc} cam, {self.name}" if self.disc else self.name

    @property
    def angle_in_turn(self) -> float | None:
        """Cam angle (rad, in one turn) of the checked value, None for the cam as a whole."""
        return None if self.angle is None else self.angle % TURN

    @property
    def degrees(self) -> float | None:
        """Cam angle (degrees, in one turn) of the checked value, None for the whole cam."""
        return None if self.angle is None else float(np.degrees(self.angle)) % 360.0

    def format_value(self, value: float) -> str:
        """Return a value of the check as text in its display unit."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{value * FACTORS[self.unit]:.5g}{unit}".replace(" °", "°")

    @property
    def allowed(self) -> str:
        """Required relation and limit of a checked value as text, such as "≥ 2 mm"."""
        return f"{self.relation} {self.format_value(self.limit)}"

    def __str__(self) -> str:
        """Return the check as one line with angle, value, limit and remedy."""
        where = "" if self.degrees is None else f" at {self.degrees:.4g}°"
        return (
            f"{self.title} is {self.format_value(self.value)}{where}; allowed: {self.allowed}; "
            f"{self.remedy}"
        )


#: Number of points of the contour that is checked for crossings: one per 0.1°.
CROSSING_POINTS = 3600


def reach_checks(scan: Scan) -> Iterator[Check]:
    """Yield the checks that the follower can reach all positions of the law.

    They compare the distance from the cam's axis, and for a follower on an arm the angle of the arm
    and the distance of the cam from the pivot, with their geometric limits.
    """
    element, law = scan.element, scan.law
    nearest = min_clearance(element, law)
    remedy = "the cam would not hold its shaft: let base_radius be larger"
    yield Check.at("distance from the axis", nearest, "more than", 0.0, "mm", remedy)
    if isinstance(element, Swung):
        yield from _arm_checks(element, law)
    yield from pivot_checks(scan)
    # The checked value is 1 + φ' of eq. 2.28. If it is 0, the contact is at infinity.
    if isinstance(element, SwungFace):
        back = greatest_between(lambda angle: -law(angle, 1), law.breaks)
        turn = Extreme(1.0 - back.value / element.arm, back.angle)
        remedy = "the face falls faster than the cam turns: let the fall be longer or the lift less"
        yield Check.at("turn of the face per turn", turn, "more than", 0.0, "1", remedy)


def min_clearance(element: Element, law: Law) -> Extreme:
    """Return the least distance (m) of the follower's element from the cam's axis.

    The element is a roller, a point or a face. The least distance occurs at the lowest or the
    highest lift.
    """
    ends = extremes(law, 0)
    distances = [Extreme(float(element.clearance(np.array(s.value))), s.angle) for s in ends]
    return min(distances, key=lambda extreme: extreme.value)


def _arm_checks(element: Swung, law: Law) -> Iterator[Check]:
    """Yield the checks of an oscillating follower's arm angle at both ends of the lift.

    The angle is compared with its geometric limits, beyond which the arm cannot follow the cam.
    """
    least, greatest = (0.0, np.pi) if isinstance(element, SwungCentre) else (-np.pi / 2, np.pi / 2)
    remedy = "out of reach: let pivot_distance or the arm be longer, or the lift less"
    ends = [Extreme(float(element.arm_angle(np.array(s.value))), s.angle) for s in extremes(law, 0)]
    low, high = sorted(ends, key=lambda end: end.value)  # a second arm is lowest at the top lift
    yield Check.at("angle of the arm", low, "more than", least, "°", remedy)
    yield Check.at("angle of the arm", high, "less than", greatest, "°", remedy)


def pivot_checks(scan: Scan) -> Iterator[Check]:
    """Yield the check that the cam does not cut the pivot of the follower's arm.

    Yields nothing if the follower has no arm.
    """
    if isinstance(scan.element, Swung):
        farthest, pivot = scan.greatest(lambda touch: np.abs(touch.contact)), scan.element.pivot
        remedy = "the cam would cut the pivot: let pivot_distance be longer"
        yield Check.at("largest radius of the cam", farthest, "less than", pivot, "mm", remedy)


def crossing_check(disc: Disc, law: Law) -> Check:
    """Return the check that the contour of a disc does not cross itself.

    A contour crosses itself at a neck that is narrower than the roller.
    """
    with friendly_import_errors():
        from shapely import LinearRing, Polygon, is_valid_reason
    contour, angle = Contour.of(disc, Motion.uniform(law, CROSSING_POINTS)), None
    points = contour.points.T
    if not LinearRing(points).is_simple:
        numbers = re.findall(r"-?\d[\d.]*(?:e-?\d+)?", is_valid_reason(Polygon(points)))
        crossing = np.array([float(number) for number in numbers[:2]])
        angle = float(contour.angle[np.argmin(np.hypot(*(points - crossing).T))])
    remedy, count = "let base_radius be larger or the roller smaller", float(angle is not None)
    return Check("contour across itself", count, "at most", 0.0, "crossings", angle, remedy)


# Radius of curvature: undercut, cusps, and rollers that are too large (profile thesis,
# §2.3.1-2.3.2).

#: Largest radius of curvature that counts as a cusp (radius 0) of the contour, as a fraction of the
#: base radius.
CUSP_RATIO = 1e-9


def _curvature(touch: Touch) -> FloatArray:
    assert touch.pitch_curvature is not None
    return touch.pitch_curvature


def sharpest_convex(scan: Scan) -> Extreme:
    """Return the least convex radius of curvature of the contour, m.

    It is not positive if the contour is undercut, and infinite if no part is convex.
    """
    if scan.touch.pitch_curvature is None:
        return scan.least(lambda touch: touch.radius)
    sharpest = scan.greatest(_curvature)
    radius = 1.0 / sharpest.value - scan.element.roller if sharpest.value > 0.0 else np.inf
    return Extreme(radius, sharpest.angle)


def sharpest_concave(scan: Scan) -> Extreme | None:
    """Return the least concave radius of curvature of the contour, m.

    It is a positive number: the sum of the radius of the pitch curve and the radius of the roller.
    The result is None for a face, and if no part is concave.
    """
    if scan.touch.pitch_curvature is None:
        return None
    least = scan.least(_curvature)
    if not least.value < 0.0:
        return None
    return Extreme(scan.element.roller - 1.0 / least.value, least.angle)


def curvature_checks(scan: Scan, follower: Follower, min_base: float | None) -> Iterator[Check]:
    """Yield the checks of the contour's radius of curvature.

    Convex parts are checked for undercut and for the least radius that the cam file requires.
    Concave parts are compared with the radius of the roller. ``min_base`` is the minimum base
    radius (m), None if it is not known.
    """
    base, required = follower.base_radius.si, follower.least_curvature_radius
    convex = sharpest_convex(scan)
    radius = 0.0 if abs(convex.value) <= CUSP_RATIO * base else convex.value
    remedy = "no base_radius would do: let the spans be longer, the lift less or the roller smaller"
    if min_base is not None:
        remedy = f"let base_radius be more than {min_base * 1e3:.5g} mm"
    limit = 0.0 if required is None else required.si
    sharpest = Extreme(radius, convex.angle)
    check = Check.at("convex radius of curvature", sharpest, "more than", limit, "mm", remedy)
    yield replace(check, is_fatal=radius <= 0.0)
    concave, roller = sharpest_concave(scan), scan.element.roller
    if concave is not None and roller > 0.0:
        remedy = "let the roller be smaller or the spans longer"
        yield Check.at("concave radius of curvature", concave, "more than", roller, "mm", remedy)


def corner_check(law: Law, tolerance: float) -> Check:
    """Return the check that the contour has no corner.

    The contour has a corner at a cam angle at which s' jumps. ``tolerance`` is the largest allowed
    jump of s' divided by the lift, 1/rad.
    """
    jumps = np.abs(law.jumps(1))
    worst = int(np.argmax(jumps))
    step, limit = Extreme(float(jumps[worst]), float(law.breaks[worst])), tolerance * law.lift
    remedy = "let the segments join with one slope, for the contour has a corner there"
    return Check.at("step of the slope s'", step, "at most", limit, "mm/rad", remedy)


# Minimum base radius without undercut (profile thesis, eq. 2.42, and its counterpart for rollers).

#: In the search for the minimum base radius, a base radius without undercut is multiplied by this
#: factor, and one with undercut is divided by it.
BASE_STEP = 0.5
#: Smallest base radius in the search for the minimum, as a fraction of the cam's base radius.
MIN_BASE_RATIO = 1e-2
#: Largest base radius in the search for the minimum, as a multiple of the cam's base radius.
MAX_BASE_RATIO = 1e3
#: Tolerance of the minimum base radius, as a fraction of the cam's base radius.
BASE_RTOL = 1e-12


def find_min_base_radius(follower: Follower, law: Law) -> float | None:
    """Return the minimum base radius (m), or None if no base radius is sufficient.

    With a larger base radius the least convex radius of curvature exceeds the limit of the cam file
    (default: 0), and the follower does not cross the cam's axis. A face in a guide has closed
    forms: the radius of curvature is R_b + (s + s'') cos β, and the distance from the axis is
    R_b + s cos β, with the base radius R_b and the inclination β of the face. For other followers
    `search_base_radius` is used. The result is also None if the cam cuts the pivot of an arm at the
    minimum base radius.

    References
    ----------
    Profile thesis, eq. 2.42.
    """
    required, base_radius = follower.least_curvature_radius, follower.base_radius.si
    sharpest = 0.0 if required is None else required.si
    if isinstance(follower, Flat | InclinedFlat | ConstantBreadth):
        plates = discs(follower, law)
        nearest = min_clearance(plates[0].element, law).value
        return max(
            0.0, base_radius + sharpest - _min_convex_radius(plates, law), base_radius - nearest
        )

    def margin(base: float) -> float:
        plates = discs_on(follower, law, base)
        value = _min_convex_radius(plates, law) - sharpest if plates else -base_radius
        return min(max(value, -base_radius), base_radius)  # brentq needs finite values

    least = search_base_radius(margin, base_radius)
    if not least:
        return least
    # A larger base radius brings the cam closer to the pivot of the arm.
    plates = discs_on(follower, law, least * (1.0 + BASE_RTOL))
    checks = (check for disc in plates for check in pivot_checks(Scan(law, disc.element)))
    return least if all(check.passed for check in checks) else None


def search_base_radius(margin: Callable[[float], float], base_radius: float) -> float | None:
    """Find the base radius (m) at which the margin of a check is 0.

    The margin must be finite and increase with the base radius. The solution closest to
    `base_radius` is returned.

    Parameters
    ----------
    margin : callable
        Margin of a base radius in m. A positive margin means that the base radius is sufficient.
    base_radius : float
        Base radius of the cam in m, from which the search starts.

    Returns
    -------
    float or None
        The base radius in m. It is 0 if the margin is positive down to `MIN_BASE_RATIO` of the
        cam's base radius, and None if it is not positive up to `MAX_BASE_RATIO` of it.
    """
    from scipy.optimize import brentq  # takes 0.1 s, and few checks need it

    good = margin(base_radius) > 0.0
    base, factor = base_radius, BASE_STEP if good else 1.0 / BASE_STEP
    while MIN_BASE_RATIO * base_radius < base < MAX_BASE_RATIO * base_radius:
        next_base = base * factor
        if (margin(next_base) > 0.0) != good:
            low, high = sorted((base, next_base))
            return float(brentq(margin, low, high, xtol=BASE_RTOL * base_radius))
        base = next_base
    return 0.0 if good else None


def _min_convex_radius(plates: tuple[Disc, ...], law: Law) -> float:
    """Return the least convex radius of curvature of a cam's discs, m."""
    return min(sharpest_convex(Scan(law, disc.element)).value for disc in plates)


def discs_on(follower: Follower, law: Law, base: float) -> tuple[Disc, ...]:
    """Return the discs of a cam whose base radius is replaced by ``base`` (m).

    The result is empty if the follower does not reach the base circle, or crosses the axis.
    """
    try:
        plates = discs(follower, law, base)
    except ReachError:
        return ()
    clear = all(min_clearance(disc.element, law).value > 0.0 for disc in plates)
    return plates if clear else ()

"""What can be wrong with a cam: reach, curvature, crossing; and the least base radius."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from cam_rig.errors import ReachError
from cam_rig.extras import libraries_named
from cam_rig.laws import Law
from cam_rig.laws.law import Extreme, extremes
from cam_rig.profile.contact import Element, Motion, Scan, Touch, greatest_between
from cam_rig.profile.disc import Contour, Disc, discs
from cam_rig.profile.faces import Swung, SwungCentre, SwungFace
from cam_rig.schema.cam import ConstantBreadth, Flat, Follower, InclinedFlat
from cam_rig.units import TURN, FloatArray

# One check of a cam: a value, its limit, and the angle where it is.

#: How a value has to be to its limit.
RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "more than": operator.gt,
    "less than": operator.lt,
    "at most": operator.le,
}
#: Units that checks are shown in, and their factor from SI.
FACTORS = {"mm": 1e3, "mm/rad": 1e3, "°": 180.0 / np.pi, "1": 1.0, "crossings": 1.0}


@dataclass(frozen=True)
class Check:
    """One thing that is right with a cam, or wrong.

    value, limit : SI units, shown in the unit, of `FACTORS`; the relation is one of `RELATIONS`
    angle : rad, the cam angle where the value is; None for the cam as a whole
    vital : whether a cam that fails cannot exist; else it is bad, but can be made
    disc : which of conjugate cams; empty otherwise
    """

    name: str
    value: float
    relation: str
    limit: float
    unit: str
    angle: float | None
    remedy: str
    vital: bool = True
    disc: str = ""

    @classmethod
    def at(
        cls, name: str, worst: Extreme, relation: str, limit: float, unit: str, remedy: str
    ) -> Check:
        """A vital one of a value and where it is."""
        return cls(name, worst.value, relation, limit, unit, worst.angle, remedy)

    @property
    def passed(self) -> bool:
        """Whether the value is as it has to be."""
        return RELATIONS[self.relation](self.value, self.limit)

    @property
    def title(self) -> str:
        """The name, with the disc's where there are two."""
        return f"{self.disc} cam, {self.name}" if self.disc else self.name

    @property
    def place(self) -> float | None:
        """The cam angle in its turn, rad."""
        return None if self.angle is None else self.angle % TURN

    @property
    def degrees(self) -> float | None:
        """The cam angle in degrees."""
        return None if self.angle is None else float(np.degrees(self.angle)) % 360.0

    def shown(self, value: float) -> str:
        """A value in the unit for showing."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{value * FACTORS[self.unit]:.5g}{unit}".replace(" °", "°")

    @property
    def allowed(self) -> str:
        """Relation and limit, in words."""
        return f"{self.relation} {self.shown(self.limit)}"

    def __str__(self) -> str:
        """What is wrong, in one line: angle, value, limit, remedy."""
        where = "" if self.degrees is None else f" at {self.degrees:.4g}°"
        return (
            f"{self.title} is {self.shown(self.value)}{where}; allowed: {self.allowed}; "
            f"{self.remedy}"
        )


#: Points of the contour that is tried for crossing itself.
OUTLINE = 3600


def reach_checks(scan: Scan) -> Iterator[Check]:
    """What the kind of follower can reach."""
    element, law = scan.element, scan.law
    nearest = least_clearance(element, law)
    remedy = "the cam would not hold its shaft: let base_radius be larger"
    yield Check.at("distance from the axis", nearest, "more than", 0.0, "mm", remedy)
    if isinstance(element, Swung):
        yield from _arm(element, law)
    yield from pivot_checks(scan)
    if isinstance(element, SwungFace):  # 1 + φ' of eq. 2.28: at 0 the contact is at infinity
        back = greatest_between(lambda angle: -law(angle, 1), law.breaks)
        turn = Extreme(1.0 - back.value / element.arm, back.angle)
        remedy = "the face falls faster than the cam turns: let the fall be longer or the lift less"
        yield Check.at("turn of the face per turn", turn, "more than", 0.0, "1", remedy)


def least_clearance(element: Element, law: Law) -> Extreme:
    """How near (m) roller, point or face come to the cam's axis: at one end of the lift."""
    ends = extremes(law, 0)
    found = [Extreme(float(element.clearance(np.array(s.value))), s.angle) for s in ends]
    return min(found, key=lambda extreme: extreme.value)


def _arm(element: Swung, law: Law) -> Iterator[Check]:
    """An arm past these angles would have to follow the cam backwards."""
    least, greatest = (0.0, np.pi) if isinstance(element, SwungCentre) else (-np.pi / 2, np.pi / 2)
    remedy = "out of reach: let pivot_distance or the arm be longer, or the lift less"
    ends = [Extreme(float(element.arm_angle(np.array(s.value))), s.angle) for s in extremes(law, 0)]
    low, high = sorted(ends, key=lambda end: end.value)  # a second arm is nearest at the top
    yield Check.at("angle of the arm", low, "more than", least, "°", remedy)
    yield Check.at("angle of the arm", high, "less than", greatest, "°", remedy)


def pivot_checks(scan: Scan) -> Iterator[Check]:
    """That the cam does not cut the pivot of an arm."""
    if isinstance(scan.element, Swung):
        farthest, pivot = scan.greatest(lambda touch: np.abs(touch.contact)), scan.element.pivot
        remedy = "the cam would cut the pivot: let pivot_distance be longer"
        yield Check.at("largest radius of the cam", farthest, "less than", pivot, "mm", remedy)


def crossing_check(disc: Disc, law: Law) -> Check:
    """Two places of the contour in each other's way: a neck narrower than the roller."""
    with libraries_named():
        from shapely import LinearRing, Polygon, is_valid_reason
    contour, found = Contour.of(disc, Motion.uniform(law, OUTLINE)), None
    points = contour.points.T
    if not LinearRing(points).is_simple:
        numbers = re.findall(r"-?\d[\d.]*(?:e-?\d+)?", is_valid_reason(Polygon(points)))
        place = np.array([float(number) for number in numbers[:2]])
        found = float(contour.angle[np.argmin(np.hypot(*(points - place).T))])
    remedy, count = "let base_radius be larger or the roller smaller", float(found is not None)
    return Check("contour across itself", count, "at most", 0.0, "crossings", found, remedy)


# Radius of curvature: undercut, cusp, and a roller that does not fit (§2.3.1-2.3.2).

#: Radii of curvature below this fraction of the base radius are none: a cusp.
CUSP = 1e-9


def _curvature(touch: Touch) -> FloatArray:
    assert touch.pitch_curvature is not None
    return touch.pitch_curvature


def sharpest_convex(scan: Scan) -> Extreme:
    """Least convex radius of the contour, m: not positive where undercut, infinite without one."""
    if scan.touch.pitch_curvature is None:
        return scan.least(lambda touch: touch.radius)
    most = scan.greatest(_curvature)
    radius = 1.0 / most.value - scan.element.roller if most.value > 0.0 else np.inf
    return Extreme(radius, most.angle)


def sharpest_concave(scan: Scan) -> Extreme | None:
    """Least concave radius of the contour, m, positive: the pitch curve's and the roller's."""
    if scan.touch.pitch_curvature is None:
        return None
    least = scan.least(_curvature)
    if not least.value < 0.0:
        return None
    return Extreme(scan.element.roller - 1.0 / least.value, least.angle)


def curvature_checks(scan: Scan, follower: Follower, least_base: float | None) -> Iterator[Check]:
    """Convex parts against undercut and the radius asked for; concave parts against the roller."""
    base, asked = follower.base_radius.si, follower.least_curvature_radius
    convex = sharpest_convex(scan)
    radius = 0.0 if abs(convex.value) <= CUSP * base else convex.value
    remedy = "no base_radius would do: let the spans be longer, the lift less or the roller smaller"
    if least_base is not None:
        remedy = f"let base_radius be more than {least_base * 1e3:.5g} mm"
    limit = 0.0 if asked is None else asked.si
    sharpest = Extreme(radius, convex.angle)
    check = Check.at("convex radius of curvature", sharpest, "more than", limit, "mm", remedy)
    yield replace(check, vital=radius <= 0.0)
    concave, roller = sharpest_concave(scan), scan.element.roller
    if concave is not None and roller > 0.0:
        remedy = "let the roller be smaller or the spans longer"
        yield Check.at("concave radius of curvature", concave, "more than", roller, "mm", remedy)


def corner_check(law: Law, tolerance: float) -> Check:
    """The contour has a corner where the slope of the law jumps."""
    jumps = np.abs(law.jumps(1))
    worst = int(np.argmax(jumps))
    step, limit = Extreme(float(jumps[worst]), float(law.breaks[worst])), tolerance * law.lift
    remedy = "let the segments join with one slope, for the contour has a corner there"
    return Check.at("step of the slope s'", step, "at most", limit, "mm/rad", remedy)


# The smallest base radius that avoids undercut (eq. 2.42, and its counterpart for rollers).

#: The search goes from the cam's own base radius by these factors, to these ends of it.
SMALLER, LARGER = 0.5, 2.0
LEAST, MOST = 1e-2, 1e3
#: The base radius is found to this fraction of the cam's own.
PRECISION = 1e-12


def least_base_radius(follower: Follower, law: Law) -> float | None:
    """The base radius (m) above which no convex part is sharper than the least radius asked for.

    Nor does the follower cross the cam's axis. A face in a guide has both in closed form: radius
    R_b + (s + s'') cos β, distance from the axis R_b + s cos β. For the others see `least_base`;
    None too where the cam cuts the pivot of an arm there.
    """
    asked, own = follower.least_curvature_radius, follower.base_radius.si
    sharpest = 0.0 if asked is None else asked.si
    if isinstance(follower, Flat | InclinedFlat | ConstantBreadth):
        plates = discs(follower, law)
        nearest = least_clearance(plates[0].element, law).value
        return max(0.0, own + sharpest - _sharpest(plates, law), own - nearest)

    def margin(base: float) -> float:
        found = plates_on(follower, law, base)
        value = _sharpest(found, law) - sharpest if found else -own
        return min(max(value, -own), own)  # finite, for the root finder

    least = least_base(margin, own)
    if not least:
        return least
    # on larger base radii the cam sooner cuts the pivot
    found = plates_on(follower, law, least * (1.0 + PRECISION))
    checks = (check for disc in found for check in pivot_checks(Scan(law, disc.element)))
    return least if all(check.passed for check in checks) else None


def least_base(margin: Callable[[float], float], own: float) -> float | None:
    """The root next to ``own`` of a finite margin that grows with the base radius (m).

    0 where it is positive down to a hundredth of ``own``, None where it nowhere is.
    """
    good = margin(own) > 0.0
    here, factor = own, SMALLER if good else LARGER
    while LEAST * own < here < MOST * own:
        there = here * factor
        if (margin(there) > 0.0) != good:
            low, high = sorted((here, there))
            return float(brentq(margin, low, high, xtol=PRECISION * own))
        here = there
    return 0.0 if good else None


def _sharpest(plates: tuple[Disc, ...], law: Law) -> float:
    return min(sharpest_convex(Scan(law, disc.element)).value for disc in plates)


def plates_on(follower: Follower, law: Law, base: float) -> tuple[Disc, ...]:
    """The discs on another base radius; none where the follower does not reach."""
    try:
        plates = discs(follower, law, base)
    except ReachError:
        return ()
    clear = all(least_clearance(disc.element, law).value > 0.0 for disc in plates)
    return plates if clear else ()

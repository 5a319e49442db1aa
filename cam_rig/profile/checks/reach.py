"""Whether a follower gets to every contact that the law asks for."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from shapely import LinearRing, Polygon, is_valid_reason

from cam_rig.laws import Law
from cam_rig.laws.peaks import Extreme, extremes
from cam_rig.profile.checks.check import Check
from cam_rig.profile.contact import Element
from cam_rig.profile.contour import Contour
from cam_rig.profile.disc import Disc
from cam_rig.profile.extremes import Scan, greatest_between
from cam_rig.profile.flat_face import SwungFace
from cam_rig.profile.motion import Motion
from cam_rig.profile.roller import SwungCentre

#: Points of the contour that is tried for crossing itself.
OUTLINE = 3600


def reach_checks(scan: Scan) -> Iterator[Check]:
    """What the kind of follower can reach."""
    element, law = scan.element, scan.law
    yield _around_the_axis(element, law)
    if isinstance(element, SwungCentre | SwungFace):
        yield from _arm(element, law)
    yield from pivot_checks(scan)
    if isinstance(element, SwungFace):
        yield _turning(element, law)


def _around_the_axis(element: Element, law: Law) -> Check:
    nearest = least_clearance(element, law)
    return Check(
        "distance from the axis",
        nearest.value,
        "more than",
        0.0,
        "mm",
        nearest.angle,
        "the cam would not hold its shaft: let base_radius be larger",
    )


def least_clearance(element: Element, law: Law) -> Extreme:
    """How near (m) roller, point or face come to the cam's axis: at one end of the lift."""
    ends = extremes(law, 0)
    found = [Extreme(float(element.clearance(np.array(s.value))), s.angle) for s in ends]
    return min(found, key=lambda extreme: extreme.value)


def _arm(element: SwungCentre | SwungFace, law: Law) -> Iterator[Check]:
    """An arm past these angles would have to follow the cam backwards."""
    least, greatest = (0.0, np.pi) if isinstance(element, SwungCentre) else (-np.pi / 2, np.pi / 2)
    remedy = "out of reach: let pivot_distance or the arm be longer, or the lift less"
    ends = [(float(element.arm_angle(np.array(s.value))), s) for s in extremes(law, 0)]
    ends.sort(key=lambda end: end[0])  # a second arm is nearest at the greatest lift
    for (arm_angle, extreme), relation, limit in zip(
        ends, ("more than", "less than"), (least, greatest), strict=True
    ):
        yield Check("angle of the arm", arm_angle, relation, limit, "°", extreme.angle, remedy)


def pivot_checks(scan: Scan) -> Iterator[Check]:
    """That the cam does not cut the pivot of an arm."""
    if not isinstance(scan.element, SwungCentre | SwungFace):
        return
    farthest = scan.greatest(lambda touch: np.abs(touch.contact))
    yield Check(
        "largest radius of the cam",
        farthest.value,
        "less than",
        scan.element.pivot,
        "mm",
        farthest.angle,
        "the cam would cut the pivot: let pivot_distance be longer",
    )


def _turning(element: SwungFace, law: Law) -> Check:
    """1 + φ' of eq. 2.28: at 0 the contact is at infinity."""
    back = greatest_between(lambda angle: -law(angle, 1), law.breaks)
    return Check(
        "turn of the face per turn",
        1.0 - back.value / element.arm,
        "more than",
        0.0,
        "1",
        back.angle,
        "the face falls faster than the cam turns: let the fall be longer or the lift less",
    )


def crossing_check(disc: Disc, law: Law) -> Check:
    """Two places of the contour in each other's way: a neck narrower than the roller."""
    found = _crossing(Contour.of(disc, Motion.uniform(law, OUTLINE)))
    return Check(
        "contour across itself",
        float(found is not None),
        "at most",
        0.0,
        "crossings",
        found,
        "let base_radius be larger or the roller smaller",
    )


def _crossing(contour: Contour) -> float | None:
    """Cam angle (rad) near a crossing."""
    points = contour.points.T
    if LinearRing(points).is_simple:
        return None
    numbers = re.findall(r"-?\d[\d.]*(?:e-?\d+)?", is_valid_reason(Polygon(points)))
    place = np.array([float(number) for number in numbers[:2]])
    nearest = int(np.argmin(np.hypot(*(points - place).T)))
    return float(contour.angle[nearest])

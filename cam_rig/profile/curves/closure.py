"""Play of a frame or a rocker that a cam moves both ways: whether both its elements touch."""

from __future__ import annotations

from cam_rig.arrays import FloatArray
from cam_rig.errors import ProfileError
from cam_rig.laws import Law
from cam_rig.profile.contact import Element
from cam_rig.profile.contour import contours
from cam_rig.profile.curves.measure import Curve, closed_curve, rest
from cam_rig.profile.disc import Disc
from cam_rig.profile.motion import turn_angles
from cam_rig.schema.follower import Follower

#: Points of a finished contour, and cam angles at which both elements are put on theirs.
POINTS, READINGS = 3600, 360


def play(
    elements: tuple[Element, Element], curves: tuple[Curve, Curve], angle: FloatArray
) -> FloatArray:
    """How far (m of s) the follower can move between its two contacts at cam angles (rad).

    The first element rests at the least displacement it is let down to, the second at the greatest
    it is let up to. 0: both touch. Negative: the follower does not go between its cams.

    Raises
    ------
    ProfileError : an element passes its contour by
    """
    low, high = (rest(one, curve, angle) for one, curve in zip(elements, curves, strict=True))
    return high - low


def pair(plates: tuple[Disc, ...]) -> tuple[Element, Element]:
    """The two elements of a follower that its cam moves both ways.

    Raises
    ------
    ProfileError : it has one
    """
    second = plates[0].opposite if len(plates) == 1 else plates[1].element
    if second is None:
        raise ProfileError("play of one element; allowed: a follower that its cam moves both ways")
    return plates[0].element, second


def closure(follower: Follower, law: Law) -> FloatArray:
    """``(360,)`` play (m) over the turn of a follower on its finished contours.

    The contours are splines through 3600 points: nothing of the law is used in the measurement.

    Raises
    ------
    ProfileError, ReachError : a follower of one element, or one that does not reach
    """
    found = contours(follower, law, POINTS)
    curves = [closed_curve(contour.points) for contour in found]
    elements = pair(tuple(contour.disc for contour in found))
    return play(elements, (curves[0], curves[-1]), turn_angles(READINGS))

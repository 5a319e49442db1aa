"""The discs of a cam, and the follower on each: one disc, or two for conjugate cams."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cam_rig.laws import Law
from cam_rig.profile.contact import Element
from cam_rig.profile.extremes import stroke
from cam_rig.profile.flat_face import GuidedFace, SwungFace
from cam_rig.profile.roller import GuidedCentre, SwungCentre
from cam_rig.schema import follower as kinds
from cam_rig.schema.follower import Follower
from cam_rig.schema.quantity import Quantity


@dataclass(frozen=True)
class Disc:
    """One cam plate.

    Parameters
    ----------
    name : empty, or which of the conjugate cams it is
    element : the element that shapes it
    opposite : another element that the same contour moves, on its other side
    """

    name: str
    element: Element
    opposite: Element | None = None


def discs(follower: Follower, law: Law, base_radius: float | None = None) -> tuple[Disc, ...]:
    """The discs of a cam with this follower and law.

    ``base_radius`` (m) replaces the follower's own, for a search.

    Raises
    ------
    ReachError : the follower does not reach the base circle
    """
    base = follower.base_radius.si if base_radius is None else base_radius
    build = _BUILDERS[type(follower)]
    return build(follower, law, base)


def _si(quantity: Quantity | None) -> float:
    return 0.0 if quantity is None else quantity.si


def _centre(follower: kinds.Point | kinds.Roller, law: Law, base: float) -> tuple[Disc, ...]:
    eccentricity = _si(follower.eccentricity)
    return (Disc("", GuidedCentre.on_base(base, follower.roller, eccentricity)),)


def _flat(follower: kinds.Flat, law: Law, base: float) -> tuple[Disc, ...]:
    return (Disc("", GuidedFace.on_base(base, 0.0, _si(follower.eccentricity))),)


def _inclined(follower: kinds.InclinedFlat, law: Law, base: float) -> tuple[Disc, ...]:
    inclination = follower.inclination.si
    return (Disc("", GuidedFace.on_base(base, inclination, _si(follower.eccentricity))),)


def _swung_centre(
    follower: kinds.OscillatingPoint | kinds.OscillatingRoller, law: Law, base: float
) -> tuple[Disc, ...]:
    arm, pivot = follower.arm.si, follower.pivot_distance.si
    return (Disc("", SwungCentre.on_base(base, follower.roller, arm, pivot)),)


def _swung_face(follower: kinds.OscillatingFlat, law: Law, base: float) -> tuple[Disc, ...]:
    arm, pivot = follower.arm.si, follower.pivot_distance.si
    return (Disc("", SwungFace.on_base(base, arm, _si(follower.face_offset), pivot)),)


def _breadth(follower: kinds.ConstantBreadth, law: Law, base: float) -> tuple[Disc, ...]:
    """Faces 2 R_b + s_max apart (profile thesis §2.2.2)."""
    opposite = GuidedFace(0.0, 0.0, base + stroke(law), side=-1)
    return (Disc("", GuidedFace.on_base(base, 0.0, 0.0), opposite),)


def _diameter(follower: kinds.ConstantDiameter, law: Law, base: float) -> tuple[Disc, ...]:
    """Rollers 2 R_p + s_max apart."""
    start = base + follower.roller + stroke(law)
    opposite = GuidedCentre(follower.roller, 0.0, start, side=-1)
    return (Disc("", GuidedCentre.on_base(base, follower.roller, 0.0), opposite),)


def _conjugate(follower: kinds.Conjugate, law: Law, base: float) -> tuple[Disc, ...]:
    """The second cam lets down what the first one lifts (profile thesis §2.2.2)."""
    eccentricity = _si(follower.eccentricity)
    first = GuidedCentre.on_base(base, follower.roller, eccentricity)
    start = first.start + stroke(law)
    if follower.roller_distance is not None:
        start = follower.roller_distance.si - first.start
    second = GuidedCentre(follower.roller, -eccentricity, start, side=-1)
    return Disc("first", first), Disc("second", second)


def _swung_conjugate(
    follower: kinds.OscillatingConjugate, law: Law, base: float
) -> tuple[Disc, ...]:
    """Two arms of one rocker: the second roller sinks as the first one rises."""
    roller, arm, pivot = follower.roller, follower.arm.si, follower.pivot_distance.si
    first = SwungCentre.on_base(base, roller, arm, pivot)
    start = first.start + stroke(law) / arm
    if follower.arms_angle is not None:
        start = follower.arms_angle.si - first.start
    second = SwungCentre(roller, arm, pivot, start, side=-1)
    return Disc("first", first), Disc("second", second)


_BUILDERS: dict[type, Callable[..., tuple[Disc, ...]]] = {
    kinds.Point: _centre,
    kinds.Roller: _centre,
    kinds.Flat: _flat,
    kinds.InclinedFlat: _inclined,
    kinds.OscillatingPoint: _swung_centre,
    kinds.OscillatingRoller: _swung_centre,
    kinds.OscillatingFlat: _swung_face,
    kinds.ConstantBreadth: _breadth,
    kinds.ConstantDiameter: _diameter,
    kinds.Conjugate: _conjugate,
    kinds.OscillatingConjugate: _swung_conjugate,
}

"""The discs of a cam, and the follower on each: one disc, or two for conjugate cams."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cam_rig.laws import Law
from cam_rig.profile.contact import Element, Motion, Touch, stroke
from cam_rig.profile.faces import GuidedCentre, GuidedFace, SwungCentre, SwungFace
from cam_rig.schema import cam as kinds
from cam_rig.schema.cam import Follower
from cam_rig.schema.quantity import Quantity
from cam_rig.units import ComplexArray, FloatArray


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


def _face(follower: kinds.Flat | kinds.InclinedFlat, law: Law, base: float) -> tuple[Disc, ...]:
    inclination = follower.inclination.si if isinstance(follower, kinds.InclinedFlat) else 0.0
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
    kinds.Flat: _face,
    kinds.InclinedFlat: _face,
    kinds.OscillatingPoint: _swung_centre,
    kinds.OscillatingRoller: _swung_centre,
    kinds.OscillatingFlat: _swung_face,
    kinds.ConstantBreadth: _breadth,
    kinds.ConstantDiameter: _diameter,
    kinds.Conjugate: _conjugate,
    kinds.OscillatingConjugate: _swung_conjugate,
}


# The contour of a cam in its own frame, with curvature and pressure angle (kinematic inversion).


@dataclass(frozen=True, eq=False)
class Contour:
    """The contour of one disc; point i is the one the follower touches at cam angle i.

    Parameters
    ----------
    disc : the disc and its follower
    angle : ``(n,)`` cam angles, rad
    points, normal : ``(2, n)`` m, and unit vectors out of the cam
    radius : ``(n,)`` m, radius of curvature: positive where convex, negative where concave
    rate : ``(n,)`` m/rad, dP/dθ along the clockwise tangent; not positive: undercut
    pressure : ``(n,)`` rad, pressure angle, signed
    pitch : ``(2, n)`` m, path of the roller's centre or of the point; None for a face
    """

    disc: Disc
    angle: FloatArray
    points: FloatArray
    normal: FloatArray
    radius: FloatArray
    rate: FloatArray
    pressure: FloatArray
    pitch: FloatArray | None

    @property
    def tangent(self) -> FloatArray:
        """``(2, n)`` unit vectors along the contour, clockwise around the cam."""
        return np.stack([self.normal[1], -self.normal[0]])

    @classmethod
    def of(cls, disc: Disc, motion: Motion) -> Contour:
        """The contour of a disc at the angles of a motion."""
        touch: Touch = disc.element.touch(motion)
        turn = np.exp(-1j * motion.angle)
        return cls(
            disc=disc,
            angle=motion.angle,
            points=_plane(touch.contact * turn),
            normal=_plane(touch.normal * turn),
            radius=touch.radius,
            rate=touch.rate,
            pressure=touch.pressure,
            pitch=None if touch.centre is None else _plane(touch.centre * turn),
        )


def contours(follower: Follower, law: Law, count: int) -> tuple[Contour, ...]:
    """The contours of a cam, one a disc, at ``count`` equal steps of the cam angle.

    Nothing is checked here but that the follower reaches its base circle: see `checks`.

    Raises
    ------
    ReachError : the follower does not reach the base circle
    """
    motion = Motion.uniform(law, count)
    return tuple(Contour.of(disc, motion) for disc in discs(follower, law))


def contours_at(follower: Follower, law: Law, angle: FloatArray) -> tuple[Contour, ...]:
    """The same at any cam angles, rad."""
    motion = Motion.at(law, angle)
    return tuple(Contour.of(disc, motion) for disc in discs(follower, law))


def _plane(values: ComplexArray) -> FloatArray:
    return np.stack([values.real, values.imag])

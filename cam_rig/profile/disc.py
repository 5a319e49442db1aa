"""Discs of a cam and their contours, computed from the follower and the law.

A cam has one disc (plate), or two if it is a pair of conjugate cams.
"""

from __future__ import annotations

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
    """Disc of a cam, with the roller, point or face of the follower that touches it.

    Parameters
    ----------
    name : str
        Name of the disc of conjugate cams, otherwise empty.
    element : Element
        Element of the follower that determines the contour.
    opposite : Element, optional
        Second element of the follower, on the other side of the same contour.
    """

    name: str
    element: Element
    opposite: Element | None = None


def discs(follower: Follower, law: Law, base_radius: float | None = None) -> tuple[Disc, ...]:
    """Return the discs of a cam with this follower and law.

    Parameters
    ----------
    follower : Follower
        Follower of the cam file.
    law : Law
        Law of the cam.
    base_radius : float, optional
        Base radius in m (default: that of the follower).

    Returns
    -------
    tuple of Disc
        One disc, or two for conjugate cams.

    Raises
    ------
    ReachError
        The follower does not reach the base circle.

    References
    ----------
    Profile thesis, §2.2.2 (desmodromic cams).
    """
    base = follower.base_radius.si if base_radius is None else base_radius
    roller, eccentricity = follower.roller, _si(getattr(follower, "eccentricity", None))
    match follower:
        case kinds.Point() | kinds.Roller():
            plates = [Disc("", GuidedCentre.on_base(base, roller, eccentricity))]
        case kinds.Flat() | kinds.InclinedFlat():
            inclination = _si(getattr(follower, "inclination", None))
            plates = [Disc("", GuidedFace.on_base(base, inclination, eccentricity))]
        case kinds.OscillatingPoint() | kinds.OscillatingRoller():
            arm, pivot = follower.arm.si, follower.pivot_distance.si
            plates = [Disc("", SwungCentre.on_base(base, roller, arm, pivot))]
        case kinds.OscillatingFlat():
            arm, pivot = follower.arm.si, follower.pivot_distance.si
            plates = [Disc("", SwungFace.on_base(base, arm, _si(follower.face_offset), pivot))]
        case kinds.ConstantBreadth():  # faces 2 R_b + s_max apart (profile thesis §2.2.2)
            face = GuidedFace(0.0, 0.0, base + stroke(law), side=-1)
            plates = [Disc("", GuidedFace.on_base(base, 0.0, 0.0), face)]
        case kinds.ConstantDiameter():  # rollers 2 R_p + s_max apart
            other = GuidedCentre(roller, 0.0, base + roller + stroke(law), side=-1)
            plates = [Disc("", GuidedCentre.on_base(base, roller, 0.0), other)]
        case kinds.Conjugate():  # the second roller sinks as the first one rises (§2.2.2)
            first = GuidedCentre.on_base(base, roller, eccentricity)
            start = first.start + stroke(law)
            if follower.roller_distance is not None:
                start = follower.roller_distance.si - first.start
            second = GuidedCentre(roller, -eccentricity, start, side=-1)
            plates = [Disc("first", first), Disc("second", second)]
        case kinds.OscillatingConjugate():  # the follower is a rocker with two arms
            plates = _rocker(follower, law, base)
    return tuple(plates)


def _si(quantity: Quantity | None) -> float:
    return 0.0 if quantity is None else quantity.si


def _rocker(follower: kinds.OscillatingConjugate, law: Law, base: float) -> list[Disc]:
    """Return the two discs of oscillating conjugate cams, whose follower has two arms.

    The second roller sinks as the first roller rises. `base` is the base radius, m.
    """
    roller, arm, pivot = follower.roller, follower.arm.si, follower.pivot_distance.si
    first = SwungCentre.on_base(base, roller, arm, pivot)
    start = first.start + stroke(law) / arm
    if follower.arms_angle is not None:
        start = follower.arms_angle.si - first.start
    return [Disc("first", first), Disc("second", SwungCentre(roller, arm, pivot, start, side=-1))]


# Contour of a cam in the cam frame, with curvature and pressure angle (kinematic inversion).


@dataclass(frozen=True, eq=False)
class Contour:
    """Contour of one disc in the cam frame, as points by the cam angle of their contact.

    The follower touches point i at cam angle i.

    Parameters
    ----------
    disc : Disc
        The disc.
    angle : FloatArray
        Cam angles in rad, shape ``(n,)``.
    points : FloatArray
        Points in m, shape ``(2, n)``.
    normal : FloatArray
        Unit vectors out of the cam, shape ``(2, n)``.
    radius : FloatArray
        Radius of curvature in m, shape ``(n,)``: positive where convex, negative where concave.
    rate : FloatArray
        dP/dθ along the clockwise tangent in m/rad, shape ``(n,)``. Not positive where undercut.
    pressure : FloatArray
        Signed pressure angle in rad, shape ``(n,)``.
    pitch : FloatArray, optional
        Path of the roller's centre, or of the point, in m, shape ``(2, n)``. None for a face.
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
        """Unit vectors along the contour, clockwise around the cam, shape ``(2, n)``."""
        return np.stack([self.normal[1], -self.normal[0]])

    @classmethod
    def of(cls, disc: Disc, motion: Motion) -> Contour:
        """Return the contour of a disc, sampled at the cam angles of a motion."""
        touch: Touch = disc.element.touch(motion)
        turn = np.exp(-1j * motion.angle)
        return cls(
            disc=disc,
            angle=motion.angle,
            points=plane(touch.contact * turn),
            normal=plane(touch.normal * turn),
            radius=touch.radius,
            rate=touch.rate,
            pressure=touch.pressure,
            pitch=None if touch.centre is None else plane(touch.centre * turn),
        )


def contours(follower: Follower, law: Law, count: int) -> tuple[Contour, ...]:
    """Return the contours of a cam at `count` equal steps of the cam angle, one per disc.

    They are not checked. `cam_rig.profile.cam_checks.check_cam` checks a cam.

    Parameters
    ----------
    follower : Follower
        Follower of the cam file.
    law : Law
        Law of the cam.
    count : int
        Number of points of each contour.

    Returns
    -------
    tuple of Contour
        One contour, or two for conjugate cams.

    Raises
    ------
    ReachError
        The follower does not reach the base circle.
    """
    return _contours(follower, law, Motion.uniform(law, count))


def contours_at(follower: Follower, law: Law, angle: FloatArray) -> tuple[Contour, ...]:
    """Return the contours of a cam at any cam angles (rad), one per disc."""
    return _contours(follower, law, Motion.at(law, angle))


def _contours(follower: Follower, law: Law, motion: Motion) -> tuple[Contour, ...]:
    return tuple(Contour.of(disc, motion) for disc in discs(follower, law))


def plane(values: ComplexArray) -> FloatArray:
    """Convert n complex numbers x + iy to an array of x and y, shape ``(2, n)``."""
    return np.stack([values.real, values.imag])

"""The contour of a cam in its own frame, with curvature and pressure angle (kinematic inversion).

At cam angle 0 the cam's frame is the guide's: a translating follower is on +y. The cam turns
counterclockwise; so in its frame the follower runs around it clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.laws import Law
from cam_rig.profile.contact import Touch
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.motion import Motion
from cam_rig.schema.follower import Follower


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

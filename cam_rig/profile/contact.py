"""Where a follower touches its cam, in the frame of the follower's guide.

Points of that frame (1, 2 in the profile thesis) are complex numbers: the cam's axis is 0, a
translating follower moves along i, an oscillating one has its pivot on the real axis. The cam's
own frame is reached by e^(−iθ) (eq. 2.16). As θ grows, the contact runs clockwise around the cam.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.profile.motion import Motion

#: A curve that bends by less, in rad over its own distance from the axis, is straight: what is
#: left of a straight flank's curvature is rounding, a thousandth of this.
STRAIGHT = 1e-10


@dataclass(frozen=True, eq=False)
class Touch:
    """Contact of a follower with its cam at each cam angle; arrays of one shape.

    Parameters
    ----------
    contact : m, point of contact
    normal : unit normal there, out of the cam
    radius : m, signed radius of curvature of the contour: positive where it is convex (solid
        inside the circle), negative where concave, infinite where straight
    rate : m/rad, way of the contact along the contour a rad of cam angle; negative where the
        contour runs back: it is undercut there
    pressure : rad, pressure angle: from the direction in which the follower moves to the normal,
        counterclockwise
    centre : m, centre of the roller, or the point: the pitch curve. None for a face
    pitch_curvature : 1/m, signed as ``radius``. None for a face
    """

    contact: ComplexArray
    normal: ComplexArray
    radius: FloatArray
    rate: FloatArray
    pressure: FloatArray
    centre: ComplexArray | None = None
    pitch_curvature: FloatArray | None = None


class Element(ABC):
    """The part of a follower that touches one cam.

    Besides the contact that the law asks for (`touch`), it knows how a follower is measured
    (`place_on`): that takes points of a finished contour and nothing of the law. Its place (m) is
    what grows as the follower moves outwards: height in the guide, way along the arc of the arm.

    Parameters
    ----------
    roller : m, 0 for a point or a face
    """

    roller: float

    @abstractmethod
    def touch(self, motion: Motion) -> Touch:
        """The contact that follows the law."""

    @abstractmethod
    def place_on(self, points: ComplexArray) -> FloatArray:
        """Place at which the follower just touches each point of the guide's frame (m).

        −∞ where it passes the point by; of a follower without width, that of its path's point
        nearest to it.
        """

    @abstractmethod
    def lift_at(self, place: FloatArray) -> FloatArray:
        """Displacement s (m) at a place."""

    @abstractmethod
    def clearance(self, s: FloatArray) -> FloatArray:
        """Distance (m) of the roller, the point or the face's line from the axis, at s (m).

        It grows or falls with s. Where it is not positive, the contour does not go around the
        axis: no cam has room for a shaft.
        """

    @abstractmethod
    def stand(self, s: FloatArray) -> ComplexArray:
        """Roller's centre, the point, or where the face meets its guide, at displacements s (m).

        With an arm and a face: the point of the face at the end of the arm.
        """

    @abstractmethod
    def moves(self, points: ComplexArray) -> ComplexArray:
        """Velocity of the follower's own points at ``points``, over that of s (1)."""


def offset_curve(
    centre: ComplexArray, tangent: ComplexArray, second: ComplexArray, roller: float
) -> tuple[ComplexArray, ComplexArray, FloatArray, FloatArray, FloatArray]:
    """Contour inside a pitch curve (eq. 2.22-2.25, 2.43-2.46).

    ``tangent`` and ``second`` are the derivatives of the pitch curve in the cam's own frame, seen
    in the guide's.

    Returns
    -------
    contact, outward normal, radius, rate, pitch curvature (0 where it is rounding: straight)
    """
    speed = np.abs(tangent)
    normal = 1j * tangent / speed
    curvature = -(tangent.conj() * second).imag / speed**3
    curvature = np.where(np.abs(curvature * centre) < STRAIGHT, 0.0, curvature)
    shrunk = 1.0 - roller * curvature
    with np.errstate(divide="ignore"):
        radius = np.where(curvature == 0.0, np.inf, shrunk / curvature)
    return centre - roller * normal, normal, radius, shrunk * speed, curvature

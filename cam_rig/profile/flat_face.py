"""Followers that touch with a straight face: the contour is the envelope of its lines.

A face at distance p from the cam's axis, its normal turning with the angle ψ, touches at (p', p)
in its own directions and has the radius of curvature p + p'' there, a prime being d/dψ.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.errors import ReachError
from cam_rig.profile.contact import Element, Touch
from cam_rig.profile.motion import Motion


@dataclass(frozen=True)
class GuidedFace(Element):
    """A face in a guide, square to it or inclined (eq. 2.14-2.18, 2.38, 2.40).

    Parameters
    ----------
    inclination : rad, of the face, counterclockwise from square to the guide
    eccentricity : m, of the guide: it moves the guide along the face, not the contour
    start : m, height at which the face meets the guide at s = 0
    side : 1 above the cam; −1 below it, where the law lowers the height
    """

    inclination: float
    eccentricity: float
    start: float
    side: int = 1
    roller: float = field(default=0.0, init=False)

    @classmethod
    def on_base(cls, base_radius: float, inclination: float, eccentricity: float) -> GuidedFace:
        """With s = 0 on the base circle."""
        start = (base_radius + eccentricity * np.sin(inclination)) / np.cos(inclination)
        return cls(inclination, eccentricity, float(start))

    @property
    def base_radius(self) -> float:
        """Distance of the face from the cam's axis at s = 0, m."""
        sine, cosine = np.sin(self.inclination), np.cos(self.inclination)
        return float(self.start * cosine - self.eccentricity * sine)

    def touch(self, motion: Motion) -> Touch:
        """The contact that follows the law."""
        cosine = self.side * np.cos(self.inclination)
        along = self.side * np.exp(1j * self.inclination)
        distance = self.clearance(motion.s)
        radius = distance + cosine * motion.bend
        return Touch(
            contact=along * (cosine * motion.slope + 1j * distance),
            normal=np.full(motion.s.shape, 1j * along),
            radius=radius,
            rate=radius,
            pressure=np.full(motion.s.shape, self.inclination),
        )

    def place_on(self, points: ComplexArray) -> FloatArray:
        """Height in the guide at which the face goes through each point."""
        slant = np.tan(self.inclination)
        height = self.side * (points.imag - slant * points.real) + slant * self.eccentricity
        return np.asarray(height, dtype=np.float64)

    def lift_at(self, place: FloatArray) -> FloatArray:
        """Displacement at a height."""
        return self.side * (place - self.start)

    def clearance(self, s: FloatArray) -> FloatArray:
        """Distance of the face from the cam's axis at displacements s."""
        return np.asarray(self.base_radius + self.side * np.cos(self.inclination) * s)

    def stand(self, s: FloatArray) -> ComplexArray:
        """Where the face meets its guide at displacements s."""
        return self.side * (self.eccentricity + 1j * (self.start + self.side * s))

    def moves(self, points: ComplexArray) -> ComplexArray:
        """Along the guide, whichever side of the cam it is on."""
        return np.full_like(points, 1j)


@dataclass(frozen=True)
class SwungFace(Element):
    """A face along an arm (eq. 2.26-2.29).

    Parameters
    ----------
    arm : m, where the law is measured
    offset : m, of the face from the pivot, out of the cam
    pivot : m, distance of the pivot from the cam's axis
    start : rad, γ: angle of the face to the line of pivot and axis at s = 0
    """

    arm: float
    offset: float
    pivot: float
    start: float
    roller: float = field(default=0.0, init=False)

    @classmethod
    def on_base(cls, base_radius: float, arm: float, offset: float, pivot: float) -> SwungFace:
        """With s = 0 on the base circle (eq. 2.27).

        Raises
        ------
        ReachError : the face cannot reach it
        """
        reach = base_radius - offset
        if abs(reach) >= pivot:
            raise ReachError(
                f"out of reach at the base circle: its radius less the face's offset is "
                f"{reach * 1e3:.6g} mm; allowed: less than the pivot's distance, "
                f"{pivot * 1e3:.6g} mm"
            )
        return cls(arm, offset, pivot, float(np.arcsin(reach / pivot)))

    def arm_angle(self, s: FloatArray) -> FloatArray:
        """Angle of the face (rad) at displacements s (m); it reaches between −π/2 and π/2."""
        return self.start + s / self.arm

    def turning(self, motion: Motion) -> FloatArray:
        """dψ/dθ, how fast the face turns about the cam; it must not stand or turn back."""
        return 1.0 + motion.slope / self.arm

    def touch(self, motion: Motion) -> Touch:
        """The contact that follows the law."""
        arm_angle, turn = self.arm_angle(motion.s), self.turning(motion)
        slope, bend = turn - 1.0, motion.bend / self.arm
        along = np.exp(-1j * arm_angle)
        high, wide = self.pivot * np.sin(arm_angle), self.pivot * np.cos(arm_angle)
        distance = self.clearance(motion.s)
        with np.errstate(divide="ignore", invalid="ignore"):
            contact = along * (wide * slope / turn + 1j * distance)
            radius = distance + (wide * bend / turn - high * slope**2) / turn**2
        return Touch(
            contact=contact,
            normal=1j * along,
            radius=radius,
            rate=radius * turn,
            pressure=np.arctan2(self.offset * turn, wide),
        )

    def place_on(self, points: ComplexArray) -> FloatArray:
        """Way along the arc at which the face goes through each point."""
        arm = self.pivot - points
        reach = np.abs(arm)
        meets = reach >= abs(self.offset)
        sine = np.where(meets, self.offset / np.where(meets, reach, 1.0), 0.0)
        arm_angle = -np.angle(arm) - np.arcsin(sine)
        return np.asarray(self.arm * np.where(meets, arm_angle, -np.inf), dtype=np.float64)

    def lift_at(self, place: FloatArray) -> FloatArray:
        """Displacement at a way along the arc."""
        return place - self.arm * self.start

    def clearance(self, s: FloatArray) -> FloatArray:
        """Distance of the face from the cam's axis at displacements s."""
        return np.asarray(self.pivot * np.sin(self.arm_angle(s)) + self.offset)

    def stand(self, s: FloatArray) -> ComplexArray:
        """The point of the face at the end of the arm, at displacements s."""
        face = (self.arm - 1j * self.offset) * np.exp(-1j * self.arm_angle(s))
        return np.asarray(self.pivot - face)

    def moves(self, points: ComplexArray) -> ComplexArray:
        """About the pivot, clockwise as the law grows."""
        return np.asarray(1j * (self.pivot - points) / self.arm)

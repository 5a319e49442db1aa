"""Followers that touch with a circle, or with a point: a circle of no radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.errors import ReachError
from cam_rig.profile.contact import Element, Touch, offset_curve
from cam_rig.profile.motion import Motion


@dataclass(frozen=True)
class GuidedCentre(Element):
    """A roller or a point in a guide (eq. 2.19-2.25).

    Parameters
    ----------
    roller : m
    eccentricity : m, of the guide, towards +x when seen with the follower above the cam
    start : m, height of the centre over the cam's axis at s = 0
    side : 1 above the cam; −1 below it, where the law lowers the height
    """

    roller: float
    eccentricity: float
    start: float
    side: int = 1

    @classmethod
    def on_base(cls, base_radius: float, roller: float, eccentricity: float) -> GuidedCentre:
        """With s = 0 on the base circle (eq. 2.19).

        Raises
        ------
        ReachError : the guide passes the base circle by
        """
        prime = base_radius + roller
        if abs(eccentricity) >= prime:
            raise ReachError(
                f"eccentricity is {abs(eccentricity) * 1e3:.6g} mm; allowed: less than base and "
                f"roller radius together, {prime * 1e3:.6g} mm"
            )
        return cls(roller, eccentricity, float(np.sqrt(prime**2 - eccentricity**2)))

    def height(self, s: FloatArray) -> FloatArray:
        """Height of the centre over the cam's axis at displacements s, m."""
        return self.start + self.side * s

    def touch(self, motion: Motion) -> Touch:
        """The contact that follows the law."""
        height = self.height(motion.s)
        up = self.side * motion.slope - self.eccentricity
        side = self.side
        centre = side * (self.eccentricity + 1j * height)
        tangent = side * (height + 1j * up)
        second = side * ((up + side * motion.slope) + 1j * (side * motion.bend - height))
        contact, normal, radius, rate, curvature = offset_curve(
            centre, tangent, second, self.roller
        )
        pressure = np.arctan2(up, height)
        return Touch(contact, normal, radius, rate, pressure, centre, curvature)

    def place_on(self, points: ComplexArray) -> FloatArray:
        """Height of the centre at which the follower just touches each point."""
        under = self.roller**2 - self.beside(points) ** 2
        height = self.side * points.imag + np.sqrt(np.maximum(under, 0.0))
        place = np.where(under >= 0.0, height, -np.inf) if self.roller else height
        return np.asarray(place, dtype=np.float64)

    def lift_at(self, place: FloatArray) -> FloatArray:
        """Displacement at a height."""
        return self.side * (place - self.start)

    def beside(self, points: ComplexArray) -> FloatArray:
        """How far points are to the right of the centre's path, m."""
        return np.asarray(self.side * points.real - self.eccentricity, dtype=np.float64)

    def clearance(self, s: FloatArray) -> FloatArray:
        """Distance of roller or point from the cam's axis at s; below the axis it is negative."""
        distance = np.hypot(self.eccentricity, self.height(s))
        return np.asarray(np.copysign(distance, self.height(s)) - self.roller)

    def stand(self, s: FloatArray) -> ComplexArray:
        """The centre at displacements s."""
        return self.side * (self.eccentricity + 1j * self.height(s))

    def moves(self, points: ComplexArray) -> ComplexArray:
        """Along the guide, whichever side of the cam it is on."""
        return np.full_like(points, 1j)


@dataclass(frozen=True)
class SwungCentre(Element):
    """A roller or a point at the end of an arm (eq. 2.26, 2.30-2.36).

    Parameters
    ----------
    roller, arm, pivot : m; ``pivot`` is the distance of the pivot from the cam's axis
    start : rad, γ: angle at the pivot from the cam's axis to the centre at s = 0
    side : 1 above the line of pivot and axis; −1 below it, where the law lowers the angle
    """

    roller: float
    arm: float
    pivot: float
    start: float
    side: int = 1

    @classmethod
    def on_base(cls, base_radius: float, roller: float, arm: float, pivot: float) -> SwungCentre:
        """With s = 0 on the base circle (eq. 2.34).

        Raises
        ------
        ReachError : the arm is too short or too long to reach it
        """
        prime, shortest, longest = base_radius + roller, abs(pivot - arm), pivot + arm
        if not shortest < prime < longest:
            raise ReachError(
                f"out of reach at the base circle: its centre is {prime * 1e3:.6g} mm from the "
                f"cam's axis; allowed: between {shortest * 1e3:.6g} and {longest * 1e3:.6g} mm "
                f"with an arm of {arm * 1e3:.6g} mm on a pivot at {pivot * 1e3:.6g} mm"
            )
        cosine = (arm**2 + pivot**2 - prime**2) / (2.0 * arm * pivot)
        return cls(roller, arm, pivot, float(np.arccos(cosine)))

    def arm_angle(self, s: FloatArray) -> FloatArray:
        """Angle at the pivot (rad) at displacements s (m); the arm reaches between 0 and π.

        From the line of pivot and axis, on the arm's own side of it.
        """
        return self.start + self.side * s / self.arm

    def touch(self, motion: Motion) -> Touch:
        """The contact that follows the law."""
        slope, bend = motion.slope / self.arm, motion.bend / self.arm
        out = self._out(motion.s)
        centre = self.pivot - out
        tangent = 1j * ((1.0 + slope) * out - self.pivot)
        second = (1.0 + slope) ** 2 * out - self.pivot + 1j * bend * out
        contact, normal, radius, rate, curvature = offset_curve(
            centre, tangent, second, self.roller
        )
        pressure = np.angle(normal * (1j * self.side * out).conj())
        return Touch(contact, normal, radius, rate, pressure, centre, curvature)

    def place_on(self, points: ComplexArray) -> FloatArray:
        """Way along the arc at which the follower just touches each point."""
        arm = self.pivot - points
        arm_angle = -self.side * np.angle(arm)
        if self.roller == 0.0:
            return np.asarray(self.arm * arm_angle)
        reach = np.abs(arm)
        cosine = (self.arm**2 + reach**2 - self.roller**2) / (2.0 * self.arm * reach)
        arm_angle += np.arccos(np.minimum(cosine, 1.0))
        return np.asarray(self.arm * np.where(cosine <= 1.0, arm_angle, -np.inf), dtype=np.float64)

    def lift_at(self, place: FloatArray) -> FloatArray:
        """Displacement at a way along the arc."""
        return self.side * (place - self.arm * self.start)

    def beside(self, points: ComplexArray) -> FloatArray:
        """How far points are inside the circle that the centre moves on, m."""
        return np.asarray(self.arm - np.abs(self.pivot - points), dtype=np.float64)

    def clearance(self, s: FloatArray) -> FloatArray:
        """Distance of roller or point from the cam's axis at displacements s."""
        return np.asarray(np.abs(self.stand(s)) - self.roller)

    def stand(self, s: FloatArray) -> ComplexArray:
        """The centre at displacements s."""
        return np.asarray(self.pivot - self._out(s))

    def _out(self, s: FloatArray) -> ComplexArray:
        """From the centre to the pivot, at displacements s."""
        return np.asarray(self.arm * np.exp(-1j * self.side * self.arm_angle(s)))

    def moves(self, points: ComplexArray) -> ComplexArray:
        """About the pivot, clockwise as the law grows, on both sides."""
        return np.asarray(1j * (self.pivot - points) / self.arm)

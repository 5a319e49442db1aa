"""Elements of followers that touch a cam: a roller, a point (roller of radius 0) or a face.

An element moves in a straight guide, or is carried by an arm around a pivot. Equation numbers are
those of the profile thesis. Points are complex numbers x + iy in the frame of the follower's guide
(`cam_rig.profile.contact`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cam_rig.errors import ReachError
from cam_rig.profile.contact import Element, Motion, Touch, offset_contact
from cam_rig.units import ComplexArray, FloatArray


class Guided(Element):
    """Element (roller, point or face) of a follower in a straight guide.

    The guide passes the cam's axis at a distance of `eccentricity`. The position of the element is
    its height.
    """

    eccentricity: float  #: distance of the guide from the cam's axis, m
    start: float  #: height of the element at s = 0, m
    side: int  #: 1 above the cam, −1 below it

    def lift_at(self, position: FloatArray) -> FloatArray:
        """Return the displacement s (m) of the follower at heights of the element (m)."""
        return self.side * (position - self.start)

    def stand(self, s: FloatArray) -> ComplexArray:
        """Return the reference point (m) of the element at a displacement s (m).

        It is the centre of the roller, the point, or the point at which the face meets the guide.
        """
        return self.side * (self.eccentricity + 1j * (self.start + self.side * s))

    def moves(self, points: ComplexArray) -> ComplexArray:
        """Return the direction in which the follower moves, a unit vector for each point.

        It is the direction of the guide, 1j, and the same at all points and on both sides of the
        cam.
        """
        return np.full_like(points, 1j)


class Swung(Element):
    """Element (roller, point or face) of a follower that an arm carries around a pivot.

    The position of the element is the arc length at the end of the arm.
    """

    arm: float  #: length of the arm, m
    pivot: float  #: distance of the pivot from the cam's axis, m
    start: float  #: angle of the arm at s = 0, rad
    side: int  #: 1 above the line through pivot and axis, −1 below it

    def arm_angle(self, s: FloatArray) -> FloatArray:
        """Return the angle of the arm at the pivot (rad) at a displacement s (m).

        It is measured from the line through the pivot and the axis, on the side of the arm.
        """
        return self.start + self.side * s / self.arm

    def lift_at(self, position: FloatArray) -> FloatArray:
        """Return the displacement s (m) of the follower at positions of the arm (m).

        The position is the arc length at the end of the arm.
        """
        return self.side * (position - self.arm * self.start)

    def moves(self, points: ComplexArray) -> ComplexArray:
        """Return the velocity of points of the rotating follower, divided by ṡ.

        ṡ is the velocity of the displacement. The points are in the guide's frame, m. The rotation
        about the pivot is clockwise as s increases, on both sides of the cam.
        """
        return np.asarray(1j * (self.pivot - points) / self.arm)


@dataclass(frozen=True)
class GuidedCentre(Guided):
    """Roller or point in a guide (eq. 2.19-2.25). Lengths are in m.

    Parameters
    ----------
    roller : float
        Radius of the roller, 0 for a point.
    eccentricity : float
        Distance of the guide from the cam's axis, towards +x if the follower is above the cam.
    start : float
        Height of the centre above the cam's axis at s = 0.
    side : int
        1 above the cam. −1 below the cam, where the height decreases as s increases.
    """

    roller: float
    eccentricity: float
    start: float
    side: int = 1

    @classmethod
    def on_base(cls, base_radius: float, roller: float, eccentricity: float) -> GuidedCentre:
        """Return the roller or point for a cam of a given base radius (eq. 2.19).

        It touches the base circle at a displacement of 0. Lengths are in m.

        Raises
        ------
        ReachError
            If the eccentricity is too large.
        """
        prime = base_radius + roller
        if abs(eccentricity) >= prime:
            raise ReachError(
                f"eccentricity is {abs(eccentricity) * 1e3:.6g} mm; allowed: less than base and "
                f"roller radius together, {prime * 1e3:.6g} mm"
            )
        return cls(roller, eccentricity, float(np.sqrt(prime**2 - eccentricity**2)))

    def height(self, s: FloatArray) -> FloatArray:
        """Return the height (m) of the centre above the axis at a displacement s (m)."""
        return self.start + self.side * s

    def touch(self, motion: Motion) -> Touch:
        """Return the contact of the roller or point with the cam at the angles of a motion.

        The result has the point of contact (m), the radius of curvature of the contour (m) and the
        pressure angle (rad) at each cam angle, for a follower that moves by the law.
        """
        side, height = self.side, self.height(motion.s)
        up = side * motion.slope - self.eccentricity
        centre = side * (self.eccentricity + 1j * height)
        tangent = side * (height + 1j * up)
        second = side * ((up + side * motion.slope) + 1j * (side * motion.curvature - height))
        return offset_contact(centre, tangent, second, self.roller, np.arctan2(up, height))

    def place_on(self, points: ComplexArray) -> FloatArray:
        """Return the height (m) of the centre at which the element just touches each point.

        The centre is that of the roller, or the tip of a pointed follower. The points are those of
        a contour, m. The height is −∞ if the roller cannot touch the point.
        """
        square = self.roller**2 - self.offset_from_path(points) ** 2
        height = self.side * points.imag + np.sqrt(np.maximum(square, 0.0))
        return np.asarray(np.where(square >= 0.0, height, -np.inf) if self.roller else height)

    def offset_from_path(self, points: ComplexArray) -> FloatArray:
        """Return the distance (m) of points from the straight path of the centre.

        It is positive to the right of the path, as seen from the cam.
        """
        return np.asarray(self.side * points.real - self.eccentricity)

    def clearance(self, s: FloatArray) -> FloatArray:
        """Return the distance (m) of roller or point from the cam's axis.

        ``s`` is the displacement in m. The distance is negative if the centre is below the axis.
        """
        distance = np.hypot(self.eccentricity, self.height(s))
        return np.asarray(np.copysign(distance, self.height(s)) - self.roller)


@dataclass(frozen=True)
class SwungCentre(Swung):
    """Roller or point at the end of an arm (eq. 2.26, 2.30-2.36). Lengths are in m.

    Parameters
    ----------
    roller : float
        Radius of the roller, 0 for a point.
    arm : float
        Length of the arm.
    pivot : float
        Distance of the pivot from the cam's axis.
    start : float
        Angle γ (rad) at the pivot from the cam's axis to the centre at s = 0.
    side : int
        1 above the line through pivot and axis. −1 below it, where the angle decreases as s
        increases.
    """

    roller: float
    arm: float
    pivot: float
    start: float
    side: int = 1

    @classmethod
    def on_base(cls, base_radius: float, roller: float, arm: float, pivot: float) -> SwungCentre:
        """Return the roller or point for a cam of a given base radius (eq. 2.34).

        It touches the base circle at a displacement of 0. Lengths are in m.

        Raises
        ------
        ReachError
            If the arm does not reach the base circle.
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

    def touch(self, motion: Motion) -> Touch:
        """Return the contact of the roller or point with the cam at the angles of a motion.

        The result has the point of contact (m), the radius of curvature of the contour (m) and the
        pressure angle (rad) at each cam angle, for a follower that moves by the law.
        """
        slope, curvature = motion.slope / self.arm, motion.curvature / self.arm
        out = self.arm * np.exp(-1j * self.side * self.arm_angle(motion.s))
        centre = self.pivot - out
        tangent = 1j * ((1.0 + slope) * out - self.pivot)
        second = (1.0 + slope) ** 2 * out - self.pivot + 1j * curvature * out
        pressure = np.angle(1j * tangent / np.abs(tangent) * (1j * self.side * out).conj())
        return offset_contact(centre, tangent, second, self.roller, pressure)

    def place_on(self, points: ComplexArray) -> FloatArray:
        """Return the position (m) of the arm at which the element just touches each point.

        The position is the arc length at the end of the arm. The points are those of a contour, m.
        The position is −∞ if the roller cannot touch the point.
        """
        arm = self.pivot - points
        arm_angle = -self.side * np.angle(arm)
        if self.roller == 0.0:
            return np.asarray(self.arm * arm_angle)
        reach = np.abs(arm)
        cosine = (self.arm**2 + reach**2 - self.roller**2) / (2.0 * self.arm * reach)
        arm_angle += np.arccos(np.minimum(cosine, 1.0))
        return np.asarray(self.arm * np.where(cosine <= 1.0, arm_angle, -np.inf), dtype=np.float64)

    def offset_from_path(self, points: ComplexArray) -> FloatArray:
        """Return the distance (m) of points from the circular path of the centre.

        It is positive inside the circle around the pivot.
        """
        return np.asarray(self.arm - np.abs(self.pivot - points), dtype=np.float64)

    def clearance(self, s: FloatArray) -> FloatArray:
        """Return the distance (m) of roller or point from the cam's axis.

        ``s`` is the displacement, m.
        """
        return np.asarray(np.abs(self.stand(s)) - self.roller)

    def stand(self, s: FloatArray) -> ComplexArray:
        """Return the centre of roller or point in m at a displacement s (m)."""
        return np.asarray(self.pivot - self.arm * np.exp(-1j * self.side * self.arm_angle(s)))


# Followers with a straight face. The contour is the envelope of the lines of the face.


@dataclass(frozen=True)
class GuidedFace(Guided):
    """Face in a guide, perpendicular to it or inclined (eq. 2.14-2.18, 2.38, 2.40).

    Parameters
    ----------
    inclination : float
        Angle of the face in rad, counterclockwise from the perpendicular to the guide.
    eccentricity : float
        Distance of the guide from the cam's axis in m. It moves the guide along the face and does
        not change the contour.
    start : float
        Height in m at which the face meets the guide at s = 0.
    side : int
        1 above the cam. −1 below the cam, where the height decreases as s increases.
    """

    inclination: float
    eccentricity: float
    start: float
    side: int = 1
    roller: float = field(default=0.0, init=False)

    @classmethod
    def on_base(cls, base_radius: float, inclination: float, eccentricity: float) -> GuidedFace:
        """Return the face for a cam of a given base radius.

        It touches the base circle at a displacement of 0. Lengths are in m, and the inclination is
        in rad.
        """
        start = (base_radius + eccentricity * np.sin(inclination)) / np.cos(inclination)
        return cls(inclination, eccentricity, float(start))

    @property
    def base_radius(self) -> float:
        """Distance of the face from the cam's axis at a displacement of 0, m."""
        sine, cosine = np.sin(self.inclination), np.cos(self.inclination)
        return float(self.start * cosine - self.eccentricity * sine)

    def touch(self, motion: Motion) -> Touch:
        """Return the contact of the face with the cam at the angles of a motion.

        The result has the point of contact (m), the radius of curvature of the contour (m) and the
        pressure angle (rad) at each cam angle, for a follower that moves by the law.
        """
        cosine = self.side * np.cos(self.inclination)
        along = self.side * np.exp(1j * self.inclination)
        distance = self.clearance(motion.s)
        radius = distance + cosine * motion.curvature
        return Touch(
            contact=along * (cosine * motion.slope + 1j * distance),
            normal=np.full(motion.s.shape, 1j * along),
            radius=radius,
            rate=radius,
            pressure=np.full(motion.s.shape, self.inclination),
        )

    def place_on(self, points: ComplexArray) -> FloatArray:
        """Return the height (m) of the face in its guide at which it touches each point.

        The points are those of a contour, m.
        """
        slant = float(np.tan(self.inclination))
        return self.side * (points.imag - slant * points.real) + slant * self.eccentricity

    def clearance(self, s: FloatArray) -> FloatArray:
        """Return the distance (m) of the face from the cam's axis at a displacement s (m)."""
        return np.asarray(self.base_radius + self.side * np.cos(self.inclination) * s)


@dataclass(frozen=True)
class SwungFace(Swung):
    """Face along an arm (eq. 2.26-2.29). Lengths are in m.

    Parameters
    ----------
    arm : float
        Distance from the pivot to the point at which the law is measured.
    offset : float
        Distance of the face from the pivot, out of the cam.
    pivot : float
        Distance of the pivot from the cam's axis.
    start : float
        Angle γ (rad) of the face to the line through pivot and axis at s = 0.
    """

    arm: float
    offset: float
    pivot: float
    start: float
    side: int = field(default=1, init=False)
    roller: float = field(default=0.0, init=False)

    @classmethod
    def on_base(cls, base_radius: float, arm: float, offset: float, pivot: float) -> SwungFace:
        """Return the face for a cam of a given base radius (eq. 2.27).

        It touches the base circle at a displacement of 0. Lengths are in m.

        Raises
        ------
        ReachError
            If the face does not reach the base circle.
        """
        reach = base_radius - offset
        if abs(reach) >= pivot:
            raise ReachError(
                f"out of reach at the base circle: its radius less the face's offset is "
                f"{reach * 1e3:.6g} mm; allowed: less than the pivot's distance, "
                f"{pivot * 1e3:.6g} mm"
            )
        return cls(arm, offset, pivot, float(np.arcsin(reach / pivot)))

    def touch(self, motion: Motion) -> Touch:
        """Return the contact of the face with the cam at the angles of a motion.

        The result has the point of contact (m), the radius of curvature of the contour (m) and the
        pressure angle (rad) at each cam angle, for a follower that moves by the law.
        """
        arm_angle, turn = self.arm_angle(motion.s), 1.0 + motion.slope / self.arm  # dψ/dθ
        slope, curvature = turn - 1.0, motion.curvature / self.arm
        along = np.exp(-1j * arm_angle)
        high, wide = self.pivot * np.sin(arm_angle), self.pivot * np.cos(arm_angle)
        distance = self.clearance(motion.s)
        with np.errstate(divide="ignore", invalid="ignore"):
            contact = along * (wide * slope / turn + 1j * distance)
            radius = distance + (wide * curvature / turn - high * slope**2) / turn**2
        return Touch(
            contact=contact,
            normal=1j * along,
            radius=radius,
            rate=radius * turn,
            pressure=np.arctan2(self.offset * turn, wide),
        )

    def place_on(self, points: ComplexArray) -> FloatArray:
        """Return the position (m) of the arm at which the face touches each point.

        The position is the arc length at the end of the arm. The points are those of a contour, m.
        The position is −∞ if the face cannot touch the point.
        """
        arm = self.pivot - points
        reach = np.abs(arm)
        reaches = reach >= abs(self.offset)
        sine = np.where(reaches, self.offset / np.where(reaches, reach, 1.0), 0.0)
        arm_angle = -np.angle(arm) - np.arcsin(sine)
        return np.asarray(self.arm * np.where(reaches, arm_angle, -np.inf), dtype=np.float64)

    def clearance(self, s: FloatArray) -> FloatArray:
        """Return the distance (m) of the face from the cam's axis at a displacement s (m)."""
        return np.asarray(self.pivot * np.sin(self.arm_angle(s)) + self.offset)

    def stand(self, s: FloatArray) -> ComplexArray:
        """Return the point (m) of the face at the end of the arm, at a displacement s (m)."""
        face = (self.arm - 1j * self.offset) * np.exp(-1j * self.arm_angle(s))
        return np.asarray(self.pivot - face)

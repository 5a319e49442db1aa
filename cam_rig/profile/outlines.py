"""Outlines of the follower for drawings, and the follower's position at each lift.

The frame is that of the rig, which is also that of the follower's guide in
`cam_rig.profile.contact`. The cam's axis is the origin. A translating follower moves along +y, an
oscillating follower has its pivot on +x, and the cam turns counterclockwise. For a cam with two
discs only the follower of the first disc is drawn. It touches the cam as the profile requires.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.laws import Law
from cam_rig.laws.law import extremes
from cam_rig.profile.contact import Motion
from cam_rig.profile.disc import discs, plane
from cam_rig.profile.faces import Guided, GuidedFace, Swung, SwungFace
from cam_rig.profile.shapes import bearing, circle, stem, tip
from cam_rig.schema.cam import CamConfig
from cam_rig.units import FloatArray

#: Height of the drawn bearing of a stem, as a fraction of the follower's greatest distance from the
#: cam's axis.
BEARING = 0.1
#: Free height below the drawn bearing for a follower that lifts off, as a fraction of the largest
#: lift.
LIFT_OFF = 0.12
#: Distance of a stem's end above its drawn bearing, as a fraction of the follower's greatest
#: distance from the cam's axis.
STEM_END = 0.04


@dataclass(frozen=True)
class FollowerShape:
    """Outline and position of a follower in the plane of a drawing.

    Lengths are in m and angles in rad. A follower in a guide along y does not rotate. The lift of
    an oscillating follower is the arc length at the end of its arm.

    Parameters
    ----------
    element : Guided or Swung
        Roller, point or face of the follower that touches the first disc.
    max_lift : float
        Greatest lift of the law in m.
    """

    element: Guided | Swung
    max_lift: float

    @property
    def reach(self) -> float:
        """Greatest distance of the follower from the cam's axis, m."""
        return float(np.hypot(*self.place(np.array([self.max_lift]))[0]))

    def place(self, lift: FloatArray) -> FloatArray:
        """Return the position (m) of the follower's reference point at each lift, ``(n, 2)``.

        It is the centre of the roller, the point, or the point of the face at its guide or at the
        end of the arm. ``lift`` are the lifts of the follower (m), ``(n,)``.
        """
        return plane(self.element.stand(lift)).T

    def contact(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the contact points (m) and the unit normals at them, ``(n, 2)`` each.

        ``motion`` is that of the follower at n cam angles. The normals point from the cam to the
        follower.
        """
        touch = self.element.touch(motion)
        return plane(touch.contact).T, plane(touch.normal).T

    def turn(self, lift: FloatArray) -> FloatArray:
        """Return the rotation (rad) of the outline about its origin, ``(n,)``.

        ``lift`` are the lifts of the follower (m), ``(n,)``. The outline of an arm points along −x.
        """
        if isinstance(self.element, Swung):
            return -self.element.arm_angle(lift)
        return np.zeros_like(lift)

    def origin(self, lift: FloatArray) -> FloatArray:
        """Return the position (m) of the outline's origin at each lift, ``(n, 2)``.

        The origin is the point to which `outline` is relative: the pivot of an arm, otherwise the
        result of `place`. ``lift`` are the lifts of the follower (m), ``(n,)``.
        """
        if isinstance(self.element, Swung):
            return np.tile([self.element.pivot, 0.0], (lift.size, 1))
        return self.place(lift)

    def upward(self, lift: FloatArray) -> FloatArray:
        """Return the unit vectors along which the lift increases, ``(n, 2)``.

        They are parallel to the guide, or perpendicular to the arm.
        """
        return plane(1j * np.exp(1j * self.turn(lift))).T

    def carried(self, points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
        """Return points that move with the follower from one lift to another, ``(n, 2)``.

        ``points`` (m) are their positions at the lifts ``start`` (m), ``(n,)``. The results are
        those at the lifts ``end``.
        """
        angle = self.turn(end) - self.turn(start)
        (x, y), cosine, sine = (points - self.origin(start)).T, np.cos(angle), np.sin(angle)
        turned: FloatArray = np.column_stack([x * cosine - y * sine, x * sine + y * cosine])
        return self.origin(end) + turned

    def outline(self) -> list[FloatArray]:
        """Return the polylines of the follower's outline in m, relative to its `origin`.

        They show the roller, the point or the face, and the stem or the arm.
        """
        element, half, roller = self.element, 0.03 * self.reach, self.element.roller
        if isinstance(element, SwungFace):
            ends = [[0.0, element.offset], [-2.0 * element.pivot, element.offset]]
            return [np.array(ends)]
        if isinstance(element, Swung):
            arm = np.array([[0.0, 0.0], [-element.arm, 0.0]])
            return [(circle(roller) if roller else tip(half, half)) + arm[1], arm]
        # the stem also reaches into its bearing at lift 0
        top = max(self.reach, self._bearing + 2.0 * BEARING * self.reach - element.start)
        if isinstance(element, GuidedFace):
            tilt, half_width = element.inclination, 0.9 * self.reach
            along = np.array([np.cos(tilt), np.sin(tilt)])
            return [np.outer([-half_width, half_width], along), stem(half, 0.0, top)]
        if roller:
            return [circle(roller), stem(half, 0.4 * roller, top)]
        return [tip(half, 2.0 * half), stem(half, 2.0 * half, top)]

    def in_guide(self) -> list[FloatArray]:
        """Return the follower's outline with a stem that ends slightly above its bearing.

        The polylines are those of `outline` in m, with a shorter stem. An oscillating follower has
        no stem and is unchanged.
        """
        if isinstance(self.element, Swung):
            return self.outline()
        bearing_top = max(float(strip[:, 1].max()) for strip in self.support())
        end = bearing_top + STEM_END * self.reach - float(self.origin(np.zeros(1))[0, 1])
        return [np.column_stack([x, np.minimum(y, end)]) for x, y in (s.T for s in self.outline())]

    def support(self) -> list[FloatArray]:
        """Return the polylines of the stationary parts that carry the follower, in m.

        They are the pin of the pivot, or the bearing of the stem above all other moving parts.
        """
        top = self.reach
        if isinstance(self.element, Swung):
            return [circle(0.05 * top) + np.array([self.element.pivot, 0.0])]
        low = self._bearing
        return bearing(self.element.eccentricity, 0.04 * top, 0.16 * top, low, low + BEARING * top)

    @property
    def _bearing(self) -> float:
        """Height of the lower edge of the stem's bearing above the cam's axis, m.

        It leaves room for a follower that has lifted off.
        """
        half_height = max(self.element.roller, 0.06 * self.reach)
        return self.reach + half_height + LIFT_OFF * self.max_lift


def follower_shape(cam: CamConfig, law: Law) -> FollowerShape:
    """Return the outline and the positions of a cam's follower, for drawings.

    It is the follower of the first disc.
    """
    element = discs(cam.follower, law)[0].element
    assert isinstance(element, Guided | Swung)
    return FollowerShape(element, extremes(law, 0)[1].value)

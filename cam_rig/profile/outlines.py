"""What a follower looks like and where it is; it touches the cam where the profile says.

The frame is the rig's, which is that of the follower's guide in `cam_rig.profile.contact`: the
cam's axis is the origin, a translating follower moves along +y, an oscillating one has its pivot
on +x, and the cam turns counterclockwise. Of a cam with two discs the first is drawn.
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

#: Height of a stem's bearing over the reach, and the room for lift-off, over the greatest lift.
BEARING, LIFT_OFF = 0.1, 0.12
#: A stem's end over its bearing, as a share of the follower's reach.
STEM_END = 0.04


@dataclass(frozen=True)
class FollowerShape:
    """A follower in the plane; all lengths in m, all angles in rad, arrays of shape ``(n,)``.

    What a guide along y carries never turns; an arm's lift is the way along the arc at its end.
    """

    element: Guided | Swung
    max_lift: float  # of the law

    @property
    def reach(self) -> float:
        """How far from the cam's axis the follower is at most."""
        return float(np.hypot(*self.place(np.array([self.max_lift]))[0]))

    def place(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` the roller's centre, the point, or the middle of the face."""
        return plane(self.element.stand(lift)).T

    def contact(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """``(n, 2)`` points of contact and unit normals, from cam to follower, on the law."""
        touch = self.element.touch(motion)
        return plane(touch.contact).T, plane(touch.normal).T

    def turn(self, lift: FloatArray) -> FloatArray:
        """``(n,)`` how far the outline is turned about its own origin; an arm's is along -x."""
        if isinstance(self.element, Swung):
            return -self.element.arm_angle(lift)
        return np.zeros_like(lift)

    def origin(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` where the origin of the outline is: the pivot, or the place itself."""
        if isinstance(self.element, Swung):
            return np.tile([self.element.pivot, 0.0], (lift.size, 1))
        return self.place(lift)

    def upward(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` unit vectors in which the lift grows: along the guide, square to the arm."""
        return plane(1j * np.exp(1j * self.turn(lift))).T

    def carried(self, points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
        """``(n, 2)`` points of the follower, moved with it from lift ``start`` to ``end``."""
        angle = self.turn(end) - self.turn(start)
        (x, y), cosine, sine = (points - self.origin(start)).T, np.cos(angle), np.sin(angle)
        turned: FloatArray = np.column_stack([x * cosine - y * sine, x * sine + y * cosine])
        return self.origin(end) + turned

    def outline(self) -> list[FloatArray]:
        """Strips about its origin: roller, point or face, with the stem or the arm."""
        element, half, roller = self.element, 0.03 * self.reach, self.element.roller
        if isinstance(element, SwungFace):
            ends = [[0.0, element.offset], [-2.0 * element.pivot, element.offset]]
            return [np.array(ends)]
        if isinstance(element, Swung):
            arm = np.array([[0.0, 0.0], [-element.arm, 0.0]])
            return [(circle(roller) if roller else tip(half, half)) + arm[1], arm]
        # the stem is in its bearing at no lift too
        top = max(self.reach, self._bearing + 2.0 * BEARING * self.reach - element.start)
        if isinstance(element, GuidedFace):
            tilt, wide = element.inclination, 0.9 * self.reach
            along = np.array([np.cos(tilt), np.sin(tilt)])
            return [np.outer([-wide, wide], along), stem(half, 0.0, top)]
        if roller:
            return [circle(roller), stem(half, 0.4 * roller, top)]
        return [tip(half, 2.0 * half), stem(half, 2.0 * half, top)]

    def in_guide(self) -> list[FloatArray]:
        """The outline with a stem that ends a little over its bearing."""
        if isinstance(self.element, Swung):
            return self.outline()
        over = max(float(strip[:, 1].max()) for strip in self.support())
        end = over + STEM_END * self.reach - float(self.origin(np.zeros(1))[0, 1])
        return [np.column_stack([x, np.minimum(y, end)]) for x, y in (s.T for s in self.outline())]

    def support(self) -> list[FloatArray]:
        """Strips of what stands still: the pivot's pin, or the bearing above all that moves."""
        top = self.reach
        if isinstance(self.element, Swung):
            return [circle(0.05 * top) + np.array([self.element.pivot, 0.0])]
        low = self._bearing
        return bearing(self.element.eccentricity, 0.04 * top, 0.16 * top, low, low + BEARING * top)

    @property
    def _bearing(self) -> float:
        """Height of the bearing's lower edge; a follower that has lifted off still clears it."""
        carried = max(self.element.roller, 0.06 * self.reach)
        return self.reach + carried + LIFT_OFF * self.max_lift


def follower_shape(cam: CamConfig, law: Law) -> FollowerShape:
    """The shape of a cam's follower."""
    element = discs(cam.follower, law)[0].element
    assert isinstance(element, Guided | Swung)
    return FollowerShape(element, extremes(law, 0)[1].value)

"""A follower on an arm: roller, edge or face."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.drawing.follower import FollowerShape, size
from cam_rig.drawing.outlines import circle, tip


@dataclass(frozen=True)
class Swinging(FollowerShape):
    """A point, roller or face on an arm, whose lift is the way along the arc at the arm's end."""

    @property
    def pivot(self) -> FloatArray:
        """``(2,)`` the pivot, on +x."""
        return np.array([size(self.config, "pivot_distance"), 0.0])

    @property
    def arm(self) -> float:
        """Length of the arm."""
        return size(self.config, "arm")

    def rise(self, lift: FloatArray) -> FloatArray:
        """``(n,)`` angle of the arm above the line from the pivot to the cam's axis."""
        distance, radius = self.pivot[0], self.config.base_radius.si + self.config.roller
        if self.face:
            least = math.asin((radius - size(self.config, "face_offset")) / distance)
        else:
            cosine = (distance**2 + self.arm**2 - radius**2) / (2.0 * distance * self.arm)
            least = math.acos(cosine)
        return least + lift / self.arm

    def place(self, lift: FloatArray) -> FloatArray:
        """The arm's end, or the point of the face beside it."""
        psi = self.rise(lift)
        end = self.pivot + self.arm * np.column_stack([-np.cos(psi), np.sin(psi)])
        return end + size(self.config, "face_offset") * self.upward(lift) if self.face else end

    def turn(self, lift: FloatArray) -> FloatArray:
        """The outline is drawn with its arm along -x."""
        return -self.rise(lift)

    def origin(self, lift: FloatArray) -> FloatArray:
        """The pivot."""
        return np.tile(self.pivot, (lift.size, 1))

    def instant_centre(self, slope: FloatArray) -> FloatArray:
        """(q φ'/(1 + φ'), 0)."""
        rate = slope / self.arm
        return np.column_stack([self.pivot[0] * rate / (1.0 + rate), np.zeros_like(slope)])

    def upward(self, lift: FloatArray) -> FloatArray:
        """Square to the arm."""
        psi = self.rise(lift)
        return np.column_stack([np.sin(psi), np.cos(psi)])

    def normal_of_face(self, lift: FloatArray) -> FloatArray:
        """Square to the arm, for the face lies along it."""
        return self.upward(lift)

    def outline(self) -> list[FloatArray]:
        """The arm from the pivot, and what is at its end."""
        end = np.array([-self.arm, 0.0])
        arm = np.stack([np.zeros(2), end])
        if self.face:
            above = (0.0, size(self.config, "face_offset"))
            return [np.array([[0.0, 0.0], [-2.0 * self.pivot[0], 0.0]]) + above]
        half, roller = 0.03 * self.reach, self.config.roller
        return [(circle(roller) if roller else tip(half, half)) + end, arm]

    def support(self) -> list[FloatArray]:
        """The pivot's pin."""
        return [circle(0.05 * self.reach) + self.pivot]

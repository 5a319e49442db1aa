"""What a follower looks like and where it is; it touches the cam where the profile says.

The frame is the rig's, which is that of the follower's guide in `cam_rig.profile.contact`: the
cam's axis is the origin, a translating follower moves along +y, an oscillating one has its pivot
on +x, and the cam turns counterclockwise. Of a cam with two discs the first is drawn.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from cam_rig.laws import Law
from cam_rig.profile.contact import Motion, turn_angles
from cam_rig.profile.disc import discs
from cam_rig.profile.faces import Guided, GuidedFace, Swung, SwungFace
from cam_rig.schema.cam import CamConfig
from cam_rig.show.looks import bearing, circle, stem, tip
from cam_rig.units import ComplexArray, FloatArray

#: Height of a stem's bearing over the reach, and the room for lift-off, over the greatest lift.
BEARING, LIFT_OFF = 0.1, 0.12


@dataclass(frozen=True)
class FollowerShape(ABC):
    """A follower in the plane; all lengths in m, all angles in rad, arrays of shape ``(n,)``."""

    element: Guided | Swung
    max_lift: float

    @property
    def reach(self) -> float:
        """How far from the cam's axis the follower is at most."""
        return float(np.hypot(*self.place(np.array([self.max_lift]))[0]))

    def place(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` the roller's centre, the point, or the middle of the face."""
        return _points(self.element.stand(lift))

    def contact(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """``(n, 2)`` points of contact and unit normals, from cam to follower, on the law."""
        touch = self.element.touch(motion)
        return _points(touch.contact), _points(touch.normal)

    @abstractmethod
    def turn(self, lift: FloatArray) -> FloatArray:
        """``(n,)`` how far the outline is turned about its own origin."""

    @abstractmethod
    def origin(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` where the origin of the outline is."""

    @abstractmethod
    def outline(self) -> list[FloatArray]:
        """Strips about the origin of the outline."""

    @abstractmethod
    def support(self) -> list[FloatArray]:
        """Strips of what stands still: a guide, a pivot."""

    @abstractmethod
    def upward(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` unit vectors in which the lift grows: along the guide, square to the arm."""

    def carried(self, points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
        """``(n, 2)`` points of the follower, moved with it from lift ``start`` to ``end``."""
        angle = self.turn(end) - self.turn(start)
        (x, y), cosine, sine = (points - self.origin(start)).T, np.cos(angle), np.sin(angle)
        turned: FloatArray = np.column_stack([x * cosine - y * sine, x * sine + y * cosine])
        return self.origin(end) + turned


@dataclass(frozen=True)
class Translating(FollowerShape):
    """A point, roller or face in a guide along y, which may run past the cam's axis."""

    element: Guided

    def turn(self, lift: FloatArray) -> FloatArray:
        """It never turns."""
        return np.zeros_like(lift)

    def origin(self, lift: FloatArray) -> FloatArray:
        """The place itself."""
        return self.place(lift)

    def upward(self, lift: FloatArray) -> FloatArray:
        """Along the guide."""
        return np.column_stack([np.zeros_like(lift), np.ones_like(lift)])

    def outline(self) -> list[FloatArray]:
        """Roller, point or face, and the stem."""
        top, half, roller = self._length, 0.03 * self.reach, self.element.roller
        if isinstance(self.element, GuidedFace):
            tilt, wide = self.element.inclination, 0.9 * self.reach
            along = np.array([np.cos(tilt), np.sin(tilt)])
            return [np.outer([-wide, wide], along), stem(half, 0.0, top)]
        if roller:
            return [circle(roller), stem(half, 0.4 * roller, top)]
        return [tip(half, 2.0 * half), stem(half, 2.0 * half, top)]

    def support(self) -> list[FloatArray]:
        """The bearing of the stem, above the highest place of what the stem carries."""
        top, low = self.reach, self._bearing
        return bearing(self.element.eccentricity, 0.04 * top, 0.16 * top, low, low + BEARING * top)

    @property
    def _bearing(self) -> float:
        """Height of the bearing's lower edge; a follower that has lifted off still clears it."""
        carried = max(self.element.roller, 0.06 * self.reach)
        return self.reach + carried + LIFT_OFF * self.max_lift

    @property
    def _length(self) -> float:
        """Of the stem, which is in its bearing at no lift too."""
        return max(self.reach, self._bearing + 2.0 * BEARING * self.reach - self.element.start)


@dataclass(frozen=True)
class Oscillating(FollowerShape):
    """A point, roller or face on an arm, whose lift is the way along the arc at the arm's end."""

    element: Swung

    def turn(self, lift: FloatArray) -> FloatArray:
        """The outline is drawn with its arm along -x."""
        return -self.element.arm_angle(lift)

    def origin(self, lift: FloatArray) -> FloatArray:
        """The pivot."""
        return np.tile([self.element.pivot, 0.0], (lift.size, 1))

    def upward(self, lift: FloatArray) -> FloatArray:
        """Square to the arm."""
        return _points(1j * np.exp(-1j * self.element.arm_angle(lift)))

    def outline(self) -> list[FloatArray]:
        """The arm from the pivot, and what is at its end; or the face."""
        if isinstance(self.element, SwungFace):
            ends = [[0.0, self.element.offset], [-2.0 * self.element.pivot, self.element.offset]]
            return [np.array(ends)]
        half, roller = 0.03 * self.reach, self.element.roller
        arm = np.array([[0.0, 0.0], [-self.element.arm, 0.0]])
        return [(circle(roller) if roller else tip(half, half)) + arm[1], arm]

    def support(self) -> list[FloatArray]:
        """The pivot's pin."""
        return [circle(0.05 * self.reach) + np.array([self.element.pivot, 0.0])]


def follower_shape(cam: CamConfig, law: Law) -> FollowerShape:
    """The shape of a cam's follower."""
    element, greatest = discs(cam.follower, law)[0].element, float(law(turn_angles(360)).max())
    if isinstance(element, Swung):
        return Oscillating(element, greatest)
    assert isinstance(element, Guided)
    return Translating(element, greatest)


def _points(of_plane: ComplexArray) -> FloatArray:
    """``(n, 2)`` x and y of complex numbers."""
    return np.column_stack([of_plane.real, of_plane.imag])

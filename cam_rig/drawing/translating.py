"""A follower in a guide: roller, edge or face."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.drawing.follower import FollowerShape, size
from cam_rig.drawing.outlines import bearing, circle, stem, tip

#: Height of the bearing over the reach, and how far a follower may fly, over the greatest lift.
BEARING, FLIGHT = 0.1, 0.12


@dataclass(frozen=True)
class Translating(FollowerShape):
    """A point, roller or face in a guide along y, which may run past the cam's axis."""

    @property
    def offset(self) -> float:
        """The guide's x."""
        return size(self.config, "eccentricity")

    @property
    def inclination(self) -> float:
        """How far a face is turned from square to the guide, counterclockwise."""
        return size(self.config, "inclination")

    @property
    def lowest(self) -> float:
        """Height of the place at no lift."""
        base = self.config.base_radius.si
        if self.face:
            tilt = self.inclination
            return (base + self.offset * math.sin(tilt)) / math.cos(tilt)
        return math.sqrt((base + self.config.roller) ** 2 - self.offset**2)

    def place(self, lift: FloatArray) -> FloatArray:
        """On the guide's line."""
        return np.column_stack([np.full_like(lift, self.offset), self.lowest + lift])

    def turn(self, lift: FloatArray) -> FloatArray:
        """It never turns."""
        return np.zeros_like(lift)

    def origin(self, lift: FloatArray) -> FloatArray:
        """The place itself."""
        return self.place(lift)

    def instant_centre(self, slope: FloatArray) -> FloatArray:
        """(s', 0)."""
        return np.column_stack([slope, np.zeros_like(slope)])

    def upward(self, lift: FloatArray) -> FloatArray:
        """Along the guide."""
        return np.column_stack([np.zeros_like(lift), np.ones_like(lift)])

    def normal_of_face(self, lift: FloatArray) -> FloatArray:
        """Square to the face."""
        tilt = np.full_like(lift, self.inclination)
        return np.column_stack([-np.sin(tilt), np.cos(tilt)])

    def outline(self) -> list[FloatArray]:
        """Roller, edge or face, and the stem."""
        top, roller = self._length, self.config.roller
        half = 0.03 * self.reach
        if self.face:
            along = np.array([math.cos(self.inclination), math.sin(self.inclination)])
            wide = 0.9 * self.reach
            return [np.outer([-wide, wide], along), stem(half, 0.0, top)]
        if roller:
            return [circle(roller), stem(half, 0.4 * roller, top)]
        return [tip(half, 2.0 * half), stem(half, 2.0 * half, top)]

    def support(self) -> list[FloatArray]:
        """The bearing of the stem, above the highest place of what the stem carries."""
        top, low = self.reach, self._bearing
        return bearing(self.offset, 0.04 * top, 0.16 * top, low, low + BEARING * top)

    @property
    def _bearing(self) -> float:
        """Height of the bearing's lower edge; a follower in flight still clears it."""
        carried = max(self.config.roller, 0.06 * self.reach)
        return self.reach + carried + FLIGHT * self.greatest_lift

    @property
    def _length(self) -> float:
        """Of the stem, which is in its bearing at no lift too."""
        return max(self.reach, self._bearing + 2.0 * BEARING * self.reach - self.lowest)

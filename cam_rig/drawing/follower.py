"""Where a follower is, what it looks like, and where it touches the cam.

The frame is the rig's: the cam's axis is the origin, a translating follower moves along +y, an
oscillating one has its pivot on +x, and the cam turns counterclockwise. Cam and follower touch
where the common normal runs through their instant centre (Kennedy's theorem), which lies on the
x axis where both have the same velocity: at s' for a translating follower, at q φ'/(1 + φ') for
one that swings by φ about a pivot at q. So the slope of the law is all that contact needs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.schema.follower import Follower
from cam_rig.schema.quantity import Quantity


def size(config: Follower, key: str) -> float:
    """A number of the follower in SI units, 0 where its kind has none."""
    quantity = getattr(config, key, None)
    return quantity.si if isinstance(quantity, Quantity) else 0.0


@dataclass(frozen=True)
class FollowerShape(ABC):
    """A follower in the plane; all lengths in m, all angles in rad, arrays of shape ``(n,)``."""

    config: Follower
    greatest_lift: float

    @property
    def face(self) -> bool:
        """Whether a straight face touches the cam, rather than a roller or an edge."""
        return not self.config.roller and "point" not in str(self.config.type)

    @property
    def reach(self) -> float:
        """How far from the cam's axis the follower is at most."""
        return float(np.hypot(*self.place(np.array([self.greatest_lift]))[0]))

    @abstractmethod
    def place(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` the roller's centre, the edge, or the middle of the face."""

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
    def instant_centre(self, slope: FloatArray) -> FloatArray:
        """``(n, 2)`` where cam and follower have one velocity; ``slope`` is s' in m/rad."""

    @abstractmethod
    def upward(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` unit vectors in which the place moves as the lift grows."""

    @abstractmethod
    def normal_of_face(self, lift: FloatArray) -> FloatArray:
        """``(n, 2)`` unit normals of the face, away from the cam."""

    def contact(self, lift: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
        """``(n, 2)`` points of contact and unit normals, from cam to follower, at law values."""
        place, centre = self.place(lift), self.instant_centre(slope)
        if self.face:
            normal = self.normal_of_face(lift)
            height = np.sum((place - centre) * normal, axis=1, keepdims=True)
            return centre + height * normal, normal
        normal = place - centre
        normal /= np.hypot(*normal.T)[:, None]
        return place - self.config.roller * normal, normal

    def carried(self, points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
        """``(n, 2)`` points of the follower, moved with it from lift ``start`` to ``end``."""
        angle = self.turn(end) - self.turn(start)
        arm = points - self.origin(start)
        cosine, sine = np.cos(angle), np.sin(angle)
        x, y = arm.T
        return self.origin(end) + np.column_stack([x * cosine - y * sine, x * sine + y * cosine])

"""Least and greatest values over one turn: dense samples of every smooth piece, then a zoom."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.laws.peaks import Extreme, extremes
from cam_rig.profile.contact import Element, Touch
from cam_rig.profile.motion import Motion
from cam_rig.units import TURN

#: Samples over the turn, and at least and at most in a piece of the law.
DENSE, FEWEST, MOST = 4096, 65, 513
#: Points and rounds of the zoom: the abscissa is found to 1e-9 of a piece, the value to rounding.
ZOOM_POINTS, ZOOMS = 33, 5

Curve = Callable[[FloatArray], FloatArray]


def zoom(curve: Curve, middle: float, width: float) -> tuple[float, float]:
    """Where in [0, 1], within ``width`` of ``middle``, a curve is greatest; and that value."""
    for _ in range(ZOOMS):
        u = np.linspace(max(0.0, middle - width), min(1.0, middle + width), ZOOM_POINTS)
        values = curve(u)
        best = int(np.argmax(values))
        middle, width = float(u[best]), float(u[1] - u[0])
    return middle, float(values[best])


def _samples(pieces: int) -> FloatArray:
    return np.linspace(0.0, 1.0, min(MOST, max(FEWEST, DENSE // pieces)))


@lru_cache(maxsize=4)
def _dense(law: Law) -> Motion:
    """All pieces of a law, joints with both limits; a search asks for it many times."""
    return Motion.on_pieces(law, _samples(law.spans.size))


@dataclass(frozen=True, eq=False)
class Scan:
    """An element's contact over the whole turn, for extremes of what depends on it."""

    law: Law
    element: Element

    @cached_property
    def touch(self) -> Touch:
        """``(m, n)``: the contact at m samples of each of the law's n pieces."""
        return self.element.touch(_dense(self.law))

    def greatest(self, quantity: Callable[[Touch], FloatArray]) -> Extreme:
        """Greatest value of a quantity of the contact."""
        return self.greatest_of(lambda _, touch: quantity(touch))

    def greatest_of(self, quantity: Callable[[Motion, Touch], FloatArray]) -> Extreme:
        """Greatest value of a quantity of the follower's motion and the contact."""
        u, values = _samples(self.law.spans.size), quantity(_dense(self.law), self.touch)
        row, piece = np.unravel_index(np.argmax(values), values.shape)

        def curve(x: FloatArray) -> FloatArray:
            motion = Motion.on_piece(self.law, int(piece), x)
            return quantity(motion, self.element.touch(motion))

        at, value = zoom(curve, float(u[row]), float(u[1]))
        return Extreme(value, float(self.law.breaks[piece] + at * self.law.spans[piece]))

    def least(self, quantity: Callable[[Touch], FloatArray]) -> Extreme:
        """Least value of a quantity of the contact."""
        found = self.greatest(lambda touch: -quantity(touch))
        return Extreme(-found.value, found.angle)


def greatest_between(curve: Curve, edges: FloatArray) -> Extreme:
    """Greatest value of a continuous function of the cam angle, smooth between ``edges`` (rad)."""
    u = _samples(edges.size)
    low, span = edges[:-1], np.diff(edges)
    values = curve(low + u[:, None] * span)
    row, piece = np.unravel_index(np.argmax(values), values.shape)
    at, value = zoom(lambda x: curve(low[piece] + x * span[piece]), float(u[row]), float(u[1]))
    return Extreme(value, float(low[piece] + at * span[piece]) % TURN)


@lru_cache(maxsize=32)
def stroke(law: Law) -> float:
    """Sum of least and greatest displacement, m: s_max of a law that starts at 0."""
    return sum(extreme.value for extreme in extremes(law, 0))

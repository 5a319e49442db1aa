"""Where a follower touches its cam, in the frame of the follower's guide.

Points of that frame (1, 2 in the profile thesis) are complex numbers: the cam's axis is 0, a
translating follower moves along i, an oscillating one has its pivot on the real axis. The cam's
own frame is reached by e^(−iθ) (eq. 2.16). As θ grows, the contact runs clockwise around the cam.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import Extreme, extremes
from cam_rig.laws.sampling import sample
from cam_rig.units import TURN, ComplexArray, FloatArray

# The law sampled for the profile: s, s', s'' at cam angles.


@dataclass(frozen=True, eq=False)
class Motion:
    """Cam angles (rad), and there s, s', s'' in m, m/rad, m/rad²; four arrays of one shape."""

    angle: FloatArray
    s: FloatArray
    slope: FloatArray
    curvature: FloatArray

    @classmethod
    def uniform(cls, law: Law, count: int) -> Motion:
        """``count`` equal steps over one turn, without its end."""
        motion = sample(law, 0.0, TURN / count, count, np.eye(3), np.zeros(3))
        return cls(turn_angles(count), *motion)

    @classmethod
    def at(cls, law: Law, angle: FloatArray) -> Motion:
        """Any angles; at a joint the piece that begins there."""
        return cls(angle, *(law(angle, order) for order in range(3)))

    @classmethod
    def on_pieces(cls, law: Law, u: FloatArray) -> Motion:
        """``(len(u), n)``: every piece of the law at ``u`` ∈ [0, 1], so a jump with both limits."""
        values = np.tensordot(bernstein.basis(law.degree, u), law.motion, axes=([1], [1]))
        return cls(law.breaks[:-1] + u[:, None] * law.spans, *np.moveaxis(values, 1, 0))

    @classmethod
    def on_piece(cls, law: Law, piece: int, u: FloatArray) -> Motion:
        """``(len(u),)``: one piece of the law."""
        values = law.motion[:, :, piece] @ bernstein.basis(law.degree, u).T
        return cls(law.breaks[piece] + u * law.spans[piece], *values)


def turn_angles(points: int) -> FloatArray:
    """``points`` cam angles over one turn, without its end."""
    return np.linspace(0.0, TURN, points, endpoint=False)


#: A curve that bends by less, in rad over its own distance from the axis, is straight: what is
#: left of a straight flank's curvature is rounding, a thousandth of this.
STRAIGHT = 1e-10


@dataclass(frozen=True, eq=False)
class Touch:
    """Contact of a follower with its cam at each cam angle; arrays of one shape.

    contact, normal : m, the point, and the unit normal there, out of the cam
    radius : m, of curvature of the contour: positive where it is convex (solid inside the circle),
        negative where concave, infinite where straight
    rate : m/rad, way of the contact along the contour; negative where that runs back: undercut
    pressure : rad, from the direction in which the follower moves to the normal, counterclockwise
    centre : m, of the roller, or the point: the pitch curve. None for a face
    pitch_curvature : 1/m, signed as ``radius``. None for a face
    """

    contact: ComplexArray
    normal: ComplexArray
    radius: FloatArray
    rate: FloatArray
    pressure: FloatArray
    centre: ComplexArray | None = None
    pitch_curvature: FloatArray | None = None


class Element(ABC):
    """The part of a follower that touches one cam.

    Its place (m) is what grows as the follower moves outwards: height in the guide, way along the
    arc of the arm. By `place_on` it is measured on a finished contour, with nothing of the law.
    """

    roller: float  # m, 0 for a point or a face

    @abstractmethod
    def touch(self, motion: Motion) -> Touch:
        """The contact that follows the law."""

    @abstractmethod
    def place_on(self, points: ComplexArray) -> FloatArray:
        """Place (m) at which it just touches each point of the guide's frame; −∞: never."""

    @abstractmethod
    def lift_at(self, place: FloatArray) -> FloatArray:
        """Displacement s (m) at a place."""

    @abstractmethod
    def clearance(self, s: FloatArray) -> FloatArray:
        """Distance (m) of roller, point or face from the axis at s (m); 0: no room for a shaft."""

    @abstractmethod
    def stand(self, s: FloatArray) -> ComplexArray:
        """Roller's centre, point, or where the face meets its guide or arm's end, at s (m)."""

    @abstractmethod
    def moves(self, points: ComplexArray) -> ComplexArray:
        """Velocity of the follower's own points at ``points``, over that of s (1)."""


def offset_contact(
    centre: ComplexArray,
    tangent: ComplexArray,
    second: ComplexArray,
    roller: float,
    pressure: FloatArray,
) -> Touch:
    """On the contour inside a pitch curve (eq. 2.22-2.25, 2.43-2.46).

    ``tangent`` and ``second`` are the derivatives of the pitch curve in the cam's own frame, seen
    in the guide's. A curvature of the size of rounding is 0: straight.
    """
    speed = np.abs(tangent)
    normal = 1j * tangent / speed
    curvature = -(tangent.conj() * second).imag / speed**3
    curvature = np.where(np.abs(curvature * centre) < STRAIGHT, 0.0, curvature)
    shrunk = 1.0 - roller * curvature
    with np.errstate(divide="ignore"):
        radius = np.where(curvature == 0.0, np.inf, shrunk / curvature)
    contact = centre - roller * normal
    return Touch(contact, normal, radius, shrunk * speed, pressure, centre, curvature)


# Least and greatest values over one turn: dense samples of every smooth piece, then a zoom.

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

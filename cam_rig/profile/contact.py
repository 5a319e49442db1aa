"""Contact of a follower with its cam, in the frame of the follower's guide.

Points of this frame (frames 1 and 2 in the profile thesis) are complex numbers. The cam's axis is
the origin. A translating follower moves along i, and an oscillating follower has its pivot on the
real axis. The factor e^(−iθ) converts to the cam frame (eq. 2.16). As θ grows, the contact moves
clockwise around the cam.
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

# Samples of the law: s, s', s'' at cam angles.


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a follower at some cam angles: four arrays of the same shape."""

    angle: FloatArray  #: cam angle θ, rad
    s: FloatArray  #: displacement s, m
    slope: FloatArray  #: s' = ds/dθ, m/rad
    curvature: FloatArray  #: s'' = d²s/dθ², m/rad²

    @classmethod
    def uniform(cls, law: Law, count: int) -> Motion:
        """Return the motion of a law at `count` equal steps over one turn.

        The end of the turn is left out.
        """
        motion = sample(law, 0.0, TURN / count, count, np.eye(3), np.zeros(3))
        return cls(turn_angles(count), *motion)

    @classmethod
    def at(cls, law: Law, angle: FloatArray) -> Motion:
        """Return the motion of a law at any cam angles (rad).

        At a joint of two polynomial pieces of the law, the values are those of the later piece.
        """
        return cls(angle, *(law(angle, order) for order in range(3)))

    @classmethod
    def on_pieces(cls, law: Law, u: FloatArray) -> Motion:
        """Return the motion at relative positions `u` ∈ [0, 1] of each piece of a law.

        The arrays have the shape ``(len(u), n)`` for the n polynomial pieces. At a jump between two
        pieces, the end of the first and the start of the second contain both values.
        """
        values = np.tensordot(bernstein.basis(law.degree, u), law.motion, axes=([1], [1]))
        return cls(law.breaks[:-1] + u[:, None] * law.spans, *np.moveaxis(values, 1, 0))

    @classmethod
    def on_piece(cls, law: Law, piece: int, u: FloatArray) -> Motion:
        """Return the motion at relative positions `u` ∈ [0, 1] of one piece of a law.

        ``piece`` is the index of the polynomial piece. The arrays have the shape ``(len(u),)``.
        """
        values = law.motion[:, :, piece] @ bernstein.basis(law.degree, u).T
        return cls(law.breaks[piece] + u * law.spans[piece], *values)


def turn_angles(points: int) -> FloatArray:
    """Return `points` equally spaced cam angles (rad) over one turn, its end excluded."""
    return np.linspace(0.0, TURN, points, endpoint=False)


#: Largest product of curvature and distance from the axis (no unit) at which a pitch curve counts
#: as straight. The rounding error of a straight flank's curvature is a thousandth of it.
STRAIGHT_CURVATURE = 1e-10


@dataclass(frozen=True, eq=False)
class Touch:
    """Contact of a follower with its cam at each cam angle: arrays of the same shape.

    Parameters
    ----------
    contact : ComplexArray
        Point of contact in m.
    normal : ComplexArray
        Unit normal at that point, out of the cam.
    radius : FloatArray
        Radius of curvature of the contour in m: positive where it is convex (the material is inside
        the circle), negative where it is concave, infinite where it is straight.
    rate : FloatArray
        Velocity of the contact along the contour in m/rad. A negative value means undercut: the
        contact moves backwards.
    pressure : FloatArray
        Pressure angle in rad: from the follower's direction of motion to the normal,
        counterclockwise.
    centre : ComplexArray, optional
        Centre of the roller in m, or the point: the pitch curve. None for a face.
    pitch_curvature : FloatArray, optional
        Curvature of the pitch curve in 1/m, with the sign of `radius`. None for a face.
    """

    contact: ComplexArray
    normal: ComplexArray
    radius: FloatArray
    rate: FloatArray
    pressure: FloatArray
    centre: ComplexArray | None = None
    pitch_curvature: FloatArray | None = None


class Element(ABC):
    """Part of a follower that touches the cam: a roller, a point or a face.

    Its position (m) is the height in the guide, or the arc length at the end of the arm. `place_on`
    determines it on a finished contour, without the law.
    """

    roller: float  #: radius of the roller, m, 0 for a point or a face

    @abstractmethod
    def touch(self, motion: Motion) -> Touch:
        """Return the contact of the element with the cam at the angles of a motion.

        The follower moves by the law. The result has the point of contact, the curvature of the
        contour and the pressure angle at each cam angle.
        """

    @abstractmethod
    def place_on(self, points: ComplexArray) -> FloatArray:
        """Return the position (m) at which the element just touches each point.

        The points are those of a contour in the guide's frame, m. The position is −∞ for points
        that it cannot touch.
        """

    @abstractmethod
    def lift_at(self, position: FloatArray) -> FloatArray:
        """Return the displacement s (m) of the follower at positions of the element (m).

        It is the inverse of the relation by which the position follows from s.
        """

    @abstractmethod
    def clearance(self, s: FloatArray) -> FloatArray:
        """Return the distance (m) of the element from the cam's axis.

        ``s`` is the displacement, m. At a distance of 0 there is no room for a shaft.
        """

    @abstractmethod
    def stand(self, s: FloatArray) -> ComplexArray:
        """Return the reference point of the element at a displacement s (m), in m.

        It is the roller's centre, the point, or the point of the face at its guide or at the end of
        the arm.
        """

    @abstractmethod
    def moves(self, points: ComplexArray) -> ComplexArray:
        """Return the velocity of points that move with the follower, divided by ṡ.

        ṡ is the velocity of the displacement. The points and the velocities are complex numbers in
        the guide's frame, points in m.
        """


def offset_contact(
    centre: ComplexArray,
    tangent: ComplexArray,
    second: ComplexArray,
    roller: float,
    pressure: FloatArray,
) -> Touch:
    """Return the contact of a roller with its cam, from the pitch curve.

    The pitch curve is the path of the roller's centre in the cam frame. The contour is inside of it
    at a distance of the radius of the roller (profile thesis, eq. 2.22-2.25 and 2.43-2.46).
    `centre` are the points of the pitch curve (m), `roller` is the radius of the roller (m), and
    `pressure` are the pressure angles (rad). `tangent` and `second` are the first and second
    derivative of the pitch curve with respect to θ in the cam frame, expressed in the guide's
    frame. A curvature below `STRAIGHT_CURVATURE` counts as 0.
    """
    speed = np.abs(tangent)
    normal = 1j * tangent / speed
    curvature = -(tangent.conj() * second).imag / speed**3
    curvature = np.where(np.abs(curvature * centre) < STRAIGHT_CURVATURE, 0.0, curvature)
    shrunk = 1.0 - roller * curvature
    with np.errstate(divide="ignore"):
        radius = np.where(curvature == 0.0, np.inf, shrunk / curvature)
    contact = centre - roller * normal
    return Touch(contact, normal, radius, shrunk * speed, pressure, centre, curvature)


# Extreme values over one turn: dense samples of each smooth piece, refined around the best one.

#: Number of samples over the turn in the search for an extreme value, divided equally among the
#: pieces of the law.
TURN_SAMPLES = 4096
#: Smallest number of samples of a piece of the law in the search for an extreme value.
MIN_PIECE_SAMPLES = 65
#: Largest number of samples of a piece of the law in the search for an extreme value.
MAX_PIECE_SAMPLES = 513
#: Number of points at which `zoom` evaluates a function in each round.
ZOOM_POINTS = 33
#: Number of rounds of `zoom`. They locate the maximum to 1e-9 of a polynomial piece of the law, and
#: its value to rounding.
ZOOM_ROUNDS = 5
#: Function of one variable that accepts an array of arguments.
Curve = Callable[[FloatArray], FloatArray]


def zoom(curve: Curve, middle: float, width: float) -> tuple[float, float]:
    """Return the position and the value of the maximum of a function on [0, 1].

    The search covers `width` on each side of `middle`. Each round evaluates `ZOOM_POINTS` points,
    and the next one searches between the neighbours of the best point.
    """
    for _ in range(ZOOM_ROUNDS):
        u = np.linspace(max(0.0, middle - width), min(1.0, middle + width), ZOOM_POINTS)
        values = curve(u)
        best = int(np.argmax(values))
        middle, width = float(u[best]), float(u[1] - u[0])
    return middle, float(values[best])


def _samples(pieces: int) -> FloatArray:
    count = max(MIN_PIECE_SAMPLES, TURN_SAMPLES // pieces)
    return np.linspace(0.0, 1.0, min(MAX_PIECE_SAMPLES, count))


@lru_cache(maxsize=4)
def _dense(law: Law) -> Motion:
    """Return the motion of a law at many samples of all its polynomial pieces.

    `Motion.on_pieces` describes the arrays. The result is cached, because searches evaluate one law
    many times.
    """
    return Motion.on_pieces(law, _samples(law.spans.size))


@dataclass(frozen=True, eq=False)
class Scan:
    """Contact of a follower's element over the whole turn, to find extreme values."""

    law: Law  #: motion law of the cam
    element: Element  #: element of the follower that touches the cam

    @cached_property
    def touch(self) -> Touch:
        """Contact at dense samples of the turn, arrays of shape ``(m, n)``.

        There are m samples of each of the law's n polynomial pieces.
        """
        return self.element.touch(_dense(self.law))

    def greatest(self, quantity: Callable[[Touch], FloatArray]) -> Extreme:
        """Return the greatest value of a quantity of the contact over the turn.

        `quantity` is a function of the contact, for example the pressure angle. The result also has
        the cam angle (rad).
        """
        return self.greatest_of(lambda _, touch: quantity(touch))

    def greatest_of(self, quantity: Callable[[Motion, Touch], FloatArray]) -> Extreme:
        """Return the greatest value of a quantity of motion and contact over the turn.

        `quantity` is a function of both. The result also has the cam angle (rad).
        """
        u, values = _samples(self.law.spans.size), quantity(_dense(self.law), self.touch)
        row, piece = np.unravel_index(np.argmax(values), values.shape)

        def curve(x: FloatArray) -> FloatArray:
            motion = Motion.on_piece(self.law, int(piece), x)
            return quantity(motion, self.element.touch(motion))

        u_max, value = zoom(curve, float(u[row]), float(u[1]))
        return Extreme(value, float(self.law.breaks[piece] + u_max * self.law.spans[piece]))

    def least(self, quantity: Callable[[Touch], FloatArray]) -> Extreme:
        """Return the least value of a quantity of the contact over the turn.

        `quantity` is a function of the contact. The result also has the cam angle (rad).
        """
        greatest = self.greatest(lambda touch: -quantity(touch))
        return Extreme(-greatest.value, greatest.angle)


def greatest_between(curve: Curve, edges: FloatArray) -> Extreme:
    """Return the greatest value of a function of the cam angle, and its angle.

    The function is continuous, and smooth between `edges` (rad).
    """
    u = _samples(edges.size)
    low, span = edges[:-1], np.diff(edges)
    values = curve(low + u[:, None] * span)
    row, piece = np.unravel_index(np.argmax(values), values.shape)
    u_max, value = zoom(lambda x: curve(low[piece] + x * span[piece]), float(u[row]), float(u[1]))
    return Extreme(value, float(low[piece] + u_max * span[piece]) % TURN)


@lru_cache(maxsize=32)
def stroke(law: Law) -> float:
    """Return the sum s_min + s_max of a law's smallest and largest displacement, m.

    It equals s_max if s_min is 0. The distance of the two elements of a follower that the cam moves
    in both directions contains this sum. It is not the difference s_max − s_min.
    """
    return sum(extreme.value for extreme in extremes(law, 0))

"""Law of a cam: a periodic piecewise polynomial in Bernstein form."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cam_rig.errors import ArgumentTypeError, LawError
from cam_rig.laws import bernstein
from cam_rig.units import TURN, FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BPoly

# Smallest and largest value of a derivative over the turn, from roots instead of samples.

#: Largest difference of extreme values that count as equal, as a fraction of the largest ordinate.
TIE_RTOL = 1e-12
#: Largest absolute cam angle that is accepted, rad. Beyond it fewer than four digits of the phase
#: remain.
MAX_ANGLE = 1e12


@dataclass(frozen=True)
class Extreme:
    """Extreme value of a derivative (m/rad^order), and the cam angle (rad) of it."""

    value: float
    angle: float


def extremes(law: Law, order: int, pieces: Sequence[int] | None = None) -> tuple[Extreme, Extreme]:
    """Return the smallest and the largest value of a derivative over the turn.

    They are at an end of a piece or at a root of the next derivative, the first of equal values.
    ``pieces`` are the indices of the pieces of the law that count (default: all).
    """
    ordinates = law.derivative_ordinates(order)
    slope = law.derivative_ordinates(order + 1)
    indices = range(law.spans.size) if pieces is None else pieces
    low = high = Extreme(float(ordinates[0, indices[0]]), float(law.breaks[indices[0]]))
    tie = TIE_RTOL * float(np.abs(ordinates).max())
    for i in indices:
        start, span = law.breaks[i], law.spans[i]
        u = np.array([0.0, *bernstein.crossings(slope[:, i]), 1.0])
        values = bernstein.evaluate(ordinates[:, i], u)
        lowest, highest = int(np.argmin(values)), int(np.argmax(values))
        if values[lowest] < low.value - tie:
            low = Extreme(float(values[lowest]), float(start + span * u[lowest]))
        if values[highest] > high.value + tie:
            high = Extreme(float(values[highest]), float(start + span * u[highest]))
    return low, high


def peak(law: Law, order: int) -> Extreme:
    """Return the extreme of a derivative with the largest magnitude, with its sign."""
    low, high = extremes(law, order)
    return low if -low.value > high.value else high


#: Smallest jump of s' (fraction of the lift per rad) that counts as a velocity jump. A smaller one
#: is rounding.
VELOCITY_JUMP = 1e-9
#: Upper bound of the rounding error of a jump of s', as a fraction of the slopes in the two
#: adjacent pieces.
SLOPE_ROUNDING = 1e-12

#: Number of angles of a piece that are evaluated together. They fit in the cache of a core.
ANGLES_PER_BLOCK = 1024


class KnownMotion(NamedTuple):
    """Properties of a law that are given instead of derived, see `Law.substitute`."""

    motion: FloatArray
    lift: float
    velocity_jumps: dict[int, float]


@dataclass(frozen=True, eq=False, repr=False)
class Law:
    """Displacement s(θ) of the follower over one turn of the cam, repeated each turn.

    Parameters
    ----------
    name : str
        Name of the cam.
    breaks : ndarray, shape (n + 1,)
        Cam angles in rad, from 0 to 2π.
    ordinates : ndarray, shape (p + 1, n)
        Bernstein ordinates in m, one column per piece.
    repeats : bool, optional
        True if the end of the turn joins its start (default: True).
    known : KnownMotion, optional
        Properties that are not derived from the ordinates (None: all are derived).

    Raises
    ------
    LawError
        If the arrays do not fit each other, are not finite, or do not span one turn.

    Examples
    --------
    Rise and fall of 20 mm, each a cubic piece:

    >>> import numpy as np
    >>> from cam_rig import Law
    >>> h = 0.02
    >>> law = Law("smoothstep", [0.0, np.pi, 2.0 * np.pi], [[0.0, h], [0.0, h], [h, 0.0], [h, 0.0]])
    >>> float(law(np.pi / 2)), round(float(law(np.pi / 2, 1)), 6)  # m, m/rad
    (0.01, 0.009549)
    """

    name: str
    breaks: FloatArray
    ordinates: FloatArray
    repeats: bool = True
    known: KnownMotion | None = None

    def __post_init__(self) -> None:
        for field, kind, text in (
            ("name", str, "a text"),
            ("known", KnownMotion | None, "None"),
        ):
            if not isinstance(value := getattr(self, field), kind):
                raise ArgumentTypeError(f"law: {field} is {type(value).__name__}; allowed: {text}")
        try:
            breaks = np.array(self.breaks, dtype=np.float64)
            ordinates = np.array(self.ordinates, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise LawError(
                f"law {self.name!r}: breaks and ordinates are not all numbers "
                f"({str(error)[:80]}); allowed: arrays of rad and of m"
            ) from None
        if ordinates.ndim != 2 or breaks.shape != (ordinates.shape[1] + 1,):
            raise LawError(
                f"law {self.name!r}: {breaks.shape} breakpoints do not fit ordinates of shape "
                f"{ordinates.shape}; n pieces need n + 1 breakpoints"
            )
        if not (np.isfinite(breaks).all() and np.isfinite(ordinates).all()):
            raise LawError(f"law {self.name!r}: breakpoints and ordinates must be finite")
        if breaks[0] != 0.0 or breaks[-1] != TURN or np.any(np.diff(breaks) <= 0.0):
            raise LawError(
                f"law {self.name!r}: breakpoints must rise from 0 to 2π, got {breaks.tolist()}"
            )
        for field, array in (("breaks", breaks), ("ordinates", ordinates)):
            array.setflags(write=False)
            object.__setattr__(self, field, array)

    def __repr__(self) -> str:
        """Return name, size and range of the ordinates in one line."""
        pieces, lift = self.spans.size, float(np.ptp(self.ordinates))
        size = f"{pieces} piece{'s' * (pieces > 1)} of degree {self.degree}"
        return f"Law({self.name!r}: {size}, ordinates over {lift:.4g})"

    @classmethod
    def from_bpoly(cls, bpoly: BPoly, name: str = "bpoly") -> Law:
        """Return the law of a scipy `BPoly`, in m over one turn from 0 to 2π rad.

        Raises
        ------
        LawError
            If the breakpoints do not span one turn, or the ordinates are not real.

        Examples
        --------
        >>> from scipy.interpolate import BPoly
        >>> ends = [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.0, 0.0]]  # s, s' and s''
        >>> law = Law.from_bpoly(BPoly.from_derivatives([0.0, np.pi, 2.0 * np.pi], ends))
        >>> law.degree, round(law.lift, 9)
        (5, 0.02)
        """
        from scipy.interpolate import BPoly

        if not isinstance(bpoly, BPoly):
            kind = type(bpoly).__name__
            raise ArgumentTypeError(f"bpoly: is {kind}; allowed: a scipy.interpolate.BPoly")
        if np.iscomplexobj(bpoly.c):
            raise LawError(f"law {name!r}: has complex ordinates; allowed: real ones, in m")
        return cls(name, bpoly.x, bpoly.c)

    def to_bpoly(self) -> BPoly:
        """Return the law as a periodic `BPoly` of scipy.

        Examples
        --------
        >>> law = Law("up", [0.0, np.pi, 2.0 * np.pi], [[0.0, 0.02], [0.02, 0.0]])
        >>> float(law.to_bpoly()(0.5 * np.pi))  # m
        0.01
        """
        from scipy.interpolate import BPoly

        return BPoly(self.ordinates.copy(), self.breaks.copy(), extrapolate="periodic")

    def derivative(self, order: int = 1) -> Law:
        """Return a derivative by the cam angle as a law, m/rad^order, right limits.

        Raises
        ------
        LawError
            If the order is not 0, 1, 2, …

        Examples
        --------
        >>> law = Law("up", [0.0, np.pi, 2.0 * np.pi], [[0.0, 0.02], [0.02, 0.0]])
        >>> round(float(law.derivative()(1.0) * np.pi), 9)
        0.02
        """
        order = self._order(order)
        ordinates = self._ordinates_of(order) if order else self.ordinates
        return Law(f"{self.name}{chr(0x2032) * order}", self.breaks, ordinates, self.repeats)

    @property
    def degree(self) -> int:
        """Degree p of the polynomials, the same for all pieces."""
        return int(self.ordinates.shape[0] - 1)

    @cached_property
    def spans(self) -> FloatArray:
        """Span of each piece in rad, ``(n,)``."""
        return np.diff(self.breaks)

    def __call__(self, angle: FloatArray | float, order: int = 0) -> FloatArray:
        """Return the displacement (m) at cam angles (rad), or a derivative (m/rad^order).

        The values at joints are right limits.
        """
        order, angles = self._order(order), self._angles(angle)
        ordinates = self._ordinates_of(order)[None]
        return np.asarray(self._evaluate(ordinates, angles.ravel())[0].reshape(angles.shape))

    def _order(self, order: int) -> int:
        """Return the order of a derivative as an integer, after a check.

        It is at most the first order whose derivative is zero.
        """
        if not (isinstance(order, Real) and 0 <= order < math.inf and int(order) == order):
            raise LawError(f"law {self.name!r}: order is {order!r}; allowed: 0, 1, 2, …")
        return min(int(order), self.degree + 1)

    def _angles(self, angle: FloatArray | float) -> FloatArray:
        try:
            angles = np.asarray(angle, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise LawError(
                f"law {self.name!r}: the angle is not a number that a float can represent, nor "
                f"an array of them ({type(angle).__name__}); allowed: finite angles in rad"
            ) from None
        within = np.abs(angles) <= MAX_ANGLE
        if not within.all():
            index = tuple(np.argwhere(~within)[0].tolist())
            position = f"[{', '.join(map(str, index))}]" if index else ""
            raise LawError(
                f"law {self.name!r}: angle{position} is {angles[index]}; allowed: finite angles in "
                f"rad, at most {MAX_ANGLE:g} either way"
            )
        return angles

    def motion_at(self, angle: FloatArray) -> FloatArray:
        """Return s, s' and s'' at cam angles ``(n,)`` in rad, ``(3, n)``, right limits."""
        return self._evaluate(self.motion, angle)

    def _evaluate(self, ordinates: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the values of polynomials on the law's pieces, ``(k, len(angle))``.

        ``ordinates`` are ``(k, p + 1, n)``, and ``angle`` is in rad.
        """
        inside = angle - np.floor(angle / TURN) * TURN
        pieces = np.searchsorted(self.breaks[1:-1], inside, side="right")
        out = np.empty((ordinates.shape[0], inside.size))
        for i in np.flatnonzero(np.bincount(pieces)):
            selected = np.flatnonzero(pieces == i)
            for start in range(0, selected.size, ANGLES_PER_BLOCK):
                block = selected[start : start + ANGLES_PER_BLOCK]
                u = (inside[block] - self.breaks[i]) / self.spans[i]
                out[:, block] = ordinates[:, :, i] @ bernstein.basis(self.degree, u).T
        return out

    def at(self, angle: float) -> tuple[float, float, float]:
        """Return s (m), s' (m/rad) and s'' (m/rad²) at one cam angle (rad), right limits."""
        inside = angle - math.floor(angle / TURN) * TURN
        piece = self.piece(inside)
        u = (inside - self.joints[piece]) / float(self.spans[piece])
        if piece not in self._piece_functions:
            self._piece_functions[piece] = [bernstein.scalar(row[:, piece]) for row in self.motion]
        s, slope, curvature = self._piece_functions[piece]
        return s(u), slope(u), curvature(u)

    def __getstate__(self) -> dict[str, Any]:
        # Functions cannot be sent to another process. They are created again there.
        return {name: value for name, value in vars(self).items() if name != "_piece_functions"}

    @cached_property
    def _piece_functions(self) -> dict[int, list[Callable[[float], float]]]:
        return {}  # s, s' and s'' of a piece, as functions of u ∈ [0, 1]

    def piece(self, inside: float) -> int:
        """Return the index of the piece at a cam angle (rad) of the first turn."""
        return min(max(bisect_right(self.joints, inside) - 1, 0), self.spans.size - 1)

    @cached_property
    def joints(self) -> list[float]:
        """Cam angles `breaks` (rad) as Python floats."""
        return [float(angle) for angle in self.breaks]

    @cached_property
    def largest_curvatures(self) -> FloatArray:
        """Upper bound of |s''| (m/rad²) in each piece, ``(n,)``."""
        return np.asarray(np.abs(self.motion[2]).max(axis=0))

    def _ordinates_of(self, order: int) -> FloatArray:
        return self.motion[order] if order < 3 else self.derivative_ordinates(order)

    def derivative_ordinates(self, order: int) -> FloatArray:
        """Return the ordinates of a derivative by θ, ``(p + 1, n)``, of the degree of s."""
        ordinates = self.ordinates
        for _ in range(order):
            ordinates = bernstein.derivative(ordinates) / self.spans
        return bernstein.elevate(ordinates, self.degree)

    @cached_property
    def motion(self) -> FloatArray:
        """Ordinates of s, s' and s'' of every piece, ``(3, p + 1, n)``."""
        if self.known is not None:
            return self.known.motion
        stack = np.stack([self.derivative_ordinates(order) for order in range(3)])
        stack.setflags(write=False)
        return stack

    @cached_property
    def taylor(self) -> FloatArray:
        """Matrices from basis values at u to the Taylor coefficients of s in u.

        The shape is ``(n, p + 1, p + 1)``, and coefficient r is s^(r)(u)/r!.
        """
        series = bernstein.taylor(self.ordinates)
        series.setflags(write=False)
        return series

    @cached_property
    def lift(self) -> float:
        """Largest minus smallest displacement over the turn, m."""
        if self.known is not None:
            return self.known.lift
        extremes = low, high = [float(self.ordinates[0].min()), float(self.ordinates[0].max())]
        beyond = (self.ordinates.min(axis=0) < low) | (self.ordinates.max(axis=0) > high)
        for i in np.flatnonzero(beyond).tolist():  # a piece is between its extreme ordinates
            roots = np.array(bernstein.crossings(bernstein.derivative(self.ordinates[:, i])))
            extremes.extend(bernstein.evaluate(self.ordinates[:, i], roots).tolist())
        return max(extremes) - min(extremes)

    @cached_property
    def bounds(self) -> tuple[float, float, float]:
        """Upper bounds of |s| (m), |s'| (m/rad) and |s''| (m/rad²) over the turn."""
        s, slope, curvature = np.abs(self.motion).max(axis=(1, 2)).tolist()
        return s, slope, curvature

    def substitute(
        self, breaks: FloatArray, motion: FloatArray, velocity_jumps: dict[int, float]
    ) -> Law:
        """Return a law that does not repeat, with separate ordinates of s, s' and s''.

        In short pieces, differences of s would lose the digits of s''. ``motion`` is ``(3, p + 1,
        m)``. ``velocity_jumps`` (m/rad) are by the index of the piece that follows them. The new
        law has the lift of this law, because tolerances are relative to it.
        """
        motion.setflags(write=False)
        known = KnownMotion(motion, self.lift, velocity_jumps)
        return Law(self.name, breaks, motion[0], repeats=False, known=known)

    def jumps(self, order: int) -> FloatArray:
        """Return the jump of a derivative at the start of each piece, ``(n,)``.

        It is the right minus the left limit, in m/rad^order.
        """
        first, last = self._ordinates_of(order)[[0, -1]]
        before = last[-1:] if self.repeats else first[:1]
        return np.asarray(first - np.append(before, last[:-1]))

    @cached_property
    def velocity_jumps(self) -> dict[int, float]:
        """Jumps of s' (m/rad) over the turn, in order.

        The keys are the indices of the pieces that follow the jumps.
        """
        if self.known is not None:
            return self.known.velocity_jumps
        jumps = self.jumps(1)
        over = np.abs(jumps)
        # The lift is at least the range of the ordinates at the joints.
        if over.max() <= VELOCITY_JUMP * float(np.ptp(self.ordinates[0])):
            return {}
        slopes = np.abs(self.motion[1]).max(axis=0)
        over -= SLOPE_ROUNDING * np.maximum(slopes, np.roll(slopes, 1))
        return {int(i): float(jumps[i]) for i in np.flatnonzero(over > VELOCITY_JUMP * self.lift)}

    @cached_property
    def largest_step(self) -> float:
        """Largest step of s at a joint in m, which is rounding if the lift does not jump."""
        return float(np.abs(self.jumps(0)).max())


# Smoothness of the joints: the class C0 to C4 of each.

#: Highest class of continuity that is distinguished. A smoother joint counts as this class.
MAX_CONTINUITY = 4
#: Largest jump that counts as 0, as a fraction of the derivative's peak in the adjacent pieces.
JUMP_RTOL = 1e-6
#: Upper bound of the rounding error of a derivative at the end of a piece, in units of
#: eps·level·(2p/span)^order.
LEVEL_ROUNDINGS = 16.0


@dataclass(frozen=True)
class Joint:
    """Joint of two pieces of a law.

    Parameters
    ----------
    angle : float
        Cam angle, rad.
    continuity : int
        Highest derivative without a jump, at most 4, −1 at a step of s.
    jump : float
        Right minus left limit of the next derivative, m/rad^(continuity + 1), 0 at C4.
    """

    angle: float
    continuity: int
    jump: float


def joints(law: Law) -> tuple[Joint, ...]:
    """Return every joint of the law with its continuity, in order from cam angle 0."""
    jumps = np.stack([law.jumps(order) for order in range(MAX_CONTINUITY + 1)])
    broken = np.abs(jumps) > np.stack([_limits(law, order) for order in range(MAX_CONTINUITY + 1)])
    first = np.where(broken.any(axis=0), np.argmax(broken, axis=0), MAX_CONTINUITY + 1)
    sizes = np.vstack([jumps, np.zeros(law.spans.size)])[first, np.arange(law.spans.size)]
    rows = zip(law.breaks[:-1].tolist(), (first - 1).tolist(), sizes.tolist(), strict=True)
    return tuple(Joint(*row) for row in rows)


def continuity(law: Law) -> int:
    """Return the continuity of the law, which is that of its roughest joint.

    It is the highest derivative without a jump.
    """
    return min(joint.continuity for joint in joints(law))


def _limits(law: Law, order: int) -> FloatArray:
    """Return the jump (m/rad^order) at each joint that still counts as 0, ``(n,)``.

    It is relative to the peak of the derivative in the two adjacent pieces, because other pieces
    may be far sharper, or to the peak of s over the turn. In short pieces of high degree and in
    dwells it is the rounding of the level.
    """
    level = float(np.abs(law.ordinates).max())
    if order == 0:
        return np.full(law.spans.size, JUMP_RTOL * level)
    peaks = np.abs(law.derivative_ordinates(order)).max(axis=0)
    noise = LEVEL_ROUNDINGS * np.finfo(float).eps * level * (2.0 * law.degree / law.spans) ** order
    limits = np.maximum(JUMP_RTOL * peaks, noise)
    return np.asarray(np.maximum(limits, np.roll(limits, 1)))


def format_continuity(law: Law) -> str:
    """Return the continuity of a law as text, such as "C3"."""
    order = continuity(law)
    return f"C{order}" if order < MAX_CONTINUITY else f"C{MAX_CONTINUITY} or smoother"

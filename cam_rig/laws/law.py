"""The one type every displacement law becomes: a periodic Bernstein piecewise polynomial."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
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

# Largest and smallest value of a derivative over the turn, from roots, not from samples.

#: Of values that differ by less than this fraction of the largest ordinate the first is taken.
TIE = 1e-12
#: Largest cam angle, rad, either way: beyond it less than four digits of the phase are left.
MAX_ANGLE = 1e12


@dataclass(frozen=True)
class Extreme:
    """A value of a derivative (m/rad^order) and the cam angle (rad) where it is reached."""

    value: float
    angle: float


def extremes(law: Law, order: int) -> tuple[Extreme, Extreme]:
    """Smallest and largest value of a derivative: at ends of pieces, or roots of the next one."""
    here = law.derivative_ordinates(order)
    slope = law.derivative_ordinates(order + 1)
    low = high = Extreme(float(here[0, 0]), 0.0)
    tie = TIE * float(np.abs(here).max())
    for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
        at = np.array([0.0, *bernstein.crossings(slope[:, i]), 1.0])
        values = bernstein.evaluate(here[:, i], at)
        worst, best = int(np.argmin(values)), int(np.argmax(values))
        if values[worst] < low.value - tie:
            low = Extreme(float(values[worst]), float(start + span * at[worst]))
        if values[best] > high.value + tie:
            high = Extreme(float(values[best]), float(start + span * at[best]))
    return low, high


def peak(law: Law, order: int) -> Extreme:
    """The extreme of largest magnitude, with its sign."""
    low, high = extremes(law, order)
    return low if -low.value > high.value else high


#: A jump of s' is one above this fraction of the lift a rad, and of the slopes beside it; below
#: it is rounding.
VELOCITY_JUMP, SLOPE_ROUNDING = 1e-9, 1e-12


#: Angles of a piece whose basis is reckoned in one go: more would not stay in a core's memory.
TOGETHER = 1024


class Known(NamedTuple):
    """What of a law is known better than its ordinates of s tell: see `Law.substitute`."""

    motion: FloatArray
    lift: float
    velocity_jumps: dict[int, float]


@dataclass(frozen=True, eq=False, repr=False)
class Law:
    """Follower displacement s(θ) over one turn of the cam, repeated for every turn.

    Parameters
    ----------
    name : the cam's name
    breaks : ``(n + 1,)`` cam angles in rad, from 0 to 2π
    ordinates : ``(p + 1, n)`` Bernstein ordinates in m, one column a piece
    repeats : whether the turn's end joins its start
    known : what is not to be derived from the ordinates; None derives all

    Raises
    ------
    LawError : the arrays do not fit each other, are not finite, or do not span one turn

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
    known: Known | None = None

    def __post_init__(self) -> None:
        for field, kind, words in (("name", str, "a text"), ("known", Known | None, "None")):
            if not isinstance(value := getattr(self, field), kind):
                raise ArgumentTypeError(f"law: {field} is {type(value).__name__}; allowed: {words}")
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
        """Name, size and lift."""
        pieces, lift = self.spans.size, float(np.ptp(self.ordinates))
        size = f"{pieces} piece{'s' * (pieces > 1)} of degree {self.degree}"
        return f"Law({self.name!r}: {size}, ordinates over {lift:.4g})"

    @classmethod
    def from_bpoly(cls, bpoly: BPoly, name: str = "bpoly") -> Law:
        """The law of scipy's Bernstein polynomials over one turn, 0 to 2π rad, in m.

        Raises
        ------
        LawError : breakpoints that are no turn, or values that are no real numbers

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
        """The same as scipy's Bernstein polynomials, periodic: values, roots, integrals there.

        Examples
        --------
        >>> law = Law("up", [0.0, np.pi, 2.0 * np.pi], [[0.0, 0.02], [0.02, 0.0]])
        >>> float(law.to_bpoly()(0.5 * np.pi))  # m
        0.01
        """
        from scipy.interpolate import BPoly

        return BPoly(self.ordinates.copy(), self.breaks.copy(), extrapolate="periodic")

    def derivative(self, order: int = 1) -> Law:
        """The derivative in the cam angle as a law of its own, in m/rad^order; right limits.

        Raises
        ------
        LawError : an order that is none

        Examples
        --------
        >>> law = Law("up", [0.0, np.pi, 2.0 * np.pi], [[0.0, 0.02], [0.02, 0.0]])
        >>> round(float(law.derivative()(1.0) * np.pi), 9)
        0.02
        """
        times = self._order(order)
        ordinates = self._of_order(times) if times else self.ordinates
        return Law(f"{self.name}{chr(0x2032) * times}", self.breaks, ordinates, self.repeats)

    @property
    def degree(self) -> int:
        """Degree p common to all pieces."""
        return int(self.ordinates.shape[0] - 1)

    @cached_property
    def spans(self) -> FloatArray:
        """``(n,)`` span of each piece, rad."""
        return np.diff(self.breaks)

    def __call__(self, angle: FloatArray | float, order: int = 0) -> FloatArray:
        """Displacement (m), or its derivative (m/rad^order), at angles in rad; right limits."""
        order, at = self._order(order), self._angles(angle)
        ordinates = self._of_order(order)[None]
        return np.asarray(self._evaluate(ordinates, at.ravel())[0].reshape(at.shape))

    def _order(self, order: int) -> int:
        """The order of a derivative, at most the one from which on all are zero."""
        if not (isinstance(order, Real) and 0 <= order < math.inf and int(order) == order):
            raise LawError(f"law {self.name!r}: order is {order!r}; allowed: 0, 1, 2, …")
        return min(int(order), self.degree + 1)

    def _angles(self, angle: FloatArray | float) -> FloatArray:
        try:
            at = np.asarray(angle, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise LawError(
                f"law {self.name!r}: the angle is no number a float holds, nor an array of them "
                f"({type(angle).__name__}); allowed: finite angles in rad"
            ) from None
        within = np.abs(at) <= MAX_ANGLE
        if not within.all():
            place = tuple(np.argwhere(~within)[0].tolist())
            where = f"[{', '.join(map(str, place))}]" if place else ""
            raise LawError(
                f"law {self.name!r}: angle{where} is {at[place]}; allowed: finite angles in rad, "
                f"at most {MAX_ANGLE:g} either way"
            )
        return at

    def motion_at(self, angle: FloatArray) -> FloatArray:
        """Rows s, s' and s'' at cam angles ``(n,)`` in rad, ``(3, n)``; right limits at joints."""
        return self._evaluate(self.motion, angle)

    def _evaluate(self, ordinates: FloatArray, angle: FloatArray) -> FloatArray:
        """``(k, len(angle))`` of ordinates ``(k, p + 1, n)``."""
        inside = angle - np.floor(angle / TURN) * TURN
        pieces = np.searchsorted(self.breaks[1:-1], inside, side="right")
        out = np.empty((ordinates.shape[0], inside.size))
        for i in np.flatnonzero(np.bincount(pieces)):
            every = np.flatnonzero(pieces == i)
            for begin in range(0, every.size, TOGETHER):
                here = every[begin : begin + TOGETHER]
                u = (inside[here] - self.breaks[i]) / self.spans[i]
                out[:, here] = ordinates[:, :, i] @ bernstein.basis(self.degree, u).T
        return out

    def at(self, angle: float) -> tuple[float, float, float]:
        """S (m), s' (m/rad), s'' (m/rad²) at one cam angle (rad), right limits, in plain floats."""
        inside = angle - math.floor(angle / TURN) * TURN
        piece = self.piece(inside)
        u = (inside - self.joints[piece]) / float(self.spans[piece])
        if piece not in self._scalars:
            self._scalars[piece] = [bernstein.scalar(row[:, piece]) for row in self.motion]
        s, slope, curvature = self._scalars[piece]
        return s(u), slope(u), curvature(u)

    def __getstate__(self) -> dict[str, Any]:
        # Functions cannot be sent to another process, which makes them anew.
        return {name: value for name, value in vars(self).items() if name != "_scalars"}

    @cached_property
    def _scalars(self) -> dict[int, list[Callable[[float], float]]]:
        return {}  # s, s' and s'' of a piece as functions of u ∈ [0, 1]

    def piece(self, inside: float) -> int:
        """Index of the piece that holds an angle of the first turn, rad."""
        return min(max(bisect_right(self.joints, inside) - 1, 0), self.spans.size - 1)

    @cached_property
    def joints(self) -> list[float]:
        """`breaks` as plain floats."""
        return [float(angle) for angle in self.breaks]

    @cached_property
    def largest_curvatures(self) -> FloatArray:
        """``(n,)`` what |s''| (m/rad²) does not exceed in each piece."""
        return np.asarray(np.abs(self.motion[2]).max(axis=0))

    def _of_order(self, order: int) -> FloatArray:
        return self.motion[order] if order < 3 else self.derivative_ordinates(order)

    def derivative_ordinates(self, order: int) -> FloatArray:
        """``(p + 1, n)`` ordinates of the derivative in θ, written with the law's degree."""
        ordinates = self.ordinates
        for _ in range(order):
            ordinates = bernstein.derivative(ordinates) / self.spans
        return bernstein.elevate(ordinates, self.degree)

    @cached_property
    def motion(self) -> FloatArray:
        """``(3, p + 1, n)``: ordinates of s, s', s'' of every piece, one degree for all."""
        if self.known is not None:
            return self.known.motion
        stack = np.stack([self.derivative_ordinates(order) for order in range(3)])
        stack.setflags(write=False)
        return stack

    @cached_property
    def taylor(self) -> FloatArray:
        """``(n, p + 1, p + 1)``: [i] takes basis values at u to the series s^(r)(u)/r! in u."""
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
        for i in np.flatnonzero(beyond).tolist():  # no piece is beyond its ordinates
            at = np.array(bernstein.crossings(bernstein.derivative(self.ordinates[:, i])))
            extremes.extend(bernstein.evaluate(self.ordinates[:, i], at).tolist())
        return max(extremes) - min(extremes)

    @cached_property
    def bounds(self) -> tuple[float, float, float]:
        """What |s| (m), |s'| (m/rad) and |s''| (m/rad²) do not exceed: their largest ordinates."""
        s, slope, curvature = np.abs(self.motion).max(axis=(1, 2)).tolist()
        return s, slope, curvature

    def substitute(
        self, breaks: FloatArray, motion: FloatArray, velocity_jumps: dict[int, float]
    ) -> Law:
        """A law that is not repeated, of s, s', s'' ``(3, p + 1, n)`` known each on its own.

        Where pieces are short, differences of s would lose the digits of s''. The lift, by which
        is told what is small, is this law's; ``velocity_jumps`` (m/rad) go by the piece they begin.
        """
        motion.setflags(write=False)
        known = Known(motion, self.lift, velocity_jumps)
        return Law(self.name, breaks, motion[0], repeats=False, known=known)

    def jumps(self, order: int) -> FloatArray:
        """``(n,)`` right minus left limit of the derivative at the start of each piece."""
        first, last = self._of_order(order)[[0, -1]]
        before = last[-1:] if self.repeats else first[:1]
        return np.asarray(first - np.append(before, last[:-1]))

    @cached_property
    def velocity_jumps(self) -> dict[int, float]:
        """What s' gains (m/rad) where it jumps, in order, by the piece that begins there."""
        if self.known is not None:
            return self.known.velocity_jumps
        jumps = self.jumps(1)
        over = np.abs(jumps)
        if over.max() <= VELOCITY_JUMP * float(np.ptp(self.ordinates[0])):  # the lift is no less
            return {}
        slopes = np.abs(self.motion[1]).max(axis=0)
        over -= SLOPE_ROUNDING * np.maximum(slopes, np.roll(slopes, 1))
        return {int(i): float(jumps[i]) for i in np.flatnonzero(over > VELOCITY_JUMP * self.lift)}

    @cached_property
    def largest_step(self) -> float:
        """Largest step of s at a joint, m: rounding, for a cam without a cliff."""
        return float(np.abs(self.jumps(0)).max())


# How smoothly a law's pieces join: the class C0 to C4 at each joint.

#: Classes are told apart up to this one; what is smoother counts as it.
SMOOTHEST = 4
#: A jump below this fraction of the derivative's peak in the pieces that meet counts as 0.
TOLERANCE = 1e-6
#: Rounding of a derivative at a piece's end, in units of eps·level·(2p/span)^order.
ROUNDINGS = 16.0


@dataclass(frozen=True)
class Joint:
    """Where two pieces of a law meet.

    angle : cam angle, rad
    continuity : highest derivative that goes on without a jump, 4 at most, −1 for a step
    jump : right minus left limit of the next derivative, m/rad^(continuity + 1); 0 at C4
    """

    angle: float
    continuity: int
    jump: float


def joints(law: Law) -> tuple[Joint, ...]:
    """Every joint of the law with its class, in order from cam angle 0."""
    jumps = np.stack([law.jumps(order) for order in range(SMOOTHEST + 1)])
    broken = np.abs(jumps) > np.stack([_limits(law, order) for order in range(SMOOTHEST + 1)])
    first = np.where(broken.any(axis=0), np.argmax(broken, axis=0), SMOOTHEST + 1)
    sizes = np.vstack([jumps, np.zeros(law.spans.size)])[first, np.arange(law.spans.size)]
    found = zip(law.breaks[:-1].tolist(), (first - 1).tolist(), sizes.tolist(), strict=True)
    return tuple(Joint(*one) for one in found)


def continuity(law: Law) -> int:
    """The class of the whole law: that of its roughest joint."""
    return min(joint.continuity for joint in joints(law))


def _limits(law: Law, order: int) -> FloatArray:
    """``(n,)`` jump (m/rad^order) at the start of each piece that still counts as 0.

    A part of the derivative's peak in the two pieces, for others may be far sharper; of s over the
    turn. Or what rounding of levels makes of it, in short pieces of high degree and in dwells.
    """
    level = float(np.abs(law.ordinates).max())
    if order == 0:
        return np.full(law.spans.size, TOLERANCE * level)
    peaks = np.abs(law.derivative_ordinates(order)).max(axis=0)
    noise = ROUNDINGS * np.finfo(float).eps * level * (2.0 * law.degree / law.spans) ** order
    limits = np.maximum(TOLERANCE * peaks, noise)
    return np.asarray(np.maximum(limits, np.roll(limits, 1)))


def continuity_in_words(law: Law) -> str:
    """The class of a law's roughest joint."""
    found = continuity(law)
    return f"C{found}" if found < SMOOTHEST else f"C{SMOOTHEST} or smoother"

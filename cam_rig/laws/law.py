"""The one type every displacement law becomes: a periodic Bernstein piecewise polynomial."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BPoly

from cam_rig.errors import DynamicsError, LawError
from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import FloatArray

TURN = 2.0 * np.pi
#: A jump of s' above this, per rad and lift, is one; below, rounding.
VELOCITY_JUMP = 1e-9


@dataclass(frozen=True, eq=False)
class Law:
    """Follower displacement s(θ) over one turn of the cam, repeated for every turn.

    Parameters
    ----------
    name : the cam's name
    breaks : ``(n + 1,)`` cam angles in rad, from 0 to 2π
    ordinates : ``(p + 1, n)`` Bernstein ordinates in m, one column a piece

    Raises
    ------
    LawError : the arrays do not fit each other, are not finite, or do not span one turn
    """

    name: str
    breaks: FloatArray
    ordinates: FloatArray

    def __post_init__(self) -> None:
        breaks = np.array(self.breaks, dtype=np.float64)
        ordinates = np.array(self.ordinates, dtype=np.float64)
        if ordinates.ndim != 2 or breaks.shape != (ordinates.shape[1] + 1,):
            raise LawError(
                f"law {self.name!r}: {breaks.shape} breakpoints do not fit ordinates of shape "
                f"{ordinates.shape}; n pieces need n + 1 breakpoints"
            )
        if not (np.isfinite(breaks).all() and np.isfinite(ordinates).all()):
            raise LawError(f"law {self.name!r}: breakpoints and ordinates must be finite")
        if breaks[0] != 0.0 or breaks[-1] != TURN or np.any(np.diff(breaks) <= 0.0):
            raise LawError(
                f"law {self.name!r}: breakpoints must rise from 0 to 2π, got "
                f"{breaks[0]!r} to {breaks[-1]!r}"
            )
        for field, array in (("breaks", breaks), ("ordinates", ordinates)):
            array.setflags(write=False)
            object.__setattr__(self, field, array)

    @property
    def degree(self) -> int:
        """Degree p common to all pieces."""
        return int(self.ordinates.shape[0] - 1)

    @cached_property
    def spans(self) -> FloatArray:
        """``(n,)`` span of each piece, rad."""
        return np.diff(self.breaks)

    @cached_property
    def bpoly(self) -> BPoly:
        """The law as scipy sees it, periodic."""
        return BPoly(self.ordinates, self.breaks, extrapolate="periodic")

    def __call__(self, angle: FloatArray | float, order: int = 0) -> FloatArray:
        """Displacement s (m) or d^order s/dθ^order (m/rad^order) at cam angles in rad.

        At a joint the piece that begins there is taken (the right limit).
        """
        at = np.asarray(angle, dtype=np.float64)
        inside = (at - np.floor(at / TURN) * TURN).ravel()
        pieces = np.clip(np.searchsorted(self.breaks, inside, side="right") - 1, 0, None)
        pieces = np.minimum(pieces, self.spans.size - 1)
        out = np.empty(inside.size)
        ordinates = self._derivative(order)
        for i in np.unique(pieces):
            here = pieces == i
            u = (inside[here] - self.breaks[i]) / self.spans[i]
            out[here] = bernstein.evaluate(ordinates[:, i], u)
        return out.reshape(at.shape)

    def _derivative(self, order: int) -> FloatArray:
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
        extremes = [float(self.ordinates[0].min()), float(self.ordinates[0].max())]
        slopes = bernstein.derivative(self.ordinates)
        for i in range(self.spans.size):
            at = np.array(bernstein.crossings(slopes[:, i]))
            extremes.extend(bernstein.evaluate(self.ordinates[:, i], at).tolist())
        return max(extremes) - min(extremes)

    def jumps(self, order: int) -> FloatArray:
        """``(n,)`` right minus left limit of the derivative at the start of each piece."""
        ordinates = self.derivative_ordinates(order)
        return np.asarray(ordinates[0] - np.roll(ordinates[-1], 1))

    def require_velocity(self) -> None:
        """Refuse a law whose velocity jumps: every follower model would need an infinite force.

        Raises
        ------
        DynamicsError : with the jump, in m/rad, and where it is
        """
        if self._velocity_jump is not None:
            size, angle = self._velocity_jump
            raise DynamicsError(
                f"law {self.name!r}: velocity jumps by {size:g} m/rad at {angle:g}°; allowed: "
                "segments that join with one slope"
            )

    @cached_property
    def _velocity_jump(self) -> tuple[float, float] | None:
        jump = self.jumps(1)
        worst = int(np.argmax(np.abs(jump)))
        if abs(jump[worst]) <= VELOCITY_JUMP * self.lift:
            return None
        return float(jump[worst]), float(np.degrees(self.breaks[worst]))

    @cached_property
    def largest_step(self) -> float:
        """Largest step of s at a joint, m: rounding, for a cam without a cliff."""
        return float(np.abs(self.jumps(0)).max())

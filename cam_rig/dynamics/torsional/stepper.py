"""Window after window of the torsional vibration, cut where the cam crosses a joint of its law.

The time of a crossing depends on the solution. So a window runs a little past the joint, on the
same polynomial continued, and is cut afterwards at the root of θ_c(t) = joint: up to there it
obeyed the right piece, and nothing has to be solved again.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from cam_rig.dynamics.torsional.collocation import (
    CollocationWindow,
    TwistPiece,
    basis,
    basis_at,
    largest,
    table,
)
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN, FloatArray

#: Degrees of a window, and the phase of the shaft's free vibration (rad) each resolves: half of
#: it is the argument of the Bessel functions that are the coefficients of an oscillation.
DEGREES = (16, 24, 32, 48, 64)
PHASES = (2.0, 7.0, 14.0, 30.0, 48.0)
#: A vibration (rad, rad/s) that a long dwell has damped below this is 0: nearer to the smallest
#: number that a float can hold, it has no digits left to be resolved.
DEAD = 1e-250
#: A window is resolved when its last coefficients are below this fraction of the largest.
RESOLVED = 1e-13
#: Halvings and other changes of one window before it is given up.
MAX_TRIES = 40
#: Windows of one run: hours of turning.
MAX_WINDOWS = 100_000
#: Windows without length that may follow one another at a joint.
MAX_STALLS = 3
#: What is left of a run behind a joint and below this fraction of it is rounding, and not run.
SLIVER = 4e-16
#: Newton's method for a crossing ends at this relative correction.
SETTLED = 1e-10


@lru_cache(maxsize=64)
def pieces_of(law: Law) -> tuple[TwistPiece, ...]:
    """The law's pieces as a window takes them."""
    require_smooth(law)
    stack = np.stack([law.derivative_ordinates(order).T for order in range(4)], axis=1)
    stack *= bernstein.binomials(law.degree)
    return tuple(
        TwistPiece(weights, float(span)) for weights, span in zip(stack, law.spans, strict=True)
    )


@dataclass
class Control:
    """What has proved to resolve a piece."""

    reach: float  #: longest window, s
    bump: int = 0  #: rungs above those of the phase


@dataclass(frozen=True, eq=False)
class SmoothInterval:
    """A finished window."""

    begin: float  #: s
    end: float  #: s
    span: float  #: what the series are over, s
    series: FloatArray
    piece: int
    low: float  #: unwrapped cam angle at which the piece begins; the series count from it, rad


class March:
    """Takes a state on, along a ``ramp`` (rad/s²), and keeps what it learns about the pieces."""

    def __init__(self, law: Law, parameters: TorsionalParameters, ramp: float = 0.0) -> None:
        self.law, self.parameters, self.pieces = law, parameters, pieces_of(law)
        self.ramp = ramp
        self.rate = math.sqrt(parameters.mobility * parameters.shaft_stiffness)
        self.peak = 0.0
        self._controls = [Control(PHASES[-1] / self.rate) for _ in self.pieces]

    @np.errstate(over="ignore", invalid="ignore")  # a window that diverges is met by `_window`
    def run(
        self, state: TorsionalState, duration: float
    ) -> tuple[TorsionalState, list[SmoothInterval]]:
        """The state after ``duration`` (s), and the windows up to there."""
        index = self._index(state.cam_angle)
        state = self._from(state, -self._low(index))
        self.peak = max(self.peak, abs(state.twist))
        time, stalls, done = 0.0, 0, list[SmoothInterval]()
        while time < duration:
            window = self._window(state, index % len(self.pieces), duration - time)
            series = window.series()
            at, way = leave(window, series)
            last = way == 0 and window.length >= duration - time
            last = last or duration - (time + at) <= SLIVER * duration
            end = duration if last else time + at
            stalls = stalls + 1 if end <= time else 0
            if stalls > MAX_STALLS or len(done) >= MAX_WINDOWS:
                raise self._stuck(index, time, len(done))
            if end > time:
                piece, low = index % len(self.pieces), self._low(index)
                done.append(SmoothInterval(time, end, window.length, series, piece, low))
                state = self._state(series, state, end - time, window.length)
            if way:  # spans, not differences of unwrapped angles, which are rounded
                span = self.pieces[(index if way > 0 else index - 1) % len(self.pieces)].span
                state, index = self._from(state, -way * span), index + way
            time = end
        return self._from(state, self._low(index)), done

    def _index(self, angle: float) -> int:
        """Number of the piece at an unwrapped cam angle (rad), counted through all turns."""
        turn = math.floor(angle / TURN)
        piece = int(np.searchsorted(self.law.breaks[1:-1], angle - turn * TURN, side="right"))
        return turn * len(self.pieces) + piece

    def _low(self, index: int) -> float:
        """Unwrapped cam angle (rad) at which a piece begins."""
        turn, piece = divmod(index, len(self.pieces))
        return turn * TURN + float(self.law.breaks[piece])

    @staticmethod
    def _from(state: TorsionalState, shift: float) -> TorsionalState:
        return replace(state, flywheel_angle=state.flywheel_angle + shift)

    def _window(self, state: TorsionalState, piece: int, remaining: float) -> CollocationWindow:
        """A solved and resolved window from ``state`` on: as long as can be."""
        if max(abs(state.twist), abs(state.twist_rate)) < DEAD:
            state = replace(state, twist=0.0, twist_rate=0.0)
        control, length = self._controls[piece], 0.0
        for _ in range(MAX_TRIES):
            length = self._length(state, piece, remaining)
            rung = bisect.bisect_left(PHASES, length * self.rate) + control.bump
            degree = DEGREES[min(rung, len(DEGREES) - 1)]
            window = CollocationWindow(
                self.parameters, self.pieces[piece], state, length, table(degree), self.ramp
            )
            solved = window.solve()
            tail = window.tail() if solved else None
            if tail is not None and tail[1] <= RESOLVED:
                if tail[0] <= RESOLVED and length > 0.9 * control.reach:
                    control.reach *= 2.0
                self.peak = max(self.peak, largest(window.twist))
                return window
            if solved and rung < len(DEGREES) - 1:
                control.bump += 1
            else:
                control.reach = 0.5 * length
        raise DynamicsError(
            f"law {self.law.name!r}: a window of {length:.3g} s from twist {state.twist:.6g} rad, "
            f"rate {state.twist_rate:.6g} rad/s {'is not resolved' if solved else 'diverges'} "
            f"after {MAX_TRIES} tries; check the state the run begins with, and that a shaft of "
            f"{self.parameters.shaft_stiffness:g} N·m/rad can carry the follower's torque"
        )

    def _length(self, state: TorsionalState, piece: int, remaining: float) -> float:
        """Time (s) to a little past the next joint as the flywheel turns, in equal windows."""
        span, speed = self.pieces[piece].span, state.flywheel_speed + state.lead_rate
        margin = min(2.0 * self.peak + 0.002 * span, 0.1 * span)
        forwards = (speed or self.ramp) > 0.0
        angle = state.flywheel_angle + state.lead
        ahead = span - angle if forwards else angle
        way = max(ahead, 0.0) + margin
        square = speed**2 + 2.0 * way * (self.ramp if forwards else -self.ramp)
        length = remaining
        if square > 0.0:  # else it stands, or turns back before
            length = min(remaining, 2.0 * way / (abs(speed) + math.sqrt(square)))
        return length / math.ceil(length / self._controls[piece].reach)

    def _state(
        self, series: FloatArray, start: TorsionalState, at: float, length: float
    ) -> TorsionalState:
        rows = (series @ basis_at(series.shape[1], at / length)).tolist()
        gained = self.ramp * at
        turned = start.flywheel_angle + (start.flywheel_speed + 0.5 * gained) * at
        lead, lead_rate = rows[5:] or (0.0, 0.0)
        speed = start.flywheel_speed + gained
        return TorsionalState(rows[0], rows[1], turned, speed, lead, lead_rate)

    def _stuck(self, index: int, time: float, windows: int) -> DynamicsError:
        why = "the cam stands still there"
        if windows >= MAX_WINDOWS:
            why = "solve a shorter span, and go on from its end"
        return DynamicsError(
            f"law {self.law.name!r}: after {windows} windows and {time:.6g} s at the joint at "
            f"{self._low(index):.6g} rad the run goes on no more; {why}"
        )


def leave(window: CollocationWindow, series: FloatArray) -> tuple[float, int]:
    """Time in the window (s) at which it leaves its piece, and which way: 1, −1, or 0 for never.

    Nodes are dense enough to see every exit of a cam that turns one way; where it turns back
    they are filled in.
    """
    u, angle, span = window.table.nodes, window.angle, window.piece.span
    if window.speed.min() < 0.0 < window.speed.max():
        u = np.sin(np.linspace(0.0, 0.5 * np.pi, 8 * u.size)) ** 2
        angle = series[2] @ basis(series.shape[1], u)
    outside = np.flatnonzero((angle[1:] > span) | (angle[1:] < 0.0))
    if outside.size == 0:
        return window.length, 0
    i = int(outside[0])
    way = 1 if angle[i + 1] > span else -1
    joint = span if way > 0 else 0.0
    return window.length * _root(window, series[2:4], joint, float(u[i]), float(u[i + 1])), way


def _root(
    window: CollocationWindow, series: FloatArray, joint: float, low: float, high: float
) -> float:
    """U at which θ_c meets the joint: Newton's method, kept in its bracket by bisection."""
    sign = 1.0 if joint > 0.0 else -1.0
    u = 0.5 * (low + high)
    for _ in range(MAX_TRIES):
        angle, speed = series @ basis_at(series.shape[1], u)
        gap = sign * (float(angle) - joint)
        low, high = (low, u) if gap > 0.0 else (u, high)
        slope = sign * float(speed) * window.length
        following = u - gap / slope if slope > 0.0 else low
        if not low <= following <= high:
            following = 0.5 * (low + high)
            if following in (low, high):
                return following
        if abs(following - u) <= SETTLED * u:  # and what follows is the square of it
            return following
        u = following
    return u

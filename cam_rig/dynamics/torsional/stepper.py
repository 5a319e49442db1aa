"""Solution of the torsional vibration window by window, cut at the joints of the law.

A window is a short interval of time in which the solution is a Chebyshev series and the cam is on
one polynomial piece of the law. The time at which the cam crosses a joint between two pieces
depends on the solution. A window therefore extends a little beyond the joint, with the polynomial
of its piece continued. It is shortened afterwards to the time at which the cam angle θ_c is at the
joint. Up to this time the piece was right, so no window is solved twice.
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
    collocation_table,
    largest,
)
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN, FloatArray

#: Degrees that the Chebyshev series of a window of time may have.
DEGREES = (16, 24, 32, 48, 64)
#: Largest phase (rad) by which the shaft's free vibration may advance in a window, for each degree
#: in `DEGREES`. The Chebyshev coefficients of an oscillation are Bessel functions of half the
#: phase, so a series of this degree resolves it.
PHASES = (2.0, 7.0, 14.0, 30.0, 48.0)
#: Smallest vibration (rad and rad/s) that is kept. A long dwell may damp the vibration below this
#: value, close to the smallest float, where no digits are left. The vibration is then set to 0.
MIN_VIBRATION = 1e-250
#: Largest size of the last Chebyshev coefficients of a resolved window, relative to the scale of
#: the accelerations in it.
RESOLVED_RTOL = 1e-13
#: Largest number of attempts to resolve a window, each with a shorter window or a higher degree.
MAX_TRIES = 40
#: Largest number of windows (intervals of time) in one solution, enough for hours of rotation.
MAX_WINDOWS = 100_000
#: Largest number of successive windows of zero duration at a joint between two pieces of the law.
#: With more, the solution has failed to leave the joint.
MAX_STALLS = 3
#: Shortest remaining time after a joint of the law, as a fraction of the duration of the solution.
#: A shorter remainder is rounding and is omitted.
MIN_REMAINDER = 4e-16
#: Relative correction at which Newton's method for the time at which the cam crosses a joint of the
#: law has converged.
CROSSING_RTOL = 1e-10


@lru_cache(maxsize=64)
def pieces_of(law: Law) -> tuple[TwistPiece, ...]:
    """Return the polynomial pieces of a law in the form that `CollocationWindow` uses."""
    require_smooth(law)
    stack = np.stack([law.derivative_ordinates(order).T for order in range(4)], axis=1)
    stack *= bernstein.binomials(law.degree)
    return tuple(
        TwistPiece(weights, float(span)) for weights, span in zip(stack, law.spans, strict=True)
    )


@dataclass
class Control:
    """Settings with which the last window of time on a piece of the law was resolved.

    They are the first choice for the next window on the same piece.
    """

    max_length: float  #: longest duration of a window, s
    #: Number of entries of `DEGREES` by which the degree is higher than the phase of the free
    #: vibration requires.
    extra_degrees: int = 0


@dataclass(frozen=True, eq=False)
class SolvedWindow:
    """Solution in one window of time, on one polynomial piece of the law."""

    start: float  #: start of the window, s since the start of the solution
    end: float  #: end of the window, s since the start of the solution
    span: float  #: duration for which the series was computed, at least that of the window, s
    series: FloatArray  #: Chebyshev coefficients, rows as in `CollocationWindow.series`
    piece: int  #: index of the piece of the law
    #: Unwrapped cam angle (rad) at the start of the piece of the law, from which the cam angles in
    #: the Chebyshev series are measured.
    low: float


class TwistSolver:
    """Solver of the torsional vibration (eq. 10 of the paper) for any duration.

    The flywheel turns at constant speed or with the acceleration ``ramp`` (rad/s²). The solver
    stores the settings with which the windows on each piece of the law were resolved.
    """

    def __init__(self, law: Law, parameters: TorsionalParameters, ramp: float = 0.0) -> None:
        self.law, self.parameters, self.pieces = law, parameters, pieces_of(law)
        self.ramp = ramp
        self.rate = math.sqrt(parameters.mobility * parameters.shaft_stiffness)
        self.peak = 0.0
        self._controls = [Control(PHASES[-1] / self.rate) for _ in self.pieces]

    @np.errstate(over="ignore", invalid="ignore")  # `_window` handles a window that diverges
    def run(
        self, state: TorsionalState, duration: float
    ) -> tuple[TorsionalState, list[SolvedWindow]]:
        """Return the state of the shaft after ``duration`` s, and the solution until then.

        The solution starts in ``state`` and is a list of windows in the order of time.

        Raises
        ------
        DynamicsError
            If a window cannot be resolved, or there are more than `MAX_WINDOWS` windows.
        """
        index = self._index(state.cam_angle)
        state = self._shift_angle(state, -self._low(index))
        self.peak = max(self.peak, abs(state.twist))
        time, stalls, windows = 0.0, 0, list[SolvedWindow]()
        while time < duration:
            window = self._window(state, index % len(self.pieces), duration - time)
            series = window.series()
            exit_time, direction = find_exit(window, series)
            last = direction == 0 and window.length >= duration - time
            last = last or duration - (time + exit_time) <= MIN_REMAINDER * duration
            end = duration if last else time + exit_time
            stalls = stalls + 1 if end <= time else 0
            if stalls > MAX_STALLS or len(windows) >= MAX_WINDOWS:
                raise self._stall_error(index, time, len(windows))
            if end > time:
                piece, low = index % len(self.pieces), self._low(index)
                windows.append(SolvedWindow(time, end, window.length, series, piece, low))
                state = self._state(series, state, end - time, window.length)
            # Shift by the span of the piece, because a difference of unwrapped angles would be
            # rounded.
            if direction:
                span = self.pieces[(index if direction > 0 else index - 1) % len(self.pieces)].span
                state, index = self._shift_angle(state, -direction * span), index + direction
            time = end
        return self._shift_angle(state, self._low(index)), windows

    def _index(self, angle: float) -> int:
        """Return the index of the law's piece at an unwrapped cam angle (rad).

        The pieces are counted over all turns from angle 0 on, so the index may exceed the number of
        pieces per turn.
        """
        turn = math.floor(angle / TURN)
        piece = int(np.searchsorted(self.law.breaks[1:-1], angle - turn * TURN, side="right"))
        return turn * len(self.pieces) + piece

    def _low(self, index: int) -> float:
        """Return the unwrapped cam angle (rad) at the start of a piece of the law.

        ``index`` counts the pieces over all turns.
        """
        turn, piece = divmod(index, len(self.pieces))
        return turn * TURN + float(self.law.breaks[piece])

    @staticmethod
    def _shift_angle(state: TorsionalState, shift: float) -> TorsionalState:
        """Return a state with its flywheel angle increased by ``shift`` rad."""
        return replace(state, flywheel_angle=state.flywheel_angle + shift)

    def _window(self, state: TorsionalState, piece: int, remaining: float) -> CollocationWindow:
        """Solve and return the next window of time, from a state of the shaft.

        If the solution is not resolved, the degree is increased or the window shortened, up to
        `MAX_TRIES` times. ``piece`` is the index of the law's piece, and ``remaining`` is the time
        to the end of the solution, s.

        Raises
        ------
        DynamicsError
            If no attempt resolves the window.
        """
        if max(abs(state.twist), abs(state.twist_rate)) < MIN_VIBRATION:
            state = replace(state, twist=0.0, twist_rate=0.0)
        control, length = self._controls[piece], 0.0
        for _ in range(MAX_TRIES):
            length = self._length(state, piece, remaining)
            order = bisect.bisect_left(PHASES, length * self.rate) + control.extra_degrees
            degree = DEGREES[min(order, len(DEGREES) - 1)]
            window = CollocationWindow(
                self.parameters,
                self.pieces[piece],
                state,
                length,
                collocation_table(degree),
                self.ramp,
            )
            solved = window.solve()
            tail = window.tail() if solved else None
            if tail is not None and tail[1] <= RESOLVED_RTOL:
                if tail[0] <= RESOLVED_RTOL and length > 0.9 * control.max_length:
                    control.max_length *= 2.0
                self.peak = max(self.peak, largest(window.twist))
                return window
            if solved and order < len(DEGREES) - 1:
                control.extra_degrees += 1
            else:
                control.max_length = 0.5 * length
        raise DynamicsError(
            f"law {self.law.name!r}: a window of {length:.3g} s from twist {state.twist:.6g} rad, "
            f"rate {state.twist_rate:.6g} rad/s {'is not resolved' if solved else 'diverges'} "
            f"after {MAX_TRIES} tries; check the state at the start of the run, and that a shaft "
            f"of {self.parameters.shaft_stiffness:g} N·m/rad can carry the follower's torque"
        )

    def _length(self, state: TorsionalState, piece: int, remaining: float) -> float:
        """Return the duration (s) of the next window of time.

        The time in which the flywheel turns a little beyond the next joint of the law, at most
        ``remaining`` s, is divided into equal windows, none longer than the stored limit for the
        piece.
        """
        span, speed = self.pieces[piece].span, state.flywheel_speed + state.lead_rate
        margin = min(2.0 * self.peak + 0.002 * span, 0.1 * span)
        is_forward = (speed or self.ramp) > 0.0
        angle = state.flywheel_angle + state.lead
        ahead = span - angle if is_forward else angle
        distance = max(ahead, 0.0) + margin
        square = speed**2 + 2.0 * distance * (self.ramp if is_forward else -self.ramp)
        length = remaining
        if square > 0.0:  # otherwise the flywheel stops or turns back before the joint
            length = min(remaining, 2.0 * distance / (abs(speed) + math.sqrt(square)))
        return length / math.ceil(length / self._controls[piece].max_length)

    def _state(
        self, series: FloatArray, start: TorsionalState, time: float, length: float
    ) -> TorsionalState:
        """Return the state of the shaft at a time (s) since the start of a window.

        ``series`` are the Chebyshev coefficients over ``length`` s from the start of the window,
        where the state is ``start``.
        """
        rows = (series @ basis_at(series.shape[1], time / length)).tolist()
        speed_gain = self.ramp * time
        angle = start.flywheel_angle + (start.flywheel_speed + 0.5 * speed_gain) * time
        lead, lead_rate = rows[5:] or (0.0, 0.0)
        speed = start.flywheel_speed + speed_gain
        return TorsionalState(rows[0], rows[1], angle, speed, lead, lead_rate)

    def _stall_error(self, index: int, time: float, windows: int) -> DynamicsError:
        """Return the error for a solution that needs too many windows or stops at a joint.

        ``index`` is that of the law's piece, counted over all turns, ``time`` is the time reached
        (s), and ``windows`` is the number of windows solved.
        """
        reason = "the cam does not move there"
        if windows >= MAX_WINDOWS:
            reason = "solve a shorter duration, and continue from its end"
        return DynamicsError(
            f"law {self.law.name!r}: the run stops after {windows} windows and {time:.6g} s, at "
            f"the joint at {self._low(index):.6g} rad; {reason}"
        )


def find_exit(window: CollocationWindow, series: FloatArray) -> tuple[float, int]:
    """Return the time (s) at which the cam leaves the window's piece of the law.

    The second result is the direction: 1 forwards, −1 backwards, and 0 if the cam stays on the
    piece up to the end of the window, whose duration is then the time. The Chebyshev nodes are
    dense enough to detect every exit of a cam that turns in one direction. For a cam that turns
    back more points are evaluated.
    """
    u, angle, span = window.table.nodes, window.angle, window.piece.span
    if window.speed.min() < 0.0 < window.speed.max():
        u = np.sin(np.linspace(0.0, 0.5 * np.pi, 8 * u.size)) ** 2
        angle = series[2] @ basis(series.shape[1], u)
    outside = np.flatnonzero((angle[1:] > span) | (angle[1:] < 0.0))
    if outside.size == 0:
        return window.length, 0
    i = int(outside[0])
    direction = 1 if angle[i + 1] > span else -1
    joint = span if direction > 0 else 0.0
    u_exit = _crossing(window, series[2:4], joint, float(u[i]), float(u[i + 1]))
    return window.length * u_exit, direction


def _crossing(
    window: CollocationWindow, series: FloatArray, joint: float, low: float, high: float
) -> float:
    """Return the relative time u in a window at which the cam crosses a joint.

    ``series`` are the Chebyshev coefficients of the cam angle and speed, and ``joint`` is the angle
    of the joint since the start of the piece, rad. ``low`` and ``high`` are limits of u between 0
    and 1. Newton's method is used, and bisection if a step leaves these limits.
    """
    sign = 1.0 if joint > 0.0 else -1.0
    u = 0.5 * (low + high)
    for _ in range(MAX_TRIES):
        angle, speed = series @ basis_at(series.shape[1], u)
        gap = sign * (float(angle) - joint)
        low, high = (low, u) if gap > 0.0 else (u, high)
        slope = sign * float(speed) * window.length
        next_u = u - gap / slope if slope > 0.0 else low
        if not low <= next_u <= high:
            next_u = 0.5 * (low + high)
            if next_u in (low, high):
                return next_u
        if abs(next_u - u) <= CROSSING_RTOL * u:  # the next correction is the square of this one
            return next_u
        u = next_u
    return u

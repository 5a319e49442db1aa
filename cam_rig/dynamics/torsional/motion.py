"""Torsional vibration of a cam on its shaft (eq. 10 of the paper), at any time.

    I θ̈_c + c_s (θ̇_c − θ̇_v) + k_s (θ_c − θ_v) + (m s̈ + c ṡ + k s + preload) s'(θ_c) = 0

with s, s', s'' at the cam angle θ_c, ṡ = s' θ̇_c and s̈ = s'' θ̇_c² + s' θ̈_c. The angle of the
flywheel is θ_v, and the twist of the shaft is ψ = θ_c − θ_v. The preload and the shaft damping c_s
are additions to the equation of the paper.

The flywheel has constant speed, θ_v = θ_0 + ω t, or an inertia,
I_v θ̈_v = k_s (θ_c − θ_v) + c_s (θ̇_c − θ̇_v) + T_motor. On a ramp of α rad/s² the flywheel without an
inertia follows the ramp, θ_v = θ_0 + ω t + α t²/2. For a flywheel with an inertia the motor torque
increases by I_v α.

The model assumes that the follower stays on the cam. The result is not valid at times with a
negative `TorsionalMotion.contact_force`.

The time is divided into short intervals, called windows (`stepper`). In each window eq. 10 is
solved by Newton's method on Chebyshev nodes, in integral form (`collocation`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.parameters import require_number
from cam_rig.dynamics.torsional.collocation import ChebyshevPath
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.stepper import TwistSolver
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN, FloatArray, to_rpm


@dataclass(frozen=True, eq=False)
class TorsionalMotion:
    """Torsional motion of a cam on its shaft, from ``start_time`` to ``stop_time``.

    It is the solution of eq. 10 of the paper on torsional vibration, and consists of W windows
    (intervals of time), each with its own series.
    """

    law: Law  #: law of the cam
    parameters: TorsionalParameters  #: shaft and follower
    start_time: float  #: start of the solution, s
    path: ChebyshevPath  #: solution by the time since ``start_time``, so that no digits are lost
    pieces: NDArray[np.intp]  #: index of the polynomial piece of the law in each window, ``(W,)``
    lows: FloatArray  #: unwrapped cam angle at the start of this piece, rad, ``(W,)``
    end: TorsionalState  #: state at ``stop_time``

    @property
    def stop_time(self) -> float:
        """Time (s) up to which the torsional motion is computed."""
        return self.start_time + float(self.path.edges[-1])

    def at(self, times: FloatArray) -> FloatArray:
        """Return the torsional motion at m times (s), ``(5, m)``.

        The rows are the twist ψ of the shaft (rad), its rate ψ̇ (rad/s), and the cam angle θ_c
        (rad), speed θ̇_c (rad/s) and acceleration θ̈_c (rad/s²). At a joint of the law the values
        are those after it.
        """
        return self.path.at(self._since(times))[:5]

    def lead(self, times: FloatArray) -> FloatArray:
        """Return the lead of the flywheel at m times (s), and its rate, ``(2, m)``.

        The lead (rad) is the angle of the flywheel less that of a uniform rotation. Its rate is in
        rad/s. Both are 0 for a flywheel at constant speed.
        """
        since = self._since(times)
        if self.parameters.flywheel_inertia is None:
            return np.zeros((2, since.size))
        return self.path.at(since)[5:]

    def _since(self, times: FloatArray) -> FloatArray:
        """Convert times (s) to times since the start of the solution (s).

        Raises
        ------
        DynamicsError
            If a time is outside the solution.
        """
        since = np.atleast_1d(np.asarray(times, dtype=np.float64)) - self.start_time
        duration = float(self.path.edges[-1])
        slack = 1e-12 * duration + 4.0 * np.spacing(abs(self.start_time) + duration)
        if not np.all((since >= -slack) & (since <= duration + slack)):
            raise DynamicsError(
                f"times since the start are {since.min():.9g} to {since.max():.9g} s; allowed: "
                f"0 to {duration:.9g} s, so solve for longer"
            )
        return since

    def shaft_torque(self, times: FloatArray) -> FloatArray:
        """Return the torque of the shaft on the flywheel at times (s), N·m, ``(m,)``.

        It is k_s ψ + c_s ψ̇.
        """
        twist, twist_rate = self.at(times)[:2]
        p = self.parameters
        return np.asarray(p.shaft_stiffness * twist + p.shaft_damping * twist_rate)

    def contact_force(self, times: FloatArray) -> FloatArray:
        """Return the contact force m s̈ + c ṡ + k s + preload at times (s), N, ``(m,)``."""
        since = self._since(times)
        _, _, angle, speed, acceleration = self.path.at(since)[:5]
        window = self.path.window(since)
        piece = self.pieces[window]
        u = (angle - self.lows[window]) / self.law.spans[piece]
        s = np.empty((3, since.size))
        for i in np.unique(piece):
            in_piece = piece == i
            basis = bernstein.basis(self.law.degree, u[in_piece])
            s[:, in_piece] = self.law.motion[:, :, i] @ basis.T
        f = self.parameters.follower
        inertia = f.mass * (s[2] * speed**2 + s[1] * acceleration)
        return np.asarray(
            inertia + f.damping * s[1] * speed + f.spring_stiffness * s[0] + f.preload
        )


def solve(
    law: Law,
    parameters: TorsionalParameters,
    state: TorsionalState,
    start_time: float,
    duration: float,
    ramp: float = 0.0,
) -> TorsionalMotion:
    """Solve eq. 10 for the torsional vibration, from a given state.

    Parameters
    ----------
    law : Law
        The law, without velocity jumps.
    parameters : TorsionalParameters
        The shaft and the follower.
    state : TorsionalState
        State of the shaft at the start.
    start_time : float
        Time of the start, s.
    duration : float
        Duration of the solution, s, > 0.
    ramp : float
        Acceleration α of the flywheel, rad/s² (default: 0). A flywheel with an inertia gets the
        additional motor torque I_v α.

    Returns
    -------
    TorsionalMotion
        The solution at any time.

    Raises
    ------
    DynamicsError
        If a number is not finite, the law has a velocity jump, or the solution diverges.

    References
    ----------
    Paper, eq. 10.
    """
    numbers = {"start_time": start_time, "duration": duration, "ramp": ramp, **asdict(state)}
    for name, value in numbers.items():
        require_number(name, value, "> 0" if name == "duration" else "of either sign")
    end, windows = TwistSolver(law, parameters, ramp).run(state, duration)
    for window in windows:
        window.series[2, 0] += window.low
    path = ChebyshevPath(
        np.array([0.0, *(window.end for window in windows)]),
        np.array([window.span for window in windows]),
        [window.series for window in windows],
    )
    pieces = np.array([window.piece for window in windows])
    lows = np.array([window.low for window in windows])
    return TorsionalMotion(law, parameters, start_time, path, pieces, lows, end)


#: Largest accepted change of a periodic shaft state over one turn, relative to the peak twist.
PERIODIC_RTOL = 1e-11
#: Change of the shaft state over one turn, relative to the peak twist, below which the iteration
#: for a periodic state ends.
TARGET_RTOL = 1e-13
#: Largest number of iterations for a periodic shaft state. Each iteration computes one turn.
MAX_TURNS = 25
#: Step of the initial shaft state, relative to the peak twist, for the finite differences that
#: approximate the derivative of the state after one turn.
SLOPE_STEP = 0.03
#: Lower limit of the smallest singular value of the derivative of the state's change over one turn.
#: Below it a turn hardly changes some disturbance of the state: the shaft is in resonance with the
#: cam and has no periodic state.
MIN_SLOPE_NORM = 1e-8


@lru_cache(maxsize=64)
def steady_state(
    law: Law, parameters: TorsionalParameters, speed: float
) -> tuple[TorsionalParameters, TorsionalState]:
    """Return parameters with the motor torque, and the periodic state of the shaft.

    The state is that at flywheel angle 0 and repeats after one turn. A constant motor torque, the
    mean of the load, drives a flywheel with an inertia. The returned parameters contain this
    torque. The state has no lead of the flywheel, because the uniform rotation from which the lead
    is measured may start at any state of the steady turn.

    Parameters
    ----------
    law : Law
        The law, without velocity jumps.
    parameters : TorsionalParameters
        The shaft and the follower.
    speed : float
        Mean speed of the flywheel, rad/s, not 0.

    Raises
    ------
    DynamicsError
        If there is no periodic state, because the shaft is in resonance with the cam.
    """
    require_number("speed", speed, "of either sign")
    if speed == 0.0:
        raise DynamicsError(f"speed is {speed!r}; allowed for a periodic state: finite, not 0")
    solver, duration = TwistSolver(law, parameters), TURN / abs(speed)
    inertia = parameters.flywheel_inertia
    # Units of the unknowns: twist, twist rate, lead rate and torque of a free vibration of 1 rad.
    momentum = parameters.shaft_stiffness / solver.rate
    unit = np.array([1.0, solver.rate, momentum / (inertia or 1.0), momentum / duration])

    def start_from(x: FloatArray) -> tuple[TorsionalParameters, TorsionalState]:
        twist, rate, *flywheel = (x * unit[: x.size]).tolist()
        start = TorsionalState(twist, rate, 0.0, speed, 0.0, *flywheel[:1])
        return replace(parameters, motor_torque=flywheel[1]) if flywheel else parameters, start

    def change_by_turn(x: FloatArray) -> FloatArray:
        solver.parameters, start = start_from(x)
        end, _ = solver.run(start, duration)
        values = [end.twist, end.twist_rate, end.lead_rate, end.lead / duration]
        values = np.array(values) / unit[[0, 1, 2, 2]]
        return np.asarray(values - np.array([*x[:3], 0.0]) if x.size == 4 else values[:2] - x)

    x, change, slope = _fixed_point(
        change_by_turn, 2 if inertia is None else 4, lambda: solver.peak
    )
    scale = max(solver.peak, float(np.abs(x).max()))
    if not np.abs(change).max() <= PERIODIC_RTOL * scale:
        raise DynamicsError(
            f"no periodic state at {to_rpm(speed):.6g} rpm: a turn misses its start by "
            f"{np.abs(change).max():.3g} rad of {scale:.3g}, allowed {PERIODIC_RTOL:g} of it; "
            f"its slope is {slope:.3g}. Resonance needs damping"
        )
    return start_from(x)


def steady_motion(law: Law, parameters: TorsionalParameters, speed: float) -> TorsionalMotion:
    """Return the torsional motion over one turn in steady state.

    The turn starts at flywheel angle 0 and time 0. ``speed`` is the mean speed, rad/s.
    """
    driven, start = steady_state(law, parameters, speed)
    return solve(law, driven, start, 0.0, TURN / speed)


def _fixed_point(
    change_of: Callable[[FloatArray], FloatArray], size: int, peak: Callable[[], float]
) -> tuple[FloatArray, FloatArray, float]:
    """Solve change_of(x) = 0 for a state x of the shaft, by Broyden's method.

    ``change_of`` returns the change of a state over one turn, so the solution is a periodic state.
    Returns x, ``(size,)``, the remaining change there, ``(size,)``, and the smallest singular value
    of the derivative of the change. ``peak`` returns the peak twist so far (rad).
    """
    x = np.zeros(size)
    change = change_of(x)
    length = SLOPE_STEP * (peak() or 1.0)
    slopes = np.stack(
        [(change_of(step) - change) / length for step in length * np.eye(size)], axis=1
    )
    for _ in range(MAX_TURNS):
        if np.linalg.norm(slopes, -2) < MIN_SLOPE_NORM:
            break
        step = np.linalg.solve(slopes, -change)
        x, last = x + step, change
        change = change_of(x)
        if np.abs(change).max() <= TARGET_RTOL * max(peak(), np.abs(x).max()):
            break
        slopes += np.outer(change - last - slopes @ step, step) / (step @ step)
    return x, change, float(np.linalg.norm(slopes, -2))

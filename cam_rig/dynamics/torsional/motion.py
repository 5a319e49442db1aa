"""Torsional vibration of a cam on its shaft (eq. 10 of the paper), to rounding and at any time.

    I θ̈_c + c_s (θ̇_c − θ̇_v) + k_s (θ_c − θ_v) + (m s̈ + c ṡ + k s + preload) s'(θ_c) = 0

with s, s', s'' at the twisted angle θ_c, ṡ = s' θ̇_c and s̈ = s'' θ̇_c² + s' θ̈_c; the preload is
an addition to the paper's equation. The flywheel holds its speed, θ_v = θ_0 + ω t, or has an
inertia: I_v θ̈_v = k_s (θ_c − θ_v) + c_s (θ̇_c − θ̇_v) + T_motor. Along a ramp of α rad/s² a flywheel
that is driven follows it, θ_v = θ_0 + ω t + α t²/2, and one with an inertia is free as before while
the motor gives I_v α more. The follower is taken to stay on the cam: where
`TorsionalMotion.contact_force` is negative the result is not valid.

Method: window after window (`stepper`), each by Newton's method on Chebyshev nodes, in integral
form (`collocation_window`).
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
from cam_rig.dynamics.torsional.stepper import March
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN, FloatArray, to_rpm


@dataclass(frozen=True, eq=False)
class TorsionalMotion:
    """A solution over ``[start_time, stop_time]`` (s)."""

    law: Law
    parameters: TorsionalParameters
    start_time: float
    path: ChebyshevPath  #: from ``start_time`` on: a late start takes no digits from the windows
    pieces: NDArray[np.intp]  #: piece of the law in each window
    lows: FloatArray  #: cam angle at which that piece begins, rad
    end: TorsionalState  #: at ``stop_time``

    @property
    def stop_time(self) -> float:
        """Time at which it ends, s."""
        return self.start_time + float(self.path.edges[-1])

    def at(self, times: FloatArray) -> FloatArray:
        """ψ (rad), ψ̇, θ_c (rad), θ̇_c, θ̈_c, ``(5, m)``, at times (s); at joints right limits."""
        return self.path.at(self._since(times))[:5]

    def lead(self, times: FloatArray) -> FloatArray:
        """By how much the flywheel is ahead of even turning, rad and rad/s, ``(2, m)``."""
        since = self._since(times)
        if self.parameters.flywheel_inertia is None:
            return np.zeros((2, since.size))
        return self.path.at(since)[5:]

    def _since(self, times: FloatArray) -> FloatArray:
        """Times since the start, none of them outside."""
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
        """``(len(times),)`` k_s ψ + c_s ψ̇ in N·m: what the shaft puts on the flywheel."""
        twist, twist_rate = self.at(times)[:2]
        p = self.parameters
        return np.asarray(p.shaft_stiffness * twist + p.shaft_damping * twist_rate)

    def contact_force(self, times: FloatArray) -> FloatArray:
        """``(len(times),)`` m s̈ + c ṡ + k s + preload in N."""
        since = self._since(times)
        _, _, angle, speed, acceleration = self.path.at(since)[:5]
        window = self.path.window(since)
        piece = self.pieces[window]
        u = (angle - self.lows[window]) / self.law.spans[piece]
        s = np.empty((3, since.size))
        for i in np.unique(piece):
            here = piece == i
            s[:, here] = self.law.motion[:, :, i] @ bernstein.basis(self.law.degree, u[here]).T
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
    """Solve eq. 10 for ``duration`` (s); ``ramp`` (rad/s²) is of the flywheel, or of its motor."""
    numbers = {"start_time": start_time, "duration": duration, "ramp": ramp, **asdict(state)}
    for name, value in numbers.items():
        require_number(name, value, "> 0" if name == "duration" else "of either sign")
    end, done = March(law, parameters, ramp).run(state, duration)
    for stretch in done:
        stretch.series[2, 0] += stretch.low
    path = ChebyshevPath(
        np.array([0.0, *(stretch.end for stretch in done)]),
        np.array([stretch.span for stretch in done]),
        [stretch.series for stretch in done],
    )
    pieces = np.array([stretch.piece for stretch in done])
    lows = np.array([stretch.low for stretch in done])
    return TorsionalMotion(law, parameters, start_time, path, pieces, lows, end)


#: A steady state returns to itself to this fraction of its peak; it is sought to PERIODIC.
RETURNS, PERIODIC = 1e-11, 1e-13

MAX_TURNS = 25
#: Change of the start taken for the slopes of the map, in peaks.
NUDGE = 0.03
#: A start that comes back to this fraction of its change: the shaft is in resonance with the cam.
RESONANT = 1e-8


@lru_cache(maxsize=64)
def steady_state(
    law: Law, parameters: TorsionalParameters, speed: float
) -> tuple[TorsionalParameters, TorsionalState]:
    """The state at the flywheel's angle 0 that returns after one turn, and what drives it.

    ``speed`` (rad/s) is the mean. A flywheel with an inertia is driven by a constant torque, the
    mean of the load: it comes with the parameters. As any state of the turn may be its first, the
    one is taken whose flywheel passes angle 0 together with even turning, without a lead.
    """
    require_number("speed", speed, "of either sign")
    if speed == 0.0:
        raise DynamicsError(f"speed is {speed!r}; allowed for a periodic state: finite, not 0")
    march, duration = March(law, parameters), TURN / abs(speed)
    inertia = parameters.flywheel_inertia
    # A twist in rad, and what else a free vibration of one radian has: rate, momentum, torque.
    momentum = parameters.shaft_stiffness / march.rate
    unit = np.array([1.0, march.rate, momentum / (inertia or 1.0), momentum / duration])

    def begun(x: FloatArray) -> tuple[TorsionalParameters, TorsionalState]:
        twist, rate, *free = (x * unit[: x.size]).tolist()
        start = TorsionalState(twist, rate, 0.0, speed, 0.0, *free[:1])
        return replace(parameters, motor_torque=free[1]) if free else parameters, start

    def miss(x: FloatArray) -> FloatArray:
        march.parameters, start = begun(x)
        end, _ = march.run(start, duration)
        gap = [end.twist, end.twist_rate, end.lead_rate, end.lead / duration]
        gap = np.array(gap) / unit[[0, 1, 2, 2]]
        return np.asarray(gap - np.array([*x[:3], 0.0]) if x.size == 4 else gap[:2] - x)

    x, gap, slope = _fixed_point(miss, 2 if inertia is None else 4, lambda: march.peak)
    scale = max(march.peak, float(np.abs(x).max()))
    if not np.abs(gap).max() <= RETURNS * scale:
        raise DynamicsError(
            f"no periodic state at {to_rpm(speed):.6g} rpm: a turn misses its start by "
            f"{np.abs(gap).max():.3g} rad of {scale:.3g}, allowed {RETURNS:g} of it; "
            f"its slope is {slope:.3g}. Resonance needs damping"
        )
    return begun(x)


def steady_motion(law: Law, parameters: TorsionalParameters, speed: float) -> TorsionalMotion:
    """One turn in steady state at the mean ``speed`` (rad/s), from the flywheel's angle 0 on."""
    driven, start = steady_state(law, parameters, speed)
    return solve(law, driven, start, 0.0, TURN / speed)


def _fixed_point(
    miss: Callable[[FloatArray], FloatArray], size: int, peak: Callable[[], float]
) -> tuple[FloatArray, FloatArray, float]:
    """Where ``miss`` is zero, what is left of it there, and the least slope on the way."""
    x = np.zeros(size)
    gap = miss(x)
    nudge = NUDGE * (peak() or 1.0)
    slopes = np.stack([(miss(step) - gap) / nudge for step in nudge * np.eye(size)], axis=1)
    for _ in range(MAX_TURNS):
        if np.linalg.norm(slopes, -2) < RESONANT:
            break
        step = np.linalg.solve(slopes, -gap)
        x, last = x + step, gap
        gap = miss(x)
        if np.abs(gap).max() <= PERIODIC * max(peak(), np.abs(x).max()):
            break
        slopes += np.outer(gap - last - slopes @ step, step) / (step @ step)
    return x, gap, float(np.linalg.norm(slopes, -2))

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

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.input_limits import require_number
from cam_rig.dynamics.torsional.chebyshev import ChebyshevPath
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.stepper import March
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein

__all__ = [
    "ROWS",
    "TorsionalMotion",
    "TorsionalParameters",
    "TorsionalState",
    "solve",
]

#: Rows of a motion, with their units.
ROWS = (
    "twist [rad]",
    "twist_rate [rad/s]",
    "cam_angle [rad]",
    "cam_speed [rad/s]",
    "cam_acceleration [rad/s^2]",
)


@dataclass(frozen=True, eq=False)
class TorsionalMotion:
    """A solution over ``[start_time, stop_time]`` (s); ``end`` is its state at ``stop_time``.

    ``path`` counts time from ``start_time``: a late start takes no digits from the windows.
    ``pieces`` and ``lows`` give the piece of the law in each window of ``path`` and the cam
    angle (rad) at which that piece begins.
    """

    law: Law
    parameters: TorsionalParameters
    start_time: float
    path: ChebyshevPath
    pieces: NDArray[np.intp]
    lows: FloatArray
    end: TorsionalState

    @property
    def stop_time(self) -> float:
        """Time at which it ends, s."""
        return self.start_time + float(self.path.edges[-1])

    def at(self, times: FloatArray) -> FloatArray:
        """``(5, len(times))``, rows as in `ROWS`, at times (s) in any order.

        Where θ̈_c steps, at a joint of the law, the right limit is taken.
        """
        return self.path.at(self._since(times))[:5]

    def lead(self, times: FloatArray) -> FloatArray:
        """``(2, len(times))``: by how much the flywheel is ahead of even turning, rad and rad/s.

        Zeros where it holds its speed.
        """
        since = self._since(times)
        if self.parameters.flywheel_inertia is None:
            return np.zeros((2, since.size))
        return self.path.at(since)[5:]

    def sample(self, first: float, step: float, count: int) -> FloatArray:
        """``(5, count)`` at ``first + j·step`` (s), j = 0 … count − 1."""
        return self.at(first + step * np.arange(count, dtype=np.float64))

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
    """Solve eq. 10 from ``state`` at ``start_time`` (s) for ``duration`` (s).

    ``ramp`` (rad/s²) is the flywheel's acceleration, or what the motor gives more over I_v.

    Raises
    ------
    DynamicsError : a number is not finite, the duration not positive, the law has a step in s',
        or the motion cannot be resolved
    """
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

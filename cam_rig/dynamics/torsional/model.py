"""Torsional model (eq. 10 of the paper): parameters, state, and blocks of samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cam_rig.dynamics.interval import (
    Block,
    FollowerState,
    Interval,
    add_cam_state,
    is_same_speed,
    require_continuation,
)
from cam_rig.dynamics.parameters import (
    MAX_DAMPING_RATIO,
    MIN_POSITIVE,
    FollowerParameters,
    check_numbers,
    require_turning,
)
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

if TYPE_CHECKING:
    from cam_rig.dynamics.torsional.motion import TorsionalMotion


@dataclass(frozen=True)
class TorsionalParameters:
    """Parameters of a cam on an elastic shaft with a flywheel.

    The flywheel has constant speed or a finite inertia.

    Whole numbers are converted to floats.

    Parameters
    ----------
    follower : FollowerParameters
        The follower on the cam. Its stem is rigid in this model.
    cam_inertia : float
        I, moment of inertia of the cam, kg·m², > 0.
    shaft_stiffness : float
        k_s, N·m/rad, > 0.
    shaft_damping : float
        c_s, N·m·s/rad, ≥ 0 (default: 0).
    flywheel_inertia : float, optional
        I_v, kg·m², > 0. None is a flywheel at constant speed, the limit I_v → ∞ (default).
    motor_torque : float
        T_motor, constant torque on a flywheel with an inertia, N·m (default: 0).
        `cam_rig.dynamics.torsional.motion.steady_state` computes the torque that keeps the mean
        speed.

    Raises
    ------
    DynamicsError
        If a number is not finite or outside its limits, or a motor torque acts on a flywheel at
        constant speed.

    References
    ----------
    Paper, eq. 10, with a flywheel at constant speed.
    """

    follower: FollowerParameters
    cam_inertia: float  #: I, moment of inertia of the cam, kg·m²
    shaft_stiffness: float  #: k_s, torsional stiffness of the shaft, N·m/rad
    shaft_damping: float = 0.0  #: c_s, torsional damping of the shaft, N·m·s/rad
    flywheel_inertia: float | None = None  #: I_v, kg·m², None for a flywheel at constant speed
    motor_torque: float = 0.0  #: T_motor, constant torque on the flywheel, N·m

    def __post_init__(self) -> None:
        numbers = {name: value for name, value in vars(self).items() if name != "follower"}
        vars(self).update(check_numbers(numbers, "flywheel_inertia"))
        if self.flywheel_inertia is None and self.motor_torque != 0.0:
            raise DynamicsError(
                f"motor_torque is {self.motor_torque!r}; allowed: 0 where the flywheel holds its "
                "speed, so give a flywheel_inertia"
            )

    @property
    def mobility(self) -> float:
        """Acceleration of the shaft's twist per torque in the shaft, in 1/(kg·m²).

        It is 1/I + 1/I_v with the inertias of the cam and the flywheel. The second term is 0 for a
        flywheel at constant speed.
        """
        flywheel = 0.0 if self.flywheel_inertia is None else 1.0 / self.flywheel_inertia
        return 1.0 / self.cam_inertia + flywheel

    @property
    def flywheel_acceleration(self) -> tuple[float, float, float]:
        """Weights of ψ, ψ̇ and 1 in the acceleration θ̈_v of the flywheel, SI units.

        ψ is the twist of the shaft in rad. The weights are k_s/I_v, c_s/I_v and T_motor/I_v. They
        are 0 if the flywheel has constant speed.
        """
        if self.flywheel_inertia is None:
            return 0.0, 0.0, 0.0
        torques = self.shaft_stiffness, self.shaft_damping, self.motor_torque
        k, c, t = (torque / self.flywheel_inertia for torque in torques)
        return k, c, t


@dataclass(frozen=True)
class TorsionalState:
    """State of the elastic shaft: its twist, and the motion of the flywheel.

    The angle θ_v of the flywheel is the sum of a uniform rotation, which the drive sets, and a lead
    δ. They are stored separately, so that the small lead of a heavy flywheel keeps all its digits.
    """

    twist: float  #: twist ψ = θ_c − θ_v between cam and flywheel, rad
    twist_rate: float  #: rate ψ̇ of the twist, rad/s
    flywheel_angle: float  #: angle of the uniform rotation, rad
    flywheel_speed: float  #: speed of the uniform rotation, rad/s
    lead: float = 0.0  #: lead δ of a flywheel of finite inertia over the uniform rotation, rad
    lead_rate: float = 0.0  #: rate δ̇ of the lead, rad/s

    @property
    def cam_angle(self) -> float:
        """Cam angle θ_c = flywheel angle + lead + twist, rad."""
        return self.flywheel_angle + self.lead + self.twist


#: Number of values in `FollowerState.inner` if the flywheel has a finite inertia: twist, lead, and
#: the rates of both.
INERTIA_STATE_SIZE = 4


def from_rig(rig: RigConfig) -> TorsionalParameters:
    """Return the parameters of the shaft and the follower of a rig.

    Without ``flywheel_inertia`` in the rig file the flywheel has constant speed.

    Raises
    ------
    ConfigError
        If the rig does not have a shaft.
    DynamicsError
        If the damping ratio of the shaft is above `MAX_DAMPING_RATIO`.
    """
    if rig.shaft is None:
        raise rig.missing(["shaft"], "the model torsional", "take another model")
    flywheel = rig.shaft.flywheel_inertia
    parameters = TorsionalParameters(
        follower=FollowerParameters.from_rig(rig),
        cam_inertia=rig.shaft.cam_inertia.si,
        shaft_stiffness=rig.shaft.stiffness.si,
        shaft_damping=rig.shaft.damping.si,
        flywheel_inertia=None if flywheel is None else flywheel.si,
    )
    damping = parameters.shaft_damping
    critical = 2.0 * float(np.sqrt(parameters.shaft_stiffness / parameters.mobility))
    if damping > MAX_DAMPING_RATIO * critical:
        raise DynamicsError(
            f"rig {rig.name}: shaft.damping: is {damping:.4g} N*m*s/rad, "
            f"{damping / critical:.3g} times what is critical for the cam on its "
            f"shaft; allowed: {MAX_DAMPING_RATIO:g} times, {MAX_DAMPING_RATIO * critical:.3g} "
            "N*m*s/rad; a shaft that is damped more is rigid, so take another model"
        )
    return parameters


def advance(
    law: Law,
    parameters: TorsionalParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
) -> tuple[FollowerState, Block]:
    """Return the state at the end of an interval of the run, and its samples.

    The angle, speed and acceleration of the interval are those of the flywheel. ``sample_rate`` is
    in Hz. If ``state`` is None, the run starts, and the shaft has no twist. The field ``inner`` of
    a state contains the twist (rad) and its rate (rad/s). On a speed ramp the law itself is used,
    because it is evaluated at the angle of the twisted cam.

    A flywheel with an inertia has the mean speed of the interval, and a motor with the mean torque
    of the load drives it, see `start_state`. ``inner`` then also contains the lead of the flywheel
    and its rate.
    """
    # Imported here, because it imports scipy.linalg, which few scenes need.
    from cam_rig.dynamics.torsional.motion import solve

    require_turning(interval.mean_speed)
    require_continuation(state, interval)
    inner = () if state is None else state.inner
    last = state.cam_speed if state is not None else None
    driven, start = start_state(law, parameters, inner, last, interval)
    # The motion starts at time 0, so that the sample times of a late interval keep their digits.
    motion = solve(law, driven, start, 0.0, interval.duration, interval.acceleration)
    grid = interval.grid(sample_rate)
    rows = grid.new_rows()
    rows[1:5] = follower_rows(motion, np.minimum(grid.sample_times(), motion.stop_time))
    x, v, _, force = follower_rows(motion, np.array([motion.stop_time]))[:, 0].tolist()
    end = FollowerState(x, v, force, in_contact=True, inner=inner_state(motion))
    return add_cam_state(end, interval), Block(interval, rows)


def start_state(
    law: Law,
    parameters: TorsionalParameters,
    inner: tuple[float, ...],
    last_speed: float | None,
    interval: Interval,
) -> tuple[TorsionalParameters, TorsionalState]:
    """Return parameters with the motor torque, and the state at an interval's start.

    A flywheel with an inertia starts each new speed in its steady state, because a constant torque
    would need minutes to reach it. On a speed ramp the drive sets the motion of the flywheel, as in
    eq. 10 of the paper.

    Parameters
    ----------
    law : Law
        The law of the cam.
    parameters : TorsionalParameters
        The shaft and the follower.
    inner : tuple of float
        `inner_state` at the end of the previous interval, empty at the start of a run.
    last_speed : float, optional
        Cam speed at the end of the previous interval, rad/s, or None if unknown.
    interval : Interval
        The interval of the run, with the angle and the speed of the flywheel at its start.
    """
    from cam_rig.dynamics.torsional.motion import solve, steady_state

    angle, speed = interval.angle, interval.speed
    if parameters.flywheel_inertia is None or interval.acceleration != 0.0:
        twist, rate = inner[:2] or (0.0, 0.0)
        constant_speed = replace(parameters, flywheel_inertia=None)
        return constant_speed, TorsionalState(twist, rate, angle, speed)
    driven, start = steady_state(law, parameters, speed)
    is_unchanged = last_speed is None or is_same_speed(last_speed, speed)
    if len(inner) == INERTIA_STATE_SIZE and is_unchanged:
        twist, rate, lead, lead_rate = inner
        return driven, TorsionalState(twist, rate, angle, speed, lead, lead_rate)
    if angle / speed >= MIN_POSITIVE:  # carry the steady state from angle 0 to this angle
        end = solve(law, driven, start, 0.0, angle / speed).end
        start = replace(end, flywheel_angle=angle)
    return driven, start


def inner_state(motion: TorsionalMotion) -> tuple[float, ...]:
    """Return the state of the shaft at the end of a motion, as `FollowerState.inner`.

    It is the twist (rad) and its rate (rad/s). A flywheel with an inertia adds its lead (rad) and
    the rate of the lead (rad/s).
    """
    end = motion.end
    twist = (end.twist, end.twist_rate)
    has_inertia = motion.parameters.flywheel_inertia is not None
    return (*twist, end.lead, end.lead_rate) if has_inertia else twist


def follower_rows(motion: TorsionalMotion, times: FloatArray) -> FloatArray:
    """Return the follower's motion and contact force at m times (s), ``(4, m)``.

    The rows are lift (m), velocity (m/s), acceleration (m/s²) and contact force (N).
    """
    _, _, angle, speed, acceleration = motion.at(times)
    s = motion.law.motion_at(angle)
    follower = s[2] * speed**2 + s[1] * acceleration
    return np.stack([s[0], s[1] * speed, follower, motion.contact_force(times)])

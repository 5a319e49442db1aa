"""The torsional model (eq. 10 of the paper): its numbers, its state, its blocks in a scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cam_rig.dynamics.interval import (
    Block,
    FollowerState,
    Interval,
    ended,
    require_joined,
    same_speed,
)
from cam_rig.dynamics.parameters import (
    LEAST,
    MAX_DAMPING_RATIO,
    FollowerParameters,
    floats_of,
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
    """A cam on an elastic shaft behind a flywheel, which holds its speed or has an inertia."""

    follower: FollowerParameters  #: the follower on the cam; its stem is rigid here
    cam_inertia: float  #: I, kg·m²
    shaft_stiffness: float  #: k_s, N·m/rad
    shaft_damping: float = 0.0  #: c_s, N·m·s/rad
    #: I_v, kg·m²; None holds its speed (eq. 10 of the paper, the limit I_v → ∞)
    flywheel_inertia: float | None = None
    #: T, N·m, constant, on a flywheel that has an inertia; `motion.steady_state` finds the one that
    #: holds the mean speed
    motor_torque: float = 0.0

    def __post_init__(self) -> None:
        numbers = {name: value for name, value in vars(self).items() if name != "follower"}
        vars(self).update(floats_of(numbers, "flywheel_inertia"))
        if self.flywheel_inertia is None and self.motor_torque != 0.0:
            raise DynamicsError(
                f"motor_torque is {self.motor_torque!r}; allowed: 0 where the flywheel holds its "
                "speed, so give a flywheel_inertia"
            )

    @property
    def mobility(self) -> float:
        """1/I + 1/I_v, 1/(kg·m²): what a torque in the shaft accelerates."""
        flywheel = 0.0 if self.flywheel_inertia is None else 1.0 / self.flywheel_inertia
        return 1.0 / self.cam_inertia + flywheel

    @property
    def flywheel_acceleration(self) -> tuple[float, float, float]:
        """Weights of ψ, ψ̇ and 1 in θ̈_v, SI; zeros where the flywheel holds its speed."""
        if self.flywheel_inertia is None:
            return 0.0, 0.0, 0.0
        torques = self.shaft_stiffness, self.shaft_damping, self.motor_torque
        k, c, t = (torque / self.flywheel_inertia for torque in torques)
        return k, c, t


@dataclass(frozen=True)
class TorsionalState:
    """Twist and flywheel; lead and even turning apart, a heavy flywheel keeps all its digits."""

    twist: float  #: ψ = θ_c − θ_v, rad
    twist_rate: float  #: rad/s
    flywheel_angle: float  #: of even turning, which the drive sets, rad
    flywheel_speed: float  #: of even turning, rad/s
    lead: float = 0.0  #: by how much a flywheel of finite inertia is ahead of it, rad
    lead_rate: float = 0.0  #: rad/s

    @property
    def cam_angle(self) -> float:
        """θ_c, rad."""
        return self.flywheel_angle + self.lead + self.twist


#: Numbers that a state with a free flywheel remembers.
FREE = 4


def from_rig(rig: RigConfig) -> TorsionalParameters:
    """The numbers of a rig file; without ``flywheel_inertia`` the flywheel holds its speed."""
    if rig.shaft is None:
        raise rig.missing("shaft", "the model torsional", "take another model")
    flywheel = rig.shaft.flywheel_inertia
    found = TorsionalParameters(
        follower=FollowerParameters.from_rig(rig),
        cam_inertia=rig.shaft.cam_inertia.si,
        shaft_stiffness=rig.shaft.stiffness.si,
        shaft_damping=rig.shaft.damping.si,
        flywheel_inertia=None if flywheel is None else flywheel.si,
    )
    critical = 2.0 * float(np.sqrt(found.shaft_stiffness / found.mobility))
    if found.shaft_damping > MAX_DAMPING_RATIO * critical:
        raise DynamicsError(
            f"rig {rig.name}: shaft.damping: is {found.shaft_damping:.4g} N*m*s/rad, "
            f"{found.shaft_damping / critical:.3g} times what is critical for the cam on its "
            f"shaft; allowed: {MAX_DAMPING_RATIO:g} times, {MAX_DAMPING_RATIO * critical:.3g} "
            "N*m*s/rad; a shaft that is damped more is rigid, so take another model"
        )
    return found


def advance(
    law: Law,
    parameters: TorsionalParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
) -> tuple[FollowerState, Block]:
    """Take the cam on its shaft through the interval; None starts it untwisted at the speed.

    The interval's angle, speed and acceleration are the flywheel's; ``inner`` of the state is twist
    and rate. No substitute law for a ramp: the law is taken at the twisted angle.

    A flywheel with an inertia turns with the interval in the mean, driven by the mean of the load:
    see `begin`. ``inner`` then also has its lead and the lead's rate.
    """
    from cam_rig.dynamics.torsional.motion import solve  # with scipy.linalg, which few scenes need

    require_turning(interval.mean_speed)
    require_joined(state, interval)
    inner = () if state is None else state.inner
    last = state.cam_speed if state is not None else None
    driven, start = begin(law, parameters, inner, last, interval)
    # From time zero: a late start takes no digits from the samples' times.
    motion = solve(law, driven, start, 0.0, interval.duration, interval.acceleration)
    grid = interval.grid(sample_rate)
    rows = grid.open_rows()
    rows[1:5] = follower_rows(motion, np.minimum(grid.since_start(), motion.stop_time))
    x, v, _, force = follower_rows(motion, np.array([motion.stop_time]))[:, 0].tolist()
    end = FollowerState(x, v, force, in_contact=True, inner=inner_of(motion))
    return ended(end, interval), Block(interval, rows)


def begin(
    law: Law,
    parameters: TorsionalParameters,
    inner: tuple[float, ...],
    last_speed: float | None,
    interval: Interval,
) -> tuple[TorsionalParameters, TorsionalState]:
    """What an interval starts with: the parameters with the motor's torque, and the state.

    A flywheel with an inertia begins each speed in its steady state there, as a constant torque
    would take minutes to bring it there. Along a ramp the drive holds it, as in eq. 10. ``inner``
    is of the state before (`inner_of`), empty for none; ``last_speed`` where that ended, if known.
    """
    from cam_rig.dynamics.torsional.motion import solve, steady_state

    angle, speed = interval.angle, interval.speed
    if parameters.flywheel_inertia is None or interval.acceleration != 0.0:
        twist, rate = inner[:2] or (0.0, 0.0)
        held = replace(parameters, flywheel_inertia=None)
        return held, TorsionalState(twist, rate, angle, speed)
    driven, start = steady_state(law, parameters, speed)
    if len(inner) == FREE and (last_speed is None or same_speed(last_speed, speed)):
        twist, rate, lead, lead_rate = inner
        return driven, TorsionalState(twist, rate, angle, speed, lead, lead_rate)
    if angle / speed >= LEAST:  # the turn's steady state, as it passes here
        end = solve(law, driven, start, 0.0, angle / speed).end
        start = replace(end, flywheel_angle=angle)
    return driven, start


def inner_of(motion: TorsionalMotion) -> tuple[float, ...]:
    """What the model remembers of a motion's end: twist, rate; lead and its rate if it is free."""
    end = motion.end
    twist = (end.twist, end.twist_rate)
    free = motion.parameters.flywheel_inertia is not None
    return (*twist, end.lead, end.lead_rate) if free else twist


def follower_rows(motion: TorsionalMotion, times: FloatArray) -> FloatArray:
    """Lift, velocity, acceleration and contact force, ``(4, len(times))``, at times in s."""
    _, _, angle, speed, acceleration = motion.at(times)
    s = motion.law.motion_at(angle)
    follower = s[2] * speed**2 + s[1] * acceleration
    return np.stack([s[0], s[1] * speed, follower, motion.contact_force(times)])

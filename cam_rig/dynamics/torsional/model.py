"""The torsional model as a scene's model: blocks of the follower's motion at the twisted angle."""

from __future__ import annotations

from dataclasses import replace
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
from cam_rig.dynamics.parameters import LEAST, FollowerParameters, require_turning
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

if TYPE_CHECKING:
    from cam_rig.dynamics.torsional.motion import TorsionalMotion

#: Numbers that a state with a free flywheel remembers.
FREE = 4


def from_rig(rig: RigConfig) -> TorsionalParameters:
    """The numbers of a rig file; without ``flywheel_inertia`` the flywheel holds its speed."""
    if rig.shaft is None:
        raise rig.missing("shaft", "the model torsional", "take another model")
    flywheel = rig.shaft.flywheel_inertia
    return TorsionalParameters(
        follower=FollowerParameters.from_rig(rig),
        cam_inertia=rig.shaft.cam_inertia.si,
        shaft_stiffness=rig.shaft.stiffness.si,
        shaft_damping=rig.shaft.damping.si,
        flywheel_inertia=None if flywheel is None else flywheel.si,
    )


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

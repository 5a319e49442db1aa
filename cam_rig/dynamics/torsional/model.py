"""The torsional model as a scene's model: blocks of the follower's motion at the twisted angle."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.input_limits import require_turning
from cam_rig.dynamics.interval import Block, FollowerState, Interval, ended, require_joined
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.torsional.motion import TorsionalMotion, solve
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig


def from_rig(rig: RigConfig) -> TorsionalParameters:
    """The numbers of a rig file, whose flywheel holds its speed: the drive sets it.

    Raises
    ------
    ConfigError : the file has no shaft
    """
    if rig.shaft is None:
        raise ConfigError(f"rig {rig.name!r}: has no shaft; required by the model torsional")
    return TorsionalParameters(
        follower=FollowerParameters.from_rig(rig),
        cam_inertia=rig.shaft.cam_inertia.si,
        shaft_stiffness=rig.shaft.stiffness.si,
        shaft_damping=rig.shaft.damping.si,
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

    Raises
    ------
    DynamicsError : a cam that stands or turns back, or begins at another angle than ``state``
        ended
    """
    require_turning(interval.mean_speed)
    require_joined(state, interval)
    twist = (0.0, 0.0) if state is None else state.inner
    start = TorsionalState(twist[0], twist[1], interval.angle, interval.speed)
    # From time zero: a late start takes no digits from the samples' times.
    motion = solve(law, parameters, start, 0.0, interval.duration, interval.acceleration)
    grid = interval.grid(sample_rate)
    rows = grid.rows(follower_rows(motion, np.minimum(grid.since_start(), motion.stop_time)))
    x, v, _, force = follower_rows(motion, np.array([motion.stop_time]))[:, 0].tolist()
    inner = (motion.end.twist, motion.end.twist_rate)
    end = FollowerState(x, v, force, in_contact=True, inner=inner)
    return ended(end, interval), Block(interval, rows)


def follower_rows(motion: TorsionalMotion, times: FloatArray) -> FloatArray:
    """Lift, velocity, acceleration and contact force, ``(4, len(times))``, at times in s."""
    _, _, angle, speed, acceleration = motion.at(times)
    s = motion.law.motion_at(angle)
    follower = s[2] * speed**2 + s[1] * acceleration
    return np.stack([s[0], s[1] * speed, follower, motion.contact_force(times)])

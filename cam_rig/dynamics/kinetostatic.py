"""The follower that is always in contact: what a scene needs when nothing vibrates or jumps.

A law whose velocity jumps is refused: the contact force there is infinite, and no sample shows it.
"""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.contact_force import motion_weights
from cam_rig.dynamics.input_limits import require_turning
from cam_rig.dynamics.interval import Block, FollowerState, Interval
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.ramp import with_ramps
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law
from cam_rig.laws.sampling import sample


def state_at(law: Law, parameters: FollowerParameters, angle: float, speed: float) -> FollowerState:
    """The follower on the cam at ``angle`` (rad), turning at ``speed`` (rad/s)."""
    p, (s, slope, bend) = parameters, law.at(angle)
    v, a = slope * speed, bend * speed**2
    force = p.spring_stiffness * s + p.damping * v + p.mass * a + p.preload
    return FollowerState(s, v, force, in_contact=True)


def advance(
    law: Law,
    parameters: FollowerParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
) -> tuple[FollowerState, Block]:
    """Follow the law through the interval; the contact force may come out negative.

    ``state`` plays no part (there is no memory), it is taken so that models are alike.

    Raises
    ------
    DynamicsError : the law's velocity jumps
    """
    require_turning(interval.mean_speed)
    require_smooth(law)  # here, where it is not yet a ramp's substitute
    return _advance(law, parameters, state, interval, sample_rate)


@with_ramps
def _advance(
    law: Law,
    parameters: FollowerParameters,
    _: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    _step: float,
) -> tuple[FollowerState, Block]:
    end = interval.angle + interval.speed * interval.duration
    rows = contact_samples(law, parameters, interval, sample_rate)
    return state_at(law, parameters, end, interval.speed), Block(interval, rows)


def contact_samples(
    law: Law, parameters: FollowerParameters, interval: Interval, sample_rate: int
) -> FloatArray:
    """The samples ``(6, n)`` of a follower on the cam, rows as in `COLUMNS`, at one speed."""
    grid = interval.grid(sample_rate)
    rows = grid.open_rows()
    sample(
        law,
        interval.angle + interval.speed * grid.offset,
        interval.speed / sample_rate,
        grid.count,
        motion_weights(parameters, interval.speed),
        np.array([0.0, 0.0, 0.0, parameters.preload]),
        rows[1:5],
    )
    return rows


def shaft_torque(law: Law, parameters: FollowerParameters, angle: float, speed: float) -> float:
    """Torque in N·m that holds ``speed`` (rad/s) at ``angle`` (rad): F s' (eq. 8 of the paper).

    Power in is power out, T ω = F ṡ. F is the kinetostatic contact force, none where the cam
    would have to pull.
    """
    force = state_at(law, parameters, angle, speed).contact_force
    return max(force, 0.0) * law.at(angle)[1] + 0.0  # no negative zero: it is another message

"""The follower that never leaves the cam: what a scene needs when nothing vibrates or jumps."""

from __future__ import annotations

import numpy as np

from cam_rig.dynamics.block import Block, FollowerState, Interval
from cam_rig.dynamics.contact import force_weights, motion_weights
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.laws import Law
from cam_rig.laws.sampling import sample


def state_at(law: Law, parameters: FollowerParameters, angle: float, speed: float) -> FollowerState:
    """The follower on the cam at ``angle`` (rad), turning at ``speed`` (rad/s)."""
    motion = np.array([float(law(angle, order)) for order in range(3)])
    force = float(force_weights(parameters, speed) @ motion) + parameters.preload
    return FollowerState(float(motion[0]), float(motion[1] * speed), force, in_contact=True)


def advance(
    law: Law,
    parameters: FollowerParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
) -> tuple[FollowerState, Block]:
    """Follow the law through the interval; the contact force may come out negative.

    ``state`` plays no part (there is no memory), it is taken so that models are alike.
    """
    law.require_velocity()
    grid = interval.grid(sample_rate)
    rows = np.zeros((6, grid.count))
    rows[0] = (grid.first + np.arange(grid.count)) / sample_rate
    rows[1:5] = sample(
        law,
        interval.angle + interval.speed * grid.offset,
        interval.speed / sample_rate,
        grid.count,
        motion_weights(parameters, interval.speed),
        np.array([0.0, 0.0, 0.0, parameters.preload]),
    )
    end = interval.angle + interval.speed * interval.duration
    return state_at(law, parameters, end, interval.speed), Block(interval, rows)

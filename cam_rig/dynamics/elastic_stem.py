"""Residual vibration: the follower as a mass on its elastic stem (eq. 5 of the paper).

m ẍ + c ẋ + (k_spring + k_stem) x = k_stem s(θ): one degree of freedom, always in contact.

The model's state is the vibration r = x − α s about the static share α = k_stem/(k_spring + k_stem)
of the lift: m r̈ + c ṙ + (k_spring + k_stem) r = −α (m s̈ + c ṡ). In x itself the rounding of the
lift, times a stem of 3.3e8 N/m, would drown acceleration and force.

Where the law's velocity jumps by Δs' the stem only bends: x and ẋ go on, so ṙ jumps by −α ω Δs'.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.dynamics.interval import Block, FollowerState, Interval
from cam_rig.dynamics.linear.response import LinearResponse, Outputs, end_of, sample
from cam_rig.dynamics.parameters import FollowerParameters, state_of
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.laws import Law


@lru_cache(maxsize=64)
def response(law: Law, parameters: FollowerParameters, speed: float) -> LinearResponse:
    """The model at one speed (rad/s); its state is (r, ṙ) in m and m/s."""
    p = parameters
    total = p.spring_stiffness + p.stem
    share, damping = p.stem / total, p.damping / p.mass
    matrix = np.array([[0.0, 1.0], [-total / p.mass, -damping]])
    drive = np.array([[0.0, 0.0, 0.0], [0.0, -share * damping, -share]])
    return LinearResponse(law, speed, matrix, drive, np.zeros(2), jumps_act=True)


@lru_cache(maxsize=64)
def outputs(parameters: FollowerParameters) -> Outputs:
    """Rows displacement x, velocity, acceleration and contact force (stem and preload)."""
    p = parameters
    total = p.spring_stiffness + p.stem
    share, damping = p.stem / total, p.damping / p.mass
    state = np.array([[1.0, 0.0], [0.0, 1.0], [-total / p.mass, -damping], [-p.stem, 0.0]])
    law = np.array(
        [
            [share, 0.0, 0.0],
            [0.0, share, 0.0],
            [0.0, -share * damping, 0.0],
            [p.stem * p.spring_stiffness / total, 0.0, 0.0],
        ]
    )
    return Outputs(state, law, np.array([0.0, 0.0, 0.0, p.preload]))


@with_ramps
def advance(
    law: Law,
    parameters: FollowerParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    step: float,
) -> tuple[FollowerState, Block]:
    """Take the follower through the interval; where ṡ gains ``step`` m/s, x and ẋ go on."""
    model = response(law, parameters, interval.speed)
    start = np.zeros(2) if state is None else state_of(state.inner, 2)
    if step != 0.0:
        start = start + model.drive[:, 2] * step
    grid = interval.grid(sample_rate)
    out, apart = outputs(parameters), 1.0 / sample_rate
    rows = grid.open_rows()
    sample(model, start, interval.angle, grid.offset, apart, grid.count, out, rows[1:5])
    end, shown = end_of(model, start, interval.angle, interval.duration, out)
    x, v, _, force = shown.tolist()
    inner = tuple(end.tolist())
    return FollowerState(x, v, force, in_contact=True, inner=inner), Block(interval, rows)

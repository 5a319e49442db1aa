"""Model `elastic_stem`: residual vibration of a mass on its stem (paper, eq. 5).

The model has one degree of freedom and is always in contact:

    m ẍ + c ẋ + (k_spring + k_stem) x = k_stem s(θ)

Its state is the vibration r = x − α s about the static part α = k_stem/(k_spring + k_stem) of the
lift:

    m r̈ + c ṙ + (k_spring + k_stem) r = −α (m s̈ + c ṡ)

If the state were x, the rounding of the lift times a stem stiffness of 3.3e8 N/m would exceed the
vibration in acceleration and force.

A velocity jump Δs' of the law changes neither x nor ẋ, so ṙ jumps by −α ω Δs'.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.dynamics.interval import Block, FollowerState, Interval
from cam_rig.dynamics.linear.response import LinearResponse, Outputs, compute_end, sample
from cam_rig.dynamics.parameters import FollowerParameters, check_state
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.laws import Law


@lru_cache(maxsize=64)
def response(law: Law, parameters: FollowerParameters, speed: float) -> LinearResponse:
    """Return the linear model of the mass on its stem at a cam speed (rad/s).

    Its state is (r, ṙ) in m and m/s, the vibration about the static part of the lift.
    """
    p = parameters
    total = p.spring_stiffness + p.stem
    share, damping = p.stem / total, p.damping / p.mass
    matrix = np.array([[0.0, 1.0], [-total / p.mass, -damping]])
    drive = np.array([[0.0, 0.0, 0.0], [0.0, -share * damping, -share]])
    return LinearResponse(law, speed, matrix, drive, np.zeros(2), jumps_act=True)


@lru_cache(maxsize=64)
def outputs(parameters: FollowerParameters) -> Outputs:
    """Return the outputs of the linear model: x, ẋ, ẍ and the contact force, SI units.

    The contact force is the force of the stem plus the preload.
    """
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
    """Return the state at the end of an interval, and its samples.

    ``state`` is None at the start of a run. ``sample_rate`` is in Hz. ``step`` is an abrupt change
    of the cam's velocity ṡ (m/s) just before the interval. It does not change the displacement x
    and the velocity ẋ of the mass, but the vibration (r, ṙ) relative to the cam.
    """
    model = response(law, parameters, interval.speed)
    start = np.zeros(2) if state is None else check_state(state.inner, 2)
    if step != 0.0:
        start = start + model.drive[:, 2] * step
    grid = interval.grid(sample_rate)
    out, period = outputs(parameters), 1.0 / sample_rate
    rows = grid.new_rows()
    sample(model, start, interval.angle, grid.offset, period, grid.count, out, rows[1:5])
    end, end_outputs = compute_end(model, start, interval.angle, interval.duration, out)
    x, v, _, force = end_outputs.tolist()
    inner = tuple(end.tolist())
    return FollowerState(x, v, force, in_contact=True, inner=inner), Block(interval, rows)

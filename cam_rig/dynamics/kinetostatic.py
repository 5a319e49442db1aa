"""The follower that is always in contact: what a scene needs when nothing vibrates or jumps.

A law whose velocity jumps is refused: the contact force there is infinite, and no sample shows it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.dynamics.interval import Block, FollowerState, Interval
from cam_rig.dynamics.parameters import FollowerParameters, require_turning
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import extremes
from cam_rig.laws.sampling import sample
from cam_rig.units import TURN, FloatArray

# Contact force of a follower that sits on the cam, and where it would have to pull.

#: A force is known to so many rounding errors of its parts.
ROUNDING_ERRORS = 16.0


def force_weights(parameters: FollowerParameters, speed: float) -> FloatArray:
    """Weights of s, s', s'' in the contact force at ``speed`` (rad/s)."""
    p = parameters
    return np.array([p.spring_stiffness, p.damping * speed, p.mass * speed**2])


def motion_weights(parameters: FollowerParameters, speed: float) -> FloatArray:
    """``(4, 3)``: weights of s, s', s'' in lift, velocity, acceleration, contact force."""
    kinematic = np.diag([1.0, speed, speed**2])
    return np.vstack([kinematic, force_weights(parameters, speed)])


def force_ordinates(law: Law, parameters: FollowerParameters, speed: float) -> FloatArray:
    """``(p + 1, n)`` Bernstein ordinates of the contact force in N, piece by piece."""
    weighted = np.tensordot(force_weights(parameters, speed), law.motion, axes=1)
    return np.asarray(weighted + parameters.preload)


def force_extremes(law: Law, parameters: FollowerParameters, speed: float) -> tuple[float, float]:
    """Least and largest contact force (N) of a turn at ``speed`` (rad/s), on the cam throughout."""
    force = Law(law.name, law.breaks, force_ordinates(law, parameters, speed))
    least, largest = extremes(force, 0)
    return least.value, largest.value


def force_rounding(law: Law, parameters: FollowerParameters, speed: float) -> float:
    """Bound (N) on the error of the contact force at ``speed`` (rad/s)."""
    size = force_weights(parameters, speed) @ np.array(law.bounds) + parameters.preload
    return ROUNDING_ERRORS * bernstein.EPS * float(size)


@lru_cache(maxsize=512)
def loss_intervals(
    law: Law, parameters: FollowerParameters, speed: float
) -> tuple[tuple[float, float], ...]:
    """Cam angles in [0, 2π] between which the cam would have to pull: contact is lost there."""
    ordinates = force_ordinates(law, parameters, speed)
    found: list[tuple[float, float]] = []
    for i, span in enumerate(law.spans):
        for start, stop in bernstein.negative_intervals(ordinates[:, i]):
            low, high = (float(law.breaks[i] + u * span) for u in (start, stop))
            if found and low <= found[-1][1] + 1e-15 * TURN:
                found[-1] = (found[-1][0], high)
            else:
                found.append((low, high))
    return tuple(found)


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

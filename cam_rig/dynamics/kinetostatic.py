"""The follower that is always in contact: what a scene needs when nothing vibrates or jumps.

A law whose velocity jumps is refused: the contact force there is infinite, and no sample shows it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.dynamics.interval import Block, FollowerState, Interval
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import extremes
from cam_rig.laws.sampling import sample
from cam_rig.units import TURN, FloatArray

#: A force is known to so many rounding errors of its parts.
ROUNDING_ERRORS = 16.0


def force_weights(parameters: FollowerParameters, speed: float) -> FloatArray:
    """Weights of s, s', s'' in the contact force at ``speed`` (rad/s)."""
    p = parameters
    return np.array([p.spring_stiffness, p.damping * speed, p.mass * speed**2])


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
    for i in np.flatnonzero((ordinates < 0.0).any(axis=0)).tolist():  # none else falls below
        for start, stop in bernstein.negative_intervals(ordinates[:, i]):
            low, high = (float(law.breaks[i] + u * law.spans[i]) for u in (start, stop))
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


def _at_one_speed(
    law: Law,
    parameters: FollowerParameters,
    _: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    _step: float,
) -> tuple[FollowerState, Block]:
    """Follow the law through the interval, without memory; the contact force may be negative."""
    end = interval.angle + interval.speed * interval.duration
    rows = contact_samples(law, parameters, interval, sample_rate)
    return state_at(law, parameters, end, interval.speed), Block(interval, rows)


advance = with_ramps(_at_one_speed, require_smooth)


def contact_samples(
    law: Law, parameters: FollowerParameters, interval: Interval, sample_rate: int
) -> FloatArray:
    """The samples ``(6, n)`` of a follower on the cam, rows as in `COLUMNS`, at one speed."""
    grid, speed = interval.grid(sample_rate), interval.speed
    rows, kinematic = grid.open_rows(), np.diag([1.0, speed, speed**2])
    sample(
        law,
        interval.angle + speed * grid.offset,
        speed / sample_rate,
        grid.count,
        np.vstack([kinematic, force_weights(parameters, speed)]),
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

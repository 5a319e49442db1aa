"""Model `kinetostatic`: a rigid follower that is always in contact.

The contact force is F = m s̈ + c ṡ + k s + preload. It suffices for a scene without vibration and
without loss of contact. A law with a velocity jump is rejected, because the contact force at the
jump is infinite and no sample contains it.
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

#: Upper bound of the rounding error of a contact force, as a multiple of the float epsilon of the
#: sum of its largest terms.
ROUNDING_ERRORS = 16.0


def force_weights(parameters: FollowerParameters, speed: float) -> FloatArray:
    """Return the weights of s, s' and s'' in the contact force at a cam speed ω (rad/s).

    They are k (N/m), c ω (N·rad/m) and m ω² (N·rad²/m), shape (3,).
    """
    p = parameters
    return np.array([p.spring_stiffness, p.damping * speed, p.mass * speed**2])


def force_ordinates(law: Law, parameters: FollowerParameters, speed: float) -> FloatArray:
    """Return the contact force (N) over a turn as Bernstein ordinates, ``(p + 1, n)``.

    p is the degree of the law and n its number of polynomial pieces. ``speed`` is the cam speed in
    rad/s. The force may be negative, because the follower is kept on the cam.
    """
    weighted = np.tensordot(force_weights(parameters, speed), law.motion, axes=1)
    return np.asarray(weighted + parameters.preload)


def force_extremes(law: Law, parameters: FollowerParameters, speed: float) -> tuple[float, float]:
    """Return the smallest and largest contact force (N) of a turn at a cam speed (rad/s).

    The model keeps the follower on the cam, so the smallest force may be negative.
    """
    force = Law(law.name, law.breaks, force_ordinates(law, parameters, speed))
    minimum, maximum = extremes(force, 0)
    return minimum.value, maximum.value


def force_rounding(law: Law, parameters: FollowerParameters, speed: float) -> float:
    """Return an upper bound of the contact force's rounding error (N) at a cam speed.

    ``speed`` is in rad/s. The bound is valid at all cam angles.
    """
    size = force_weights(parameters, speed) @ np.array(law.bounds) + parameters.preload
    return ROUNDING_ERRORS * bernstein.EPS * float(size)


@lru_cache(maxsize=512)
def loss_intervals(
    law: Law, parameters: FollowerParameters, speed: float
) -> tuple[tuple[float, float], ...]:
    """Return the ranges of the cam angle in which the contact force is negative.

    Each range is (start, end) in rad, within [0, 2π]. A real follower loses contact there, because
    the cam cannot pull. ``speed`` is the cam speed in rad/s.
    """
    ordinates = force_ordinates(law, parameters, speed)
    losses: list[tuple[float, float]] = []
    # A polynomial without negative ordinates is nowhere negative.
    for i in np.flatnonzero((ordinates < 0.0).any(axis=0)).tolist():
        for start, stop in bernstein.negative_intervals(ordinates[:, i]):
            low, high = (float(law.breaks[i] + u * law.spans[i]) for u in (start, stop))
            if losses and low <= losses[-1][1] + 1e-15 * TURN:
                losses[-1] = (losses[-1][0], high)
            else:
                losses.append((low, high))
    return tuple(losses)


def state_at(law: Law, parameters: FollowerParameters, angle: float, speed: float) -> FollowerState:
    """Return the state of a rigid follower that is on the cam at a cam angle.

    ``angle`` is in rad, and ``speed`` is the constant cam speed in rad/s.
    """
    p, (s, slope, curvature) = parameters, law.at(angle)
    v, a = slope * speed, curvature * speed**2
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
    """Return the state at the end of an interval of constant speed, and its samples.

    ``sample_rate`` is in Hz. The previous state is not used, because the motion of the follower is
    that of the cam. The contact force may be negative.
    """
    end = interval.angle + interval.speed * interval.duration
    rows = contact_samples(law, parameters, interval, sample_rate)
    return state_at(law, parameters, end, interval.speed), Block(interval, rows)


advance = with_ramps(_at_one_speed, require_smooth)


def contact_samples(
    law: Law, parameters: FollowerParameters, interval: Interval, sample_rate: int
) -> FloatArray:
    """Return the samples of a rigid follower on the cam at constant speed, ``(6, n)``.

    The rows are in the order of `cam_rig.dynamics.interval.COLUMNS`. ``sample_rate`` is in Hz.
    """
    grid, speed = interval.grid(sample_rate), interval.speed
    rows, kinematic = grid.new_rows(), np.diag([1.0, speed, speed**2])
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
    """Return the shaft torque (N·m) at a cam angle (rad) and a constant speed (rad/s).

    It is T = F s' (eq. 8 of the paper), from the balance of power T ω = F ṡ. F is the kinetostatic
    contact force, or 0 if the force is negative.
    """
    force = state_at(law, parameters, angle, speed).contact_force
    return max(force, 0.0) * law.at(angle)[1] + 0.0  # converts −0 to 0, so that messages are equal

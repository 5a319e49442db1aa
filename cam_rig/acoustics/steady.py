"""The steady sound of a cam whose follower stays on it: exact, without samples or settling."""

from __future__ import annotations

import numpy as np

from cam_rig.acoustics.radiation import RadiationParameters
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.contact_force import force_ordinates
from cam_rig.dynamics.linear.propagator import periodic_state, piece
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein

#: Gauss-Legendre nodes a sub-interval; each is short against the structure's time constant.
NODES = 12


def mean_square_rate(
    law: Law, follower: FollowerParameters, corner_rate: float, speed: float
) -> float:
    """⟨(ω_c (F − q))²⟩ over one turn at ``speed`` (rad/s), in (N/s)².

    The structure's periodic state is one linear solve on the exact propagator; only the mean
    is a quadrature, of a smooth function and at rounding level.

    Raises
    ------
    DynamicsError : the law's velocity jumps
    """
    require_smooth(law)
    forces = force_ordinates(law, follower, speed)
    matrix = np.array([[-corner_rate]])
    durations = law.spans / speed
    pieces = [
        piece(matrix, corner_rate * forces[None, :, i], float(duration))
        for i, duration in enumerate(durations)
    ]
    state = periodic_state(pieces)
    total = 0.0
    for i, part in enumerate(pieces):
        times, weights = _quadrature(part.duration, corner_rate)
        force = bernstein.evaluate(forces[:, i], times / part.duration)
        rate = corner_rate * (force - part.at(state, times)[0])
        total += float(weights @ rate**2)
        state = part.end(state)
    return total / float(durations.sum())


def _quadrature(duration: float, rate: float) -> tuple[FloatArray, FloatArray]:
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    count = max(4, int(np.ceil(rate * duration)))
    width = duration / count
    times = (np.arange(count)[:, None] + 0.5 * (nodes + 1.0)) * width
    return times.ravel(), np.tile(0.5 * width * weights, count)


def steady_power(
    law: Law, follower: FollowerParameters, radiation: RadiationParameters, speed: float
) -> float:
    """Mean square sound pressure (Pa²) of contact and background at ``speed`` (rad/s)."""
    rate = mean_square_rate(law, follower, radiation.corner_rate, speed)
    return radiation.background_power(speed) + radiation.gain**2 * rate

"""Contact force of a follower that sits on the cam, and where it would have to pull.

F = m s̈ + c ṡ + k s + preload with s̈ = ω² s'' and ṡ = ω s' (eq. 9 of the paper, signs of the
free-body diagram): at one speed a piecewise polynomial of θ, like the law.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.laws import Law, bernstein
from cam_rig.laws.peaks import extremes
from cam_rig.units import TURN

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

"""The jump speed of a rigid follower: what the slopes of a law allow, without any vibration."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein

#: Points of a piece, and of the second look around the lowest.
POINTS = 2049


def rigid_jump_speed(law: Law, follower: FollowerParameters) -> float:
    """Lowest speed (rad/s) at which m s'' Ω² + c s' Ω + k s + preload is zero at some angle.

    Infinite for a law that nowhere decelerates.
    """
    require_smooth(law, "")
    best, where = math.inf, (0, 0.0)
    u = np.linspace(0.0, 1.0, POINTS)
    for piece in range(law.spans.size):
        speeds = _speeds(law, follower, piece, u)
        at = int(np.argmin(speeds))
        if speeds[at] < best:
            best, where = float(speeds[at]), (piece, float(u[at]))
    if not math.isfinite(best):
        return best
    step = 1.0 / (POINTS - 1)
    near = np.clip(np.linspace(where[1] - step, where[1] + step, POINTS), 0.0, 1.0)
    return float(_speeds(law, follower, where[0], near).min())


def _speeds(law: Law, follower: FollowerParameters, piece: int, u: FloatArray) -> FloatArray:
    """The least positive root at each point of a piece, infinite where there is none."""
    s, slope, bend = bernstein.evaluate(law.motion[:, :, piece].T, u).T
    a, b = follower.mass * bend, follower.damping * slope
    c = follower.spring_stiffness * s + follower.preload
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b**2 - 4.0 * a * c)
        found = 2.0 * c / np.where(-b + root > 0.0, -b + root, np.nan)
    return np.where(np.isfinite(found) & (found > 0.0), found, np.inf)

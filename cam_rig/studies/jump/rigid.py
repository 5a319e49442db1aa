"""The jump speed of a rigid follower: what the slopes of a law allow, without any vibration."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN

#: Points of a piece, and of the second look around the lowest.
POINTS = 2049


def rigid_jump_speed(law: Law, follower: FollowerParameters) -> float:
    """Lowest speed (rad/s) at which m s'' Ω² + c s' Ω + k s + preload is zero at some angle.

    Infinite for a law that nowhere decelerates.
    """
    return rigid_jump(law, follower)[0]


def rigid_jump(law: Law, follower: FollowerParameters) -> tuple[float, float]:
    """The same with the cam angle (rad) at which contact is lost; NaN where it nowhere is."""
    require_smooth(law, "")
    best, where = math.inf, (0, 0.0)
    u = np.linspace(0.0, 1.0, POINTS)
    for piece in range(law.spans.size):
        speeds = _speeds(law, follower, piece, u)
        at = int(np.argmin(speeds))
        if speeds[at] < best:
            best, where = float(speeds[at]), (piece, float(u[at]))
    if not math.isfinite(best):
        return best, math.nan
    step = 1.0 / (POINTS - 1)
    near = np.clip(np.linspace(where[1] - step, where[1] + step, POINTS), 0.0, 1.0)
    speeds = _speeds(law, follower, where[0], near)
    at = int(np.argmin(speeds))
    angle = law.breaks[where[0]] + near[at] * law.spans[where[0]]
    return float(speeds[at]), float(angle % TURN)


def rigid_least(law: Law, follower: FollowerParameters, speeds: FloatArray) -> FloatArray:
    """The least contact force (N) of a turn at speeds (rad/s), ``(n,)``, on `POINTS` a piece."""
    u = np.linspace(0.0, 1.0, POINTS)
    least = np.full(speeds.size, np.inf)
    for piece in range(law.spans.size):
        s, slope, bend = bernstein.evaluate(law.motion[:, :, piece].T, u).T
        still = follower.spring_stiffness * s + follower.preload
        for i, speed in enumerate(speeds.tolist()):
            force = (follower.mass * bend * speed + follower.damping * slope) * speed + still
            least[i] = min(least[i], float(force.min()))
    return least


def _speeds(law: Law, follower: FollowerParameters, piece: int, u: FloatArray) -> FloatArray:
    """The least positive root at each point of a piece, infinite where there is none."""
    s, slope, bend = bernstein.evaluate(law.motion[:, :, piece].T, u).T
    a, b = follower.mass * bend, follower.damping * slope
    c = follower.spring_stiffness * s + follower.preload
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b**2 - 4.0 * a * c)
        found = 2.0 * c / np.where(-b + root > 0.0, -b + root, np.nan)
    return np.where(np.isfinite(found) & (found > 0.0), found, np.inf)

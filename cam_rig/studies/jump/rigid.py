"""The jump speed of a rigid follower: what the slopes of a law allow, without any vibration."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN

#: A piece is halved no more often: 2^-40 of it is rounding.
HALVINGS = 40
#: Parts that may lower the speed, at most: more are a force of zero all along.
MAX_PARTS = 1 << 16
#: A force below zero by so much of its parts is zero.
ROUNDING = 1e-14
#: Points of a piece for the least force.
POINTS = 2049


def rigid_jump_speed(law: Law, follower: FollowerParameters) -> float:
    """Lowest speed (rad/s) at which m s'' Ω² + c s' Ω + k s + preload is zero at some angle.

    Infinite for a law that nowhere decelerates.
    """
    return rigid_jump(law, follower)[0]


def rigid_jump(law: Law, follower: FollowerParameters) -> tuple[float, float]:
    """The same with the cam angle (rad) at which contact is lost; NaN where it nowhere is.

    All pieces are bounded at once. What keeps contact up to the lowest speed found so far is left,
    the rest is halved, until rounding decides.
    """
    require_smooth(law, "")
    best, where = math.inf, math.nan
    parts = law.motion.transpose(1, 2, 0)
    begin, width = law.breaks[:-1], law.spans
    for _ in range(HALVINGS):
        speeds = _speeds(follower, np.concatenate([parts[0], parts[-1]]))
        at = int(np.argmin(speeds))
        if speeds[at] < best:
            best, where = float(speeds[at]), float(np.concatenate([begin, begin + width])[at])
        low = may_pull(follower, parts, best)
        if not 0 < low.sum() < MAX_PARTS:
            break
        left, right = bernstein.split(parts[:, low].reshape(len(parts), -1), 0.5)
        parts = np.concatenate([x.reshape(len(parts), -1, 3) for x in (left, right)], axis=1)
        begin, width = begin[low], 0.5 * width[low]
        begin, width = np.concatenate([begin, begin + width]), np.concatenate([width, width])
    return best, where % TURN


def may_pull(follower: FollowerParameters, parts: FloatArray, speed: float) -> NDArray[np.bool_]:
    """Whether the force may be below zero in parts ``(p + 1, n, 3)`` at some speed up to one.

    Each ordinate a Ω² + b Ω + c is taken at the speed where it is least; the force is no lower
    than the lowest of them.
    """
    a, b, c = _quadratic(follower, parts)
    if not math.isfinite(speed):
        return np.asarray(((a < 0.0) | (b < 0.0) | (c < 0.0)).any(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        lowest = np.where(a > 0.0, np.clip(-0.5 * b / a, 0.0, speed), speed)
    least = np.minimum((a * lowest + b) * lowest, (a * speed + b) * speed) + c
    size = (np.abs(a) * speed + np.abs(b)) * speed + np.abs(c)
    return np.asarray((least < -ROUNDING * size).any(axis=0))


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


def _quadratic(
    follower: FollowerParameters, motion: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """a, b, c of the force a Ω² + b Ω + c where s, s', s'' are ``(..., 3)``."""
    s, slope, bend = np.moveaxis(motion, -1, 0)
    c = follower.spring_stiffness * s + follower.preload
    return follower.mass * bend, follower.damping * slope, c


def _speeds(follower: FollowerParameters, motion: FloatArray) -> FloatArray:
    """The least positive root at points ``(n, 3)``, infinite where there is none."""
    a, b, c = _quadratic(follower, motion)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b**2 - 4.0 * a * c)
        found = 2.0 * c / np.where(-b + root > 0.0, -b + root, np.nan)
    return np.where(np.isfinite(found) & (found > 0.0), found, np.inf)

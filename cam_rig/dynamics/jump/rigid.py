"""The lowest speed at which the force m s'' Ω² + c s' Ω + k s + preload of a rigid mass is zero."""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.modal.motion import LawSeries
from cam_rig.laws.polynomials import halve
from cam_rig.laws.rows import Rows, borrowed, zeros

#: A part is halved no more often: 2^-40 of a piece is rounding.
HALVINGS = 40
#: Parts that may lower the speed, at most: more are a force of zero all along.
MAX_PARTS = 1 << 16
#: A force below zero by so much of its parts is zero.
ROUNDING = 1e-14


class RigidMass(NamedTuple):
    """A follower without a stem."""

    mass: float  #: kg
    damping: float  #: N·s/m
    stiffness: float  #: N/m
    preload: float  #: N


def rigid_zero(law: LawSeries, follower: RigidMass) -> tuple[float, float]:
    """Speed (rad/s) and cam angle (rad) of the zero; infinite and NaN where there is none.

    What keeps contact up to the lowest speed found so far is left, the rest is halved, until
    rounding decides.
    """
    law, count, size = borrowed(law), len(law.alike), len(law.largest) - 1
    ordinates = law.derivatives
    best, where = math.inf, math.nan
    for i in range(count):
        for j, angle in ((0, law.breaks[i]), (size - 1, law.breaks[i + 1])):
            s, slope, bend = ordinates[j][0][i], ordinates[j][1][i], ordinates[j][2][i]
            speed = _zero(follower, s, slope, bend)
            if speed < best:
                best, where = speed, angle
    parts, looked = zeros((3 * (HALVINGS + 2), size)), 0
    widths, lows = zeros(HALVINGS + 2), zeros(HALVINGS + 2)
    for i in range(count):
        for k in range(3):
            for j in range(size):
                parts[k][j] = ordinates[j][k][i]
        lows[0], widths[0], top = law.breaks[i], law.breaks[i + 1] - law.breaks[i], 0
        least = math.ldexp(widths[0], -HALVINGS)
        while top >= 0 and looked < MAX_PARTS:
            if widths[top] <= least or not _may_pull(follower, parts, 3 * top, size, best):
                top -= 1
                continue
            looked += 1
            for k in range(3):
                halve(parts[3 * top + k], parts[3 * top + 3 + k])
            widths[top] *= 0.5
            widths[top + 1], lows[top + 1] = widths[top], lows[top]
            lows[top] += widths[top]
            speed = _zero(follower, parts[3 * top][0], parts[3 * top + 1][0], parts[3 * top + 2][0])
            if speed < best:
                best, where = speed, lows[top]
            top += 1
    return best, where


def _zero(follower: RigidMass, s: float, slope: float, bend: float) -> float:
    """The least positive root in Ω at a cam angle, infinite where there is none."""
    a, b, c = _terms(follower, s, slope, bend)
    square = b * b - 4.0 * a * c
    if square < 0.0 or c <= 0.0:
        return math.inf
    below = math.sqrt(square) - b
    return 2.0 * c / below if below > 0.0 else math.inf


def _terms(follower: RigidMass, s: float, slope: float, bend: float) -> tuple[float, float, float]:
    """a, b, c of the force a Ω² + b Ω + c."""
    still = follower.stiffness * s + follower.preload
    return follower.mass * bend, follower.damping * slope, still


def _may_pull(follower: RigidMass, parts: Rows, first: int, size: int, speed: float) -> bool:
    """Whether the force may be below zero in a part at some speed up to one.

    Each ordinate a Ω² + b Ω + c is taken at the speed where it is least; the force is no lower
    than the lowest of them.
    """
    for j in range(size):
        a, b, c = _terms(follower, parts[first][j], parts[first + 1][j], parts[first + 2][j])
        if speed == math.inf:
            if a < 0.0 or b < 0.0 or c < 0.0:
                return True
            continue
        least = (a * speed + b) * speed
        if a > 0.0:
            lowest = min(max(-0.5 * b / a, 0.0), speed)
            least = min(least, (a * lowest + b) * lowest)
        if least + c < -ROUNDING * ((abs(a) * speed + abs(b)) * speed + abs(c)):
            return True
    return False

"""Search for the lowest cam speed at which the contact force of a rigid mass is zero.

The force is m s'' Ω² + c s' Ω + k s + preload at the cam speed Ω. The search is branch and bound
over parts of the law's polynomial pieces. A part is discarded if (37) of docs/proofs.md proves that
the force in it is not negative up to the lowest speed found so far. Other parts are halved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.modal.motion import LawSeries
from cam_rig.laws.polynomials import halve
from cam_rig.laws.vectors import Matrix, without_refcount

#: Largest number of times that a polynomial piece of the law is halved in the search. A part of
#: 2⁻⁴⁰ of a piece is within rounding.
MAX_HALVINGS = 40
#: Largest number of parts of polynomial pieces that one search halves. A search needs more only if
#: the force is zero over a range of angles.
MAX_PARTS = 1 << 16
#: Largest negative contact force that counts as zero (rounding), relative to the sum of the
#: absolute values of its terms.
FORCE_RTOL = 1e-14


class RigidMass(NamedTuple):
    """Follower of one rigid mass: the coefficients of its contact force."""

    mass: float  #: mass of the follower, kg
    damping: float  #: damping of the follower, N·s/m
    stiffness: float  #: stiffness of the closing spring, N/m
    preload: float  #: preload of the closing spring, N


class RigidZero(NamedTuple):
    """Lowest cam speed at which the contact force is zero, and the cam angle there."""

    speed: float  #: cam speed, rad/s, infinite if the force is positive at every speed
    angle: float  #: cam angle, rad, NaN if the force is positive at every speed


def find_rigid_zero(law: LawSeries, follower: RigidMass) -> RigidZero:
    """Find the lowest cam speed at which the contact force is zero, and its angle.

    Invariant: in each discarded part of the law the force is not negative, up to rounding, at all
    speeds below ``zero.speed``.
    """
    law, count, size = without_refcount(law), len(law.span_index), len(law.max_derivatives) - 1
    ordinates, zero = law.derivatives, RigidZero(math.inf, math.nan)
    for i in range(count):
        for j, angle in ((0, law.breaks[i]), (size - 1, law.breaks[i + 1])):
            s, slope, curvature = ordinates[j][0][i], ordinates[j][1][i], ordinates[j][2][i]
            speed = _zero_at(follower, s, slope, curvature)
            if speed < zero.speed:
                zero = RigidZero(speed, angle)
    # Stack of the parts that are not yet searched: their ordinates of s, s' and s''.
    parts, halved = np.zeros((MAX_HALVINGS + 2, 3, size)), 0
    widths, starts = np.zeros(MAX_HALVINGS + 2), np.zeros(MAX_HALVINGS + 2)
    for i in range(count):
        for k in range(3):
            for j in range(size):
                parts[0][k][j] = ordinates[j][k][i]
        starts[0], widths[0], top = law.breaks[i], law.breaks[i + 1] - law.breaks[i], 0
        min_width = math.ldexp(widths[0], -MAX_HALVINGS)
        while top >= 0 and halved < MAX_PARTS:
            right, left = parts[top], parts[top + 1]
            if widths[top] <= min_width or not _may_pull(follower, right, zero.speed):
                top -= 1
                continue
            halved += 1
            for k in range(3):
                halve(right[k], left[k])
            widths[top] *= 0.5
            widths[top + 1], starts[top + 1] = widths[top], starts[top]
            starts[top] += widths[top]
            speed = _zero_at(follower, right[0][0], right[1][0], right[2][0])
            if speed < zero.speed:
                zero = RigidZero(speed, starts[top])
            top += 1
    return zero


def _zero_at(follower: RigidMass, s: float, slope: float, curvature: float) -> float:
    """Return the lowest cam speed (rad/s) with a contact force of zero at one angle.

    The arguments are s (m), ``slope`` s' (m/rad) and ``curvature`` s'' (m/rad²) of the law at this
    angle. The result is infinite if there is no such speed.
    """
    a, b, c = _coefficients(follower, s, slope, curvature)
    discriminant = b * b - 4.0 * a * c
    if discriminant < 0.0 or c <= 0.0:
        return math.inf
    divisor = math.sqrt(discriminant) - b
    return 2.0 * c / divisor if divisor > 0.0 else math.inf


def _coefficients(
    follower: RigidMass, s: float, slope: float, curvature: float
) -> tuple[float, float, float]:
    """Return the coefficients a, b and c of the contact force a Ω² + b Ω + c (N).

    The arguments are s (m), ``slope`` s' (m/rad) and ``curvature`` s'' (m/rad²) at one cam angle,
    and Ω is the cam speed.
    """
    static = follower.stiffness * s + follower.preload
    return follower.mass * curvature, follower.damping * slope, static


def _may_pull(follower: RigidMass, part: Matrix, speed: float) -> bool:
    """Return True if the contact force in a part of the law may be negative.

    All cam speeds from 0 to ``speed`` (rad/s) are considered. ``part`` contains the Bernstein
    ordinates of s, s' and s'', ``(3, p + 1)``. The result is False if (37) of docs/proofs.md proves
    that the force is not negative, up to rounding.
    """
    for j in range(part.shape[1]):
        a, b, c = _coefficients(follower, part[0][j], part[1][j], part[2][j])
        if speed == math.inf:
            if a < 0.0 or b < 0.0 or c < 0.0:
                return True
            continue
        min_change = min((a * speed + b) * speed, 0.0)
        if a > 0.0:
            vertex = min(max(-0.5 * b / a, 0.0), speed)
            min_change = min(min_change, (a * vertex + b) * vertex)
        if min_change + c < -FORCE_RTOL * ((abs(a) * speed + abs(b)) * speed + abs(c)):
            return True
    return False

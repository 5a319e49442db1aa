"""Arrays of a motion law and a cam, for the search for lift-offs and landings.

The search runs in plain Python or compiled by numba, so it uses arrays and tuples, not objects.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cam_rig.laws.polynomials import weighted_value
from cam_rig.laws.vectors import Matrices, Records, index_at
from cam_rig.units import TURN

#: Float epsilon: distance between 1 and the next float.
EPS = 2.0**-52
#: Upper bound of the rounding error of the cam angle of a lift-off or landing, as a multiple of the
#: float epsilon of (angle + one turn).
ANGLE_ROUNDING_ERRORS = 4.0
#: Upper bound of the rounding error of the gap between follower and cam, as a multiple of the float
#: epsilon of their displacements.
GAP_ROUNDING_ERRORS = 16.0


#: Record of the scalar numbers of one polynomial piece of a law.
LAW_PIECE = np.dtype(
    [
        ("start", "f8"),  # cam angle at the start of the piece, rad
        ("span", "f8"),  # cam angle that the piece covers, rad
        ("max_curvature", "f8"),  # upper bound of |s''| in the piece, m/rad²
    ],
    align=True,
)


class LawRow(IntEnum):
    """Index of the polynomial of s, s' or s'' in a piece of `LawTable.polynomials`.

    Each polynomial is a row of Bernstein ordinates. In a weighted row they are multiplied by their
    binomial coefficients, which makes evaluation faster.
    """

    LIFT = 0  #: s in m, weighted
    SLOPE = 1  #: s' in m/rad, weighted
    CURVATURE = 2  #: s'' in m/rad², weighted
    CURVATURE_ORDINATES = 3  #: s'' in m/rad², not weighted


class LawTable(NamedTuple):
    """Polynomials s, s', s'' of a motion law with n pieces of degree p, as arrays."""

    pieces: Records  #: one record of `LAW_PIECE` per piece, ``(n,)``
    polynomials: Matrices  #: one row per member of `LawRow` for each piece, ``(n, 4, p + 1)``
    size: int  #: number of ordinates per piece, p + 1
    max_lift: float  #: upper bound of |s|, m
    max_slope: float  #: upper bound of |s'|, m/rad
    max_lift_step: float  #: largest step of s at a joint, m (rounding error of the law)
    has_velocity_jumps: bool  #: True if s' jumps at a joint


class Cam(NamedTuple):
    """Cam with a motion law, turning at constant speed."""

    law: LawTable  #: motion law of the cam
    speed: float  #: cam speed, rad/s
    angle: float  #: cam angle at time 0, rad


class CamMotion(NamedTuple):
    """Motion of the cam surface under the follower at one time."""

    lift: float  #: lift s, m
    velocity: float  #: velocity ṡ, m/s
    acceleration: float  #: acceleration s̈, m/s²


def cam_at(cam: Cam, time: float) -> CamMotion:
    """Return the lift, velocity and acceleration of the cam surface at a time (s).

    At a joint of two pieces of the law they are the values of the later piece.
    """
    law, speed, angle = cam.law, cam.speed, cam.angle + cam.speed * time
    angle_in_turn = angle - math.floor(angle / TURN) * TURN
    i = index_at(law.pieces["start"], angle_in_turn)
    u = (angle_in_turn - law.pieces[i]["start"]) / law.pieces[i]["span"]
    rows, size = law.polynomials[i], law.size
    return CamMotion(
        lift=weighted_value(rows[LawRow.LIFT], size, u),
        velocity=weighted_value(rows[LawRow.SLOPE], size, u) * speed,
        acceleration=weighted_value(rows[LawRow.CURVATURE], size, u) * (speed * speed),
    )


def lift_within(cam: Cam, piece: int, time: float) -> tuple[float, float]:
    """Return the cam's lift s (m) and velocity ṡ (m/s) at a time (s).

    ``piece`` is the index of the polynomial piece of the law that contains the cam angle at that
    time. At a joint of two pieces it selects the value before or after the joint.
    """
    law, advance = cam.law, cam.speed * time
    span, rows = law.pieces[piece]["span"], law.polynomials[piece]
    # Measured from the middle of the piece, so that whole turns cancel before rounding.
    offset = cam.angle - (law.pieces[piece]["start"] + 0.5 * span)
    offset = offset - math.floor((offset + advance) / TURN + 0.5) * TURN + advance
    u = min(max(offset / span + 0.5, 0.0), 1.0)
    velocity = weighted_value(rows[LawRow.SLOPE], law.size, u) * cam.speed
    return weighted_value(rows[LawRow.LIFT], law.size, u), velocity


def angle_rounding_time(cam: Cam) -> float:
    """Return the time (s) in which the cam turns by the rounding error of its angle."""
    return ANGLE_ROUNDING_ERRORS * EPS * (abs(cam.angle) + TURN) / cam.speed


def piece_from(cam: Cam, time: float) -> tuple[int, float, float]:
    """Return the index and the cam angles (rad) of the law's piece just after a time.

    The result is the index of the polynomial piece, its start angle and its end angle, which
    include whole turns. ``time`` is in s. A piece that ends within the rounding error of the angle
    counts as finished. A lift-off at a joint with a jump of s'' is therefore in the later piece.
    """
    law, angle = cam.law, cam.angle + cam.speed * time
    turn = math.floor(angle / TURN) * TURN
    index = index_at(law.pieces["start"], angle - turn)
    is_last = index + 1 == len(law.pieces)
    low = law.pieces[index]["start"] + turn
    high = (TURN if is_last else law.pieces[index + 1]["start"]) + turn
    if (high - cam.angle) / cam.speed <= time + angle_rounding_time(cam):
        index = 0 if is_last else index + 1
        low, high = high, high + law.pieces[index]["span"]
    return index, low, high


def gap_rounding(law: LawTable, displacement: float) -> float:
    """Return an upper bound (m) of the rounding error of the gap from follower to cam.

    The gap is a difference of displacements, and ``displacement`` (m) is that of the follower. The
    bound is ε_g in docs/proofs.md. It contains the rounding errors of the follower's displacement,
    of s and of the cam angle, and the steps of s at the joints of the law.
    """
    size = max(abs(displacement), law.max_lift) + TURN * law.max_slope
    return GAP_ROUNDING_ERRORS * EPS * size + law.max_lift_step

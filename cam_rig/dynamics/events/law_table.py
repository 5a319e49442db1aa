"""The law as the event search reads it: its pieces by cam angle, and s, s', s'' in them."""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.laws.polynomials import weighted_value
from cam_rig.laws.rows import Row, Stack, index_at
from cam_rig.units import TURN

EPS = 2.0**-52
#: Roundings of an angle that a lift-off may be wrong by.
SLIP = 4.0
#: A gap reckoned from two places is this many rounding errors of them wrong at most.
ROUNDING_ERRORS = 16.0
#: Places in a piece's rows: [its span, what |s''| does not exceed]; s, s' and s'' times binomials;
#: s'' as it is.
SIZES, LIFT, SLOPE, BEND, ACCELERATION = range(5)

SPAN, LARGEST = range(2)


class LawTable(NamedTuple):
    """Numbers of a `Law`; n pieces of degree p."""

    begins: Row  #: ``(n,)``, where each piece begins, rad
    pieces: Stack  #: ``(n, 5, q)`` with q = p + 1, at least 2; rad, m, m/rad and m/rad²
    size: int  #: p + 1
    largest: float  #: what |s| does not exceed, m
    steepest: float  #: what |s'| does not exceed, m/rad
    largest_step: float  #: largest step of s at a joint, m
    jumps: bool  #: whether s' jumps anywhere


class Cam(NamedTuple):
    """A law on a cam that turns."""

    law: LawTable
    speed: float  #: rad/s
    angle: float  #: at time 0, rad


def cam_at(cam: Cam, time: float) -> tuple[float, float, float]:
    """S (m), ṡ (m/s) and s̈ (m/s²) at a time in s; right limits at joints."""
    law, speed, angle = cam.law, cam.speed, cam.angle + cam.speed * time
    inside = angle - math.floor(angle / TURN) * TURN
    i = index_at(law.begins, inside)
    rows, size = law.pieces[i], law.size
    u = (inside - law.begins[i]) / rows[SIZES][SPAN]
    s, slope = weighted_value(rows[LIFT], size, u), weighted_value(rows[SLOPE], size, u)
    return s, slope * speed, weighted_value(rows[BEND], size, u) * (speed * speed)


def lift_within(cam: Cam, piece: int, time: float) -> tuple[float, float]:
    """S (m) and ṡ (m/s) at a time, in a piece that holds that angle; at a joint either does."""
    rows, size, ahead = cam.law.pieces[piece], cam.law.size, cam.speed * time
    span = rows[SIZES][SPAN]
    away = cam.angle - (cam.law.begins[piece] + 0.5 * span)
    away = away - math.floor((away + ahead) / TURN + 0.5) * TURN + ahead
    u = min(max(away / span + 0.5, 0.0), 1.0)
    return weighted_value(rows[LIFT], size, u), weighted_value(rows[SLOPE], size, u) * cam.speed


def last_digit(cam: Cam) -> float:
    """Time (s) in which the cam turns by the rounding of its angle."""
    return SLIP * EPS * (abs(cam.angle) + TURN) / cam.speed


def piece_from(cam: Cam, time: float) -> tuple[int, float, float]:
    """The law's piece from a time on, and the angles (rad) where it begins and ends.

    One that ends within the rounding of the angle is over: a lift-off where s'' falls is there,
    and not a last digit before.
    """
    law, at = cam.law, cam.angle + cam.speed * time
    turn = math.floor(at / TURN) * TURN
    index = index_at(law.begins, at - turn)
    low, last = law.begins[index] + turn, index + 1 == len(law.begins)
    high = (TURN if last else law.begins[index + 1]) + turn
    if (high - cam.angle) / cam.speed <= time + last_digit(cam):
        index = 0 if last else index + 1
        low, high = high, high + law.pieces[index][SIZES][SPAN]
    return index, low, high


def gap_rounding(law: LawTable, displacement: float) -> float:
    """Bound (m) on the error of a gap: of both displacements, the angle, the law's own joints."""
    size = max(abs(displacement), law.largest) + TURN * law.steepest
    return ROUNDING_ERRORS * EPS * size + law.largest_step

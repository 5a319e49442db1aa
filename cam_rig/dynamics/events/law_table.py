"""The law as the event search reads it: its pieces by cam angle, and s, s', s'' in them."""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.polynomials import weighted_value
from cam_rig.dynamics.events.rows import Stack, place_of
from cam_rig.units import TURN

EPS = 2.0**-52
#: Roundings of an angle that a lift-off may be wrong by.
SLIP = 4.0
#: A gap reckoned from two places is this many rounding errors of them wrong at most.
ROUNDING_ERRORS = 16.0


#: Places in a piece's rows: [where it begins, its span, what |s''| does not exceed]; s, s' and s''
#: times binomials; s'' as it is.
PLACE, LIFT, SLOPE, BEND, ACCELERATION = range(5)
BEGIN, SPAN, LARGEST = range(3)


class LawTable(NamedTuple):
    """Numbers of a `Law`; n pieces of degree p.

    Parameters
    ----------
    pieces : ``(n, 5, q)`` with q = p + 1, at least 3; rad, m, m/rad and m/rad²
    size : p + 1
    largest, steepest : what |s| (m) and |s'| (m/rad) do not exceed
    largest_step : largest step of s at a joint, m
    jumps : whether s' jumps anywhere
    """

    pieces: Stack
    size: int
    largest: float
    steepest: float
    largest_step: float
    jumps: bool


class Cam(NamedTuple):
    """A law on a cam that turns at ``speed`` (rad/s) and is at ``angle`` (rad) at time 0."""

    law: LawTable
    speed: float
    angle: float


def law_at(law: LawTable, angle: float) -> tuple[float, float, float]:
    """S (m), s' (m/rad) and s'' (m/rad²) at a cam angle in rad; right limits at joints."""
    inside = angle - math.floor(angle / TURN) * TURN
    i = place_of(law.pieces, inside)
    rows, size = law.pieces[i], law.size
    u = (inside - rows[PLACE][BEGIN]) / rows[PLACE][SPAN]
    s, slope = weighted_value(rows[LIFT], size, u), weighted_value(rows[SLOPE], size, u)
    return s, slope, weighted_value(rows[BEND], size, u)


def cam_at(cam: Cam, time: float) -> tuple[float, float, float]:
    """S, ṡ and s̈ at a time in s."""
    s, slope, bend = law_at(cam.law, cam.angle + cam.speed * time)
    return s, slope * cam.speed, bend * (cam.speed * cam.speed)


def lift_within(cam: Cam, piece: int, time: float) -> tuple[float, float]:
    """S (m) and ṡ (m/s) at a time, in a piece that holds that angle; at a joint either does.

    The rounding of the angle at time 0 is the same for all times.
    """
    rows, size, ahead = cam.law.pieces[piece], cam.law.size, cam.speed * time
    span = rows[PLACE][SPAN]
    away = cam.angle - (rows[PLACE][BEGIN] + 0.5 * span)
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
    index = place_of(law.pieces, at - turn)
    low = law.pieces[index][PLACE][BEGIN] + turn
    last = index + 1 == len(law.pieces)
    high = (TURN if last else law.pieces[index + 1][PLACE][BEGIN]) + turn
    if (high - cam.angle) / cam.speed <= time + last_digit(cam):
        index = 0 if last else index + 1
        low, high = high, high + law.pieces[index][PLACE][SPAN]
    return index, low, high


def gap_rounding(law: LawTable, displacement: float) -> float:
    """Bound (m) on the error of a gap: of both displacements, the angle, the law's own joints."""
    size = max(abs(displacement), law.largest) + TURN * law.steepest
    return ROUNDING_ERRORS * EPS * size + law.largest_step

"""The law as the event search reads it: its pieces by cam angle, and s, s', s'' in them."""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.velocity_jumps import SAME_PLACE
from cam_rig.laws.polynomials import weighted_value
from cam_rig.laws.rows import Row, Rows, Stack, place_of
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
    """Numbers of a `Law`; n pieces of degree p."""

    pieces: Stack  #: ``(n, 5, q)`` with q = p + 1, at least 3; rad, m, m/rad and m/rad²
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
    """S (m) and ṡ (m/s) at a time, in a piece that holds that angle; at a joint either does."""
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


#: Places in the row of numbers that a run goes on from: the time, whether the follower flies,
#: whether its gap is known, the gap, the speed at which it opens, velocity jumps that are over,
#: the step of ṡ that is still to be met, whether the run has begun, and the state (contact or
#: flight).
TIME, FLYING, KNOWN, GAP, GAP_RATE, JUMPS_DONE, STEP, BEGUN, STATE = range(9)
#: Numbers of a phase: the run's row where it begins, up to four of the state, and when it ends.
PHASE_SIZE, END = STATE + 5, STATE + 4
#: Numbers of an event: 0 for a lift-off or 1 for a landing, time, impulse, energy lost.
EVENT_SIZE = 4


class Jumps(NamedTuple):
    """Velocity jumps of an interval."""

    ahead: Rows  #: ``(n, 2)``: when (s), what ṡ gains (m/s)
    duration: float  #: s
    clear: float  #: up to where the law is as before a velocity jump of the next interval, s


class RunRecord(NamedTuple):
    """What a run writes."""

    now: Row  #: its place, ``(9 + n,)``
    phases: Rows
    events: Rows
    counts: Row  #: how many phases and events there are


def has_room(record: RunRecord) -> bool:
    """Whether one more phase and its events can be written."""
    phases, events = record.counts[0], record.counts[1]
    return phases + 1 <= len(record.phases) and events + 2 <= len(record.events)


def add_phase(record: RunRecord, end: float) -> None:
    """Note a phase from where the run is to ``end`` (s)."""
    row, now = record.phases[int(record.counts[0])], record.now
    for i in range(END):
        row[i] = now[i] if i < len(now) else 0.0
    row[END] = end
    record.counts[0] += 1.0


def add_event(record: RunRecord, landing: bool, time: float, impulse: float, lost: float) -> None:
    """Note a lift-off or a landing."""
    row = record.events[int(record.counts[1])]
    row[0], row[1], row[2], row[3] = 1.0 if landing else 0.0, time, impulse, lost
    record.counts[1] += 1.0


def bound(jumps: Jumps, now: Row) -> float:
    """Time of the next velocity jump, or the end."""
    done = int(now[JUMPS_DONE])
    return min(jumps.ahead[done][0], jumps.duration) if done < len(jumps.ahead) else jumps.duration


def no_later(jumps: Jumps, now: Row, speed: float, time: float) -> float:
    """``time``, or `bound` where it is later, or only by rounding before a jump there."""
    near = SAME_PLACE / speed if int(now[JUMPS_DONE]) < len(jumps.ahead) else 0.0
    last = bound(jumps, now)
    return time if time < last - near else last


def jump_at(jumps: Jumps, now: Row, time: float) -> bool:
    """Whether the next velocity jump is at a time, or before it."""
    done = int(now[JUMPS_DONE])
    return done < len(jumps.ahead) and jumps.ahead[done][0] <= time


def take(jumps: Jumps, now: Row, time: float) -> float:
    """Done with the velocity jumps up to a time: what ṡ gains by them, m/s."""
    gained = 0.0
    while jump_at(jumps, now, time):
        gained += jumps.ahead[int(now[JUMPS_DONE])][1]
        now[JUMPS_DONE] += 1.0
    return gained


def fly_from(now: Row, known: bool, gap: float, gap_rate: float) -> None:
    """The follower is in the air; its state is there already."""
    now[FLYING], now[KNOWN] = 1.0, 1.0 if known else 0.0
    now[GAP], now[GAP_RATE] = gap, gap_rate


def rises(rebound: float, pull: float, least: float) -> bool:
    """Whether a rebound (m/s) against a deceleration (m/s²) comes higher than ``least`` (m)."""
    if rebound <= 0.0 or pull <= 0.0:
        return rebound > 0.0
    return 0.5 * rebound * rebound / pull > least

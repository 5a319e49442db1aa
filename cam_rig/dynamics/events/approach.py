"""Where a flying follower meets the cam again.

Within a window the gap's acceleration is a polynomial: the follower's power series less the law's
s'' ω². Integrated twice from the gap and the speed at which it opens it gives the gap, and where
both are known exactly, as they are at a lift-off, so is a gap of any smallness: its first zero is
divided out, and the next one is the landing.

Far from the cam the gap is looked at in steps. A function whose second derivative is nowhere above
M is no lower than v + r t − M t²/2 at t from where its value is v and its rate r; and between two
times a step h apart no lower than the lower of the two less M h²/8.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.free_flight import LiftOffState, accelerations, moved, place_of, seen
from cam_rig.dynamics.events.law_table import (
    ACCELERATION,
    EPS,
    LARGEST,
    SIZES,
    SPAN,
    Cam,
    gap_rounding,
    last_digit,
    lift_within,
    piece_from,
)
from cam_rig.dynamics.velocity_jumps import SAME_PLACE
from cam_rig.laws.polynomials import elevated, fall, integrated, restricted, value_at
from cam_rig.laws.rows import Row, size_of, zeros

#: What is reckoned from accelerations is this many rounding errors of them wrong at most.
OF_ACCELERATIONS = 64.0
#: Longest time (s) before a velocity jump that may be none.
VELOCITY_JUMP_S = 1e-7
#: A look at the gap takes steps of this part of a window at least; below that it is a polynomial.
MIN_STEP = 1.0 / 16.0
#: The end of a piece is not reached: there the one after it begins.
BEFORE_1 = 1.0 - 1e-16


class Gap(NamedTuple):
    """Follower less cam."""

    time: float  #: since the flight began, s
    gap: float  #: m
    rate: float  #: m/s
    noise: float  #: what rounding may have added, m
    landed: bool  #: whether the flight ends here


class FlightOverCam(NamedTuple):
    """A flight over a cam, both from time 0 on."""

    lift_off: LiftOffState
    cam: Cam
    known: bool  #: whether the two below are known better than as differences of two places
    gap: float  #: at the start, m
    gap_rate: float  #: at the start, m/s
    #: By how much the acceleration may be wrong at which the gap opens when the cam's force, which
    #: is known to so much, falls to zero, m/s².
    force_noise: float


def landing(flight: FlightOverCam, limit: float) -> Gap:
    """The flight's end: where it lands, or at ``limit`` (s) in the air."""
    rounding = _rounding(flight.cam)
    now, last = _begin(flight), limit - rounding
    while now.time < limit:
        # A velocity jump ends the flight: rounding must not put its last bit behind that jump.
        within = now.time - (rounding if now.time > last else 0.0)
        now = _window(flight, now, limit, within)
        if now.landed:
            return now
        if now.time < last:
            now = _open_until(flight, now, limit)
    return now


def _rounding(cam: Cam) -> float:
    """Time (s) before the end of a flight that may be none, if a velocity jump ends it."""
    if not cam.law.jumps:
        return 0.0
    return min(max(SAME_PLACE / cam.speed, 4.0 * last_digit(cam)), VELOCITY_JUMP_S)


def _begin(flight: FlightOverCam) -> Gap:
    """The gap at the beginning; as the difference of two places where it is not known better."""
    if flight.known:
        return Gap(0.0, flight.gap, flight.gap_rate, 0.0, False)
    lift_off, cam = flight.lift_off, flight.cam
    place, velocity = place_of(lift_off, lift_off.start), place_of(lift_off, lift_off.rates)
    piece, _ = _start(cam)
    s, slope = lift_within(cam, piece, 0.0)
    return Gap(0.0, place - s, velocity - slope, gap_rounding(cam.law, place), False)


def _start(cam: Cam) -> tuple[int, float]:
    """Piece of the law where the flight begins, and u there."""
    piece, low, high = piece_from(cam, 0.0)
    return piece, min(max((cam.angle - low) / (high - low), 0.0), BEFORE_1)


def _at(flight: FlightOverCam, time: float, piece: int) -> Gap:
    """The gap by how far both have come since; where a piece ends, before what follows it."""
    begun, cam, lift_off = _begin(flight), flight.cam, flight.lift_off
    gone, start = moved(lift_off, time), place_of(lift_off, lift_off.start)
    way, rate = place_of(lift_off, gone.way), place_of(lift_off, gone.rates)
    noise = gap_rounding(cam.law, start)
    first_piece, first = _start(cam)
    length = cam.law.pieces[first_piece][SIZES][SPAN] * (1.0 - first) / cam.speed
    if piece == first_piece and time <= length:
        further, faster = _bent(cam, piece, first, time / length, length)
        begin = place_of(lift_off, lift_off.rates)
        gap = begun.gap + begun.rate * time + ((way - begin * time) - further)
        return Gap(time, gap, begun.rate + ((rate - begin) - faster), noise, False)
    s, slope = lift_within(cam, piece, time)
    return Gap(time, start + way - s, rate - slope, noise, False)


def _bent(cam: Cam, piece: int, first: float, u: float, length: float) -> tuple[float, float]:
    """What the cam has come to more than at its first velocity, m, and that velocity's gain.

    In the piece where the flight begins. From s'' alone: the rounding of s and of s', which
    differs from that of the follower's place and velocity, does not enter.
    """
    bend = restricted(cam.law.pieces[piece][ACCELERATION], cam.law.size, first, 1.0)
    for i in range(len(bend)):
        bend[i] *= cam.speed * cam.speed
    rates = integrated(bend, length, 0.0)
    gaps, u = integrated(rates, length, 0.0), min(u, 1.0)
    return value_at(gaps, len(gaps), u), value_at(rates, len(rates), u)


def _open_until(flight: FlightOverCam, now: Gap, limit: float) -> Gap:
    """The gap as far from ``now`` on as steps prove that it is open."""
    cam, lift_off, begin, value, rate = flight.cam, flight.lift_off, now.time, now.gap, now.rate
    start, least = place_of(lift_off, lift_off.start), MIN_STEP * lift_off.free.window
    (_, _, largest), square = seen(lift_off, begin), cam.speed * cam.speed
    piece, _, high = piece_from(cam, begin)
    slip, passed = SAME_PLACE / cam.speed, -1
    while begin < limit:
        bend = largest + square * cam.law.pieces[piece][SIZES][LARGEST]
        noise = gap_rounding(cam.law, abs(value) + cam.law.largest)
        end = min(begin + max(least, ahead(value - noise, max(rate, 0.0), bend)), limit)
        joint = (high - cam.angle) / cam.speed
        at_joint = joint <= end + slip
        end = min(max(joint, begin), limit) if at_joint else end
        (way, velocity, less), (lift, slope) = seen(lift_off, end), lift_within(cam, piece, end)
        reached, further = (start + way) - lift, velocity - slope
        noise = max(noise, gap_rounding(cam.law, abs(reached) + cam.law.largest))
        if not is_clear(value - noise, rate, reached - noise, further, end - begin, bend):
            break
        begin, value, rate, largest, passed = end, reached, further, less, piece
        if at_joint:
            piece = (piece + 1) % len(cam.law.pieces)
            high = high + cam.law.pieces[piece][SIZES][SPAN]
            rate = velocity - lift_within(cam, piece, begin)[1]
    return now if passed < 0 else _at(flight, begin, passed)


def ahead(value: float, rate: float, bend: float) -> float:
    """Time (s) up to which a function is above zero; of no rate, half a cell's greatest width."""
    if value <= 0.0:
        return 0.0
    if bend <= 0.0:
        return math.inf if rate >= 0.0 else value / -rate
    root = math.sqrt(rate * rate + 2.0 * bend * value)
    return (rate + root) / bend if rate > 0.0 else 2.0 * value / (root - rate)


def is_clear(
    value: float, rate: float, last: float, last_rate: float, width: float, bend: float
) -> bool:
    """Whether a function known at both ends of a cell of ``width`` s is above zero in it."""
    if value <= 0.0 or last <= 0.0:
        return False
    if min(value, last) > bend * width * width / 8.0:
        return True
    return width < ahead(value, rate, bend) + ahead(last, -last_rate, bend)


def _window(flight: FlightOverCam, now: Gap, limit: float, within: float) -> Gap:
    """The gap from ``now`` on, on the piece of the time ``within``, to its zero or its end."""
    cam, begin = flight.cam, now.time
    piece, low, high = piece_from(cam, within)
    window = flight.lift_off.free.window
    end = min(begin + window, limit)
    if within == begin:
        end = min(end, (high - cam.angle) / cam.speed)
    if not end > begin:  # to the next time that is another number, or nearly
        return Gap(begin + max(EPS * begin, 1e-300), now.gap, now.rate, now.noise, False)
    length, span = window if end == begin + window else end - begin, high - low
    first = min(max((cam.angle + cam.speed * begin - low) / span, 0.0), BEFORE_1)
    last = min(max((cam.angle + cam.speed * end - low) / span, 0.0), 1.0)
    size = cam.law.size
    bend = restricted(cam.law.pieces[piece][ACCELERATION], size, first, max(first, last))
    rates = flight.lift_off.rates if begin == 0.0 else moved(flight.lift_off, begin).rates
    gap_acceleration = accelerations(flight.lift_off, rates, length)
    square = cam.speed * cam.speed
    doubt = EPS * (OF_ACCELERATIONS * size_of(gap_acceleration) + square * _bend_size(cam, piece))
    count = max(len(bend), len(gap_acceleration))
    bend, gap_acceleration = elevated(bend, count), elevated(gap_acceleration, count)
    for i in range(len(gap_acceleration)):
        gap_acceleration[i] -= square * bend[i]
    speeds = integrated(gap_acceleration, length, now.rate)
    gaps = integrated(speeds, length, now.gap)
    doubt_at_start = doubt + flight.force_noise + _slip(cam, gap_acceleration, length)
    at = _landing(gaps, now, length, doubt_at_start)
    if at >= 0.0:
        return Gap(begin + at * length, 0.0, value_at(speeds, len(speeds), at), 0.0, True)
    return Gap(end, gaps[-1], speeds[-1], now.noise + length * length * doubt, False)


def _slip(cam: Cam, gap_acceleration: Row, length: float) -> float:
    """What the acceleration (m/s²) changes within the rounding of the time of a lift-off."""
    steepest, degree = 0.0, len(gap_acceleration) - 1
    for i in range(min(2, degree)):
        steepest = max(steepest, abs(gap_acceleration[i + 1] - gap_acceleration[i]))
    return degree / length * steepest * last_digit(cam)


def _bend_size(cam: Cam, piece: int) -> float:
    """What rounding of s'' (m/rad²) is to be measured by: its own size, and that of s."""
    law, place = cam.law, cam.law.pieces[piece][SIZES]
    differences = (law.size - 1) / place[SPAN]
    return OF_ACCELERATIONS * place[LARGEST] + differences * differences * law.largest


def _landing(gaps: Row, now: Gap, length: float, doubt: float) -> float:
    """U ∈ [0, 1] where the gap falls to zero; a zero at the start is divided out first."""
    noise = now.noise + OF_ACCELERATIONS * EPS * size_of(gaps)
    if now.gap != 0.0 or now.noise != 0.0 or now.rate < 0.0:
        return fall(gaps, noise)
    gaps, noise = _divided(gaps), length * length * doubt
    if now.rate == 0.0:
        return fall(_divided(gaps), noise)
    return fall(gaps, min(noise, 0.5 * length * now.rate))


def _divided(row: Row) -> Row:
    """The ordinates of a polynomial divided by u, which is zero at 0: bᵢ n/i."""
    degree = len(row) - 1
    out = zeros(degree)
    for i in range(degree):
        out[i] = row[i + 1] * (degree / (i + 1))
    return out

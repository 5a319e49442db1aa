"""The least output of a mode over a run at one speed: parts of pieces are cut, or left by a bound.

In no part is the output lower than the chord of the polynomial less what a curve of so much bend
may sag and less the vibration, which does not grow; nor than its own chord less the sag of both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.modal.motion import (
    LawSeries,
    Oscillator,
    OscillatorMotion,
    Pair,
    amplitude,
    flow_over,
    moved,
    state_at,
)
from cam_rig.laws.polynomials import weighted_by_binomials, weighted_value
from cam_rig.laws.rows import Row, Rows, index_at, zeros
from cam_rig.units import TURN

#: A part that may hold the least value is cut into so many.
CUT = 4
#: A least value is found to this part of the output's size.
EXACT = 1e-13
#: Parts below this fraction of their piece are not cut: rounding decides.
RESOLUTION = 2.0**-50
#: Parts that wait at once: `CUT` for each of the cuts down to `RESOLUTION`.
MOST_PARTS = 160
#: Places in a part: where it begins and its width (rad in the piece), free (η, η̇) there, its bound.
LOW, WIDTH, ETA, RATE, BOUND, PART = 0, 1, 2, 3, 4, 5


class Least(NamedTuple):
    """The least value."""

    value: float
    angle: float  #: where, rad from the start of the run
    looks: int  #: values that were looked at


class Stretch(NamedTuple):
    """What is looked at, and how closely."""

    begin: float  #: rad from the start of the run
    end: float
    relative: float  #: what is left out may be lower than the value by this part of it


def least(
    law: LawSeries, mode: Oscillator, motion: OscillatorMotion, stretch: Stretch, floors: Row
) -> Least:
    """The least output of a stretch of the run.

    ``floors`` ``(g,)`` are lowered to what the output is not below in each group in any turn.
    """
    parts = zeros((MOST_PARTS, PART))
    first, last = int(stretch.begin // TURN), min(len(motion.starts), int(stretch.end // TURN) + 1)
    begin, end = 0, len(motion.floors)
    if last - first == 1:
        begin = index_at(law.breaks, stretch.begin - first * TURN)
        end = min(end, 1 + index_at(law.breaks, stretch.end - first * TURN))
    found, deepest, group = Least(math.inf, stretch.begin, end - begin), begin, 0
    apart = _apart(motion, first, last)
    for i in range(begin, end):
        deepest = i if motion.floors[i] < motion.floors[deepest] else deepest
    if begin < end:
        found = _in_turns(law, mode, motion, stretch, deepest, first, last, parts, found)
    for i in range(begin, end):
        while i >= law.groups[group + 1]:
            group += 1
        floor = motion.floors[i]
        allowed = _allowed(found.value, EXACT * motion.highest[i], stretch.relative)
        if floor < allowed:
            if last - first > 1:
                state = free_at(motion, i, last - 1)
                chord = _chord(law, mode, motion, i, state)
                floor = max(floor, chord - apart * motion.lefts[i])
            if i != deepest and floor < allowed:
                found = _in_turns(law, mode, motion, stretch, i, first, last, parts, found)
            floor = max(floor, found.value - stretch.relative * abs(found.value))
        floors[group] = min(floors[group], floor)
    return found


def _allowed(value: float, exact: float, relative: float) -> float:
    """What is not below this is left out, where a value was found."""
    return value if value == math.inf else value - max(exact, relative * abs(value))


def _apart(motion: OscillatorMotion, first: int, last: int) -> float:
    """By how much the output differs at most from turn to turn, where the last of them begins.

    All that joints excite in a turn is the same in each, and large where derivatives of s are; what
    turns begin with differs by the motion itself, and that fades.
    """
    most, x = 0.0, motion.starts[last - 1]
    for turn in range(first, last - 1):
        one = motion.starts[turn]
        most = max(most, amplitude(motion.norm, (one[0] - x[0], one[1] - x[1])))
    return motion.norm.reach * most


def free_at(motion: OscillatorMotion, piece: int, turn: int) -> Pair:
    """Free (η, η̇) where a piece begins in a turn."""
    flow, x = motion.whole, motion.starts[turn]
    place = flow[0][piece] * x[0] + flow[1][piece] * x[1] + motion.added[0][piece]
    return place, flow[2][piece] * x[0] + flow[3][piece] * x[1] + motion.added[1][piece]


def _in_turns(
    law: LawSeries,
    mode: Oscillator,
    motion: OscillatorMotion,
    stretch: Stretch,
    piece: int,
    first: int,
    last: int,
    parts: Rows,
    found: Least,
) -> Least:
    """What was found, or what is lower in a piece, from a turn on to before another."""
    span = law.breaks[piece + 1] - law.breaks[piece]
    for turn in range(first, last):
        angle = turn * TURN + law.breaks[piece]
        begin, end = max(0.0, stretch.begin - angle), min(span, stretch.end - angle)
        if end < begin or end <= 0.0:
            continue
        state = free_at(motion, piece, turn)
        free = motion.norm.reach * amplitude(motion.norm, state)
        exact = EXACT * (motion.highest[piece] + free)
        allowed = _allowed(found.value, exact, stretch.relative)
        if motion.lowest[piece] - free < allowed and (
            _chord(law, mode, motion, piece, state) < allowed
        ):
            if begin > 0.0:
                flow = zeros(4)
                flow_over(mode, begin / motion.speed, flow)
                state = moved(flow, state)
            part = parts[0]
            part[LOW], part[WIDTH], part[BOUND] = begin, end - begin, -math.inf
            part[ETA], part[RATE] = state
            found = _in_piece(
                law, mode, motion, stretch.relative, exact, piece, angle, parts, found
            )
    return Least(found.value, found.angle, found.looks + last - first)


def _chord(
    law: LawSeries, mode: Oscillator, motion: OscillatorMotion, piece: int, state: Pair
) -> float:
    """What the output is not below in a piece that begins with free (η, η̇) ``state``.

    By its chord, and what a curve may sag below that whose second derivative follows from the
    whole motion: in a piece much shorter than the mode's period, where derivatives of s jump, the
    polynomial and the vibration are large and cancel.
    """
    forced, steep = motion.forced, law.steepest[piece]
    speed, square, rate = motion.speed, motion.speed * motion.speed, math.sqrt(mode.stiffness)
    time = (law.breaks[piece + 1] - law.breaks[piece]) / speed
    end = moved(motion.flows[law.alike[piece]], state)
    first = forced[0][piece] + mode.place * state[0] + mode.velocity * state[1]
    last = forced[len(forced) - 1][piece] + mode.place * end[0] + mode.velocity * end[1]
    d0, d1, d2 = abs(mode.drive[0]), abs(mode.drive[1]) * speed, abs(mode.drive[2]) * square
    m0, m1, m2 = abs(mode.motion[0]), abs(mode.motion[1]) * speed, abs(mode.motion[2]) * square
    push = d0 * steep[0] + d1 * steep[1] + d2 * steep[2]
    faster = speed * (d0 * steep[1] + d1 * steep[2] + d2 * steep[3])
    carried = state_at(law, motion.own, speed, piece)
    place, velocity = carried[0] + state[0], carried[1] + state[1]
    most = math.sqrt(mode.stiffness * place * place + velocity * velocity) + time * push
    acceleration = (rate + mode.damping) * most + push
    jerk = mode.stiffness * most + mode.damping * acceleration + faster
    bend = abs(mode.place) * acceleration + abs(mode.velocity) * jerk
    bend += square * (m0 * steep[2] + m1 * steep[3] + m2 * steep[4])
    below: float = 0.125 * bend * time * time
    return min(first, last) - below


def _bend(ordinates: Row, span: float) -> float:
    """What a polynomial's second derivative (1/rad²) does not exceed in a piece."""
    count, change = len(ordinates), 0.0
    for j in range(2, count):
        change = max(change, abs(ordinates[j] - 2.0 * ordinates[j - 1] + ordinates[j - 2]))
    return (count - 1) * (count - 2) * change / (span * span)


def _in_piece(
    law: LawSeries,
    mode: Oscillator,
    motion: OscillatorMotion,
    relative: float,
    exact: float,
    piece: int,
    angle: float,
    parts: Rows,
    found: Least,
) -> Least:
    """The same in the first of ``parts``, a part of a piece that begins at ``angle``."""
    ordinates, flow, size = motion.forced[:, piece].copy(), zeros(4), motion.norm
    count, span = len(ordinates), law.breaks[piece + 1] - law.breaks[piece]
    forced = weighted_by_binomials(ordinates, count)
    bend, slow = _bend(ordinates, span), 1.0 / (motion.speed * motion.speed)
    lowest, where, looks, top = found.value, found.angle, found.looks, 0
    while top >= 0:
        part = parts[top]
        low, step, eta, rate = part[LOW], part[WIDTH] / CUT, part[ETA], part[RATE]
        bound, top = part[BOUND], top - 1
        if bound >= _allowed(lowest, exact, relative):
            continue
        flow_over(mode, step / motion.speed, flow)
        before = weighted_value(forced, count, min(1.0, low / span))
        value = before + mode.place * eta + mode.velocity * rate
        eighth, looks = 0.125 * step * step, looks + CUT
        if value < lowest:
            lowest, where = value, angle + low
        for _ in range(CUT):
            low += step
            after = weighted_value(forced, count, min(1.0, low / span))
            place, velocity = flow[0] * eta + flow[1] * rate, flow[2] * eta + flow[3] * rate
            reached = after + mode.place * place + mode.velocity * velocity
            if reached < lowest:
                lowest, where = reached, angle + low
            acceleration = -mode.stiffness * eta - mode.damping * rate
            jerk = -mode.stiffness * rate - mode.damping * acceleration
            faster = size.reach * amplitude(size, (acceleration, jerk)) * slow
            free = size.reach * amplitude(size, (eta, rate))
            chord = max(min(before, after) - free, min(value, reached) - eighth * faster)
            bound = chord - eighth * bend
            if step > RESOLUTION * span and bound < _allowed(lowest, exact, relative):
                top += 1
                part = parts[top]
                part[LOW], part[WIDTH], part[BOUND] = low - step, step, bound
                part[ETA], part[RATE] = eta, rate
            before, value, eta, rate = after, reached, place, velocity
    return Least(lowest, where, looks)

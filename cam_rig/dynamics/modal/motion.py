"""The motion of an oscillator on a turning cam at one speed: piece by piece, turn by turn.

Between two joints of the law the response is a polynomial, Σ hₖ Ωᵏ s⁽ᵏ⁾(θ) with hₖ the Taylor
coefficients of the transfer function. Where a derivative of s jumps that polynomial jumps, and
free vibration makes up for it: joints excite the mode, and nothing else does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.free_flight import impulse_at
from cam_rig.dynamics.events.rows import Row, Rows, Stack, zero_rows, zeros
from cam_rig.units import TURN

#: Two terms of the series after the second that are below this part of the largest are rounding.
SETTLED = 1e-14
#: Rounding of the terms may take this part of the output.
LOST, EPS = 1e-5, 2.0**-52
#: Logarithm of what is left of a vibration that has faded: 1e-17.
LEAST = -39.0

Pair = tuple[float, float]
Triple = tuple[float, float, float]
#: Rows of a group's sizes, each of a derivative of s: what it does not exceed in the group; by what
#: it jumps, unsigned, where the group begins and at the joints inside; what ∫|s⁽ᵏ⁾| dθ over the
#: group does not exceed, with the jumps of the derivative before.
LARGEST, JUMP, INNER, WAY = range(4)
#: Numbers of a piece: where it begins and its span (rad), the polynomial's least ordinate and its
#: largest absolute one, the flow from the turn's start to here, what the turn's joints have added
#: to (η, η̇) here, what that contributes to the output at most, what is left of a norm since the
#: turn's start, the polynomial's (η, η̇) here.
BEGIN, SPAN, LOWEST, HIGHEST, FLOW = range(5)
ADDED, OWN, LEFT, CARRIED, NUMBERS = 8, 10, 11, 12, 14


class LawSeries(NamedTuple):
    """A law of n pieces of degree p with all its derivatives; neighbouring ones make g groups."""

    derivatives: Rows  #: ``(p + 2, n (p + 1))``: ordinates of s⁽ᵏ⁾(θ), piece after piece
    jumps: Rows  #: ``(p + 2, n)``: of s⁽ᵏ⁾ at the start of each piece
    breaks: Row  #: ``(n + 1,)``, rad
    alike: list[int]  #: ``(n,)``: which is the first piece of the same span
    groups: list[int]  #: ``(g + 1,)``: with which piece each group begins
    starts: Rows  #: ``(p + 2, n)``: s⁽ᵏ⁾ where each piece begins
    largest: Row  #: ``(p + 2,)``: what |s⁽ᵏ⁾| does not exceed
    sizes: Stack  #: ``(g, 4, p + 2)``, rows as above
    steepest: Rows  #: ``(n, 5)``: what s to its fourth derivative do not exceed in each piece


class Oscillator(NamedTuple):
    """η̈ = −stiffness η − damping η̇ + drive · (s, ṡ, s̈), an output of it, and how long it runs."""

    stiffness: float  #: 1/s²
    damping: float  #: 1/s
    drive: Triple
    place: float  #: what η contributes to the output
    velocity: float  #: what η̇ contributes
    motion: Triple  #: what (s, ṡ, s̈) contributes
    constant: float
    duration: float  #: s from rest at θ = 0; infinite in steady state


class Series(NamedTuple):
    """Taylor coefficients hₖ, ``(p + 1,)`` each."""

    own: Row  #: of η
    output: Row


class Norm(NamedTuple):
    """A size of free (η, η̇) that fades as e^{−decay t}: √((rate η)² + (η̇ + half η)²)."""

    half: float  #: half of the mode's damping, 1/s
    rate: float  #: 1/s
    decay: float  #: 1/s
    faster: float  #: by what d/dt multiplies it at most, 1/s
    reach: float  #: what the output does not exceed for a unit of it


class OscillatorMotion(NamedTuple):
    """A mode at one speed."""

    speed: float  #: rad/s
    norm: Norm
    pieces: Rows  #: ``(n, 14)``, numbers as above
    flows: Rows  #: ``(n, 5)``: e^{At} over each piece that is the first of its span, and its norm
    forced: Row  #: ``(n (p + 1),)``: ordinates of the output's polynomial part
    lowest: Row  #: ``(g,)``: its least ordinate in each group
    starts: Rows  #: ``(t, 2)``: free (η, η̇) where turns begin, until the motion repeats or ends
    most: float  #: what these contribute to the output at most


#: The rate of a norm is at least this part of the damping's half, where two rates become one.
CRITICAL = 0.5


def norm_of(mode: Oscillator) -> Norm:
    """The norm that fades as the slower rate does, or not much slower near critical damping."""
    half = 0.5 * mode.damping
    square = mode.stiffness - half * half
    root = math.sqrt(abs(square))
    rate = max(root, CRITICAL * half)
    if square < 0.0 and rate == root:
        decay = mode.stiffness / (half + root)
    else:
        decay = half - 0.5 * abs(rate * rate - square) / rate
    away, velocity = mode.place - half * mode.velocity, mode.velocity
    reach = math.sqrt((away / rate) * (away / rate) + velocity * velocity)
    return Norm(half, rate, decay, norm(-half, rate, -square / rate, -half), reach)


def amplitude(size: Norm, state: Pair) -> float:
    """The norm of free (η, η̇)."""
    place, velocity = size.rate * state[0], state[1] + size.half * state[0]
    return math.sqrt(place * place + velocity * velocity)


def norm(a: float, b: float, c: float, d: float) -> float:
    """By what a matrix, row by row, makes a vector longer at most."""
    squares, product = a * a + b * b + c * c + d * d, a * d - b * c
    apart = max(0.0, squares * squares - 4.0 * product * product)
    return math.sqrt(0.5 * (squares + math.sqrt(apart)))


def series_of(mode: Oscillator, count: int) -> Series:
    """The first ``count`` coefficients, by long division."""
    own, output = zeros(count), zeros(count)
    for k in range(count):
        rest = mode.drive[k] if k < 3 else 0.0
        if k > 0:
            rest -= mode.damping * own[k - 1]
        if k > 1:
            rest -= own[k - 2]
        own[k] = rest / mode.stiffness
        output[k] = mode.place * own[k] + (mode.motion[k] if k < 3 else 0.0)
        if k > 0:
            output[k] += mode.velocity * own[k - 1]
    return Series(own, output)


def resolved(law: LawSeries, series: Series, speed: float) -> bool:
    """Whether rounding leaves the output its digits.

    Where the mode has few periods in a short piece of high degree, the terms grow and cancel
    against the free vibration.
    """
    power, most, first = 1.0, 0.0, 0.0
    for k in range(len(series.output)):
        size = abs(series.output[k]) * power * law.largest[k]
        most = max(most, size)
        if k < 3:
            first = most
        power *= speed
    return EPS * most <= LOST * first


def term_count(law: LawSeries, series: Series, speed: float) -> int:
    """Terms of the series up to where it has settled."""
    power, most, small = 1.0, 0.0, False
    for k in range(len(series.output)):
        size = abs(series.output[k]) * power * law.largest[k]
        most = max(most, size)
        settled = size <= SETTLED * most
        if k > 2 and settled and small:
            return k
        small = settled
        power *= speed
    return len(series.output)


def forced_states(series: Series, rows: Rows, speed: float, terms: int) -> Rows:
    """η and η̇ of polynomials, ``(2, n)``, where s⁽ᵏ⁾ or its jumps are ``rows`` ``(p + 2, n)``."""
    out, power = zero_rows(2, len(rows[0])), 1.0
    for k in range(terms):
        weight = series.own[k] * power
        add_scaled(out[0], weight, rows[k])
        add_scaled(out[1], weight * speed, rows[k + 1])
        power *= speed
    return out


def add_scaled(out: Row, scale: float, row: Row) -> None:
    """Add a multiple of a row: long ones, as compiled code takes several numbers at once."""
    for i in range(len(out)):
        out[i] += scale * row[i]


def moved(flow: Row, first: int, state: Pair) -> Pair:
    """A flow, from place ``first`` of a row on, times (η, η̇)."""
    place = flow[first] * state[0] + flow[first + 1] * state[1]
    return place, flow[first + 2] * state[0] + flow[first + 3] * state[1]


def motion_at(law: LawSeries, mode: Oscillator, series: Series, speed: float) -> OscillatorMotion:
    """The mode at a speed (rad/s)."""
    count, size, fading = len(law.alike), len(series.own), norm_of(mode)
    terms = term_count(law, series, speed)
    forced = _polynomials(law, series, mode.constant, speed, terms)
    jumps = forced_states(series, law.jumps, speed, terms)
    carried = forced_states(series, law.starts, speed, terms)
    pieces, flows = zero_rows(count, NUMBERS), zero_rows(count, 5)
    state, left, whole = (0.0, 0.0), 1.0, zeros(4)
    whole[0], whole[3] = 1.0, 1.0
    for i in range(count):
        numbers, flow = pieces[i], flows[law.alike[i]]
        numbers[BEGIN], numbers[SPAN] = law.breaks[i], law.breaks[i + 1] - law.breaks[i]
        if law.alike[i] == i:
            flow_over(mode, numbers[SPAN] / speed, flow)
            flow[4] = math.exp(-fading.decay * numbers[SPAN] / speed)
        if i > 0:
            state = state[0] - jumps[0][i], state[1] - jumps[1][i]
        for j in range(4):
            numbers[FLOW + j] = whole[j]
        numbers[ADDED], numbers[ADDED + 1] = state
        numbers[CARRIED], numbers[CARRIED + 1] = carried[0][i], carried[1][i]
        numbers[OWN], numbers[LEFT] = fading.reach * amplitude(fading, state), left
        lowest, highest = forced[i * size], forced[i * size]
        for j in range(i * size + 1, (i + 1) * size):
            lowest, highest = min(lowest, forced[j]), max(highest, forced[j])
        numbers[LOWEST], numbers[HIGHEST] = lowest, max(abs(lowest), abs(highest))
        state, (a, b, c, d) = moved(flow, 0, state), (whole[0], whole[1], whole[2], whole[3])
        whole[0], whole[1] = flow[0] * a + flow[1] * c, flow[0] * b + flow[1] * d
        whole[2], whole[3] = flow[2] * a + flow[3] * c, flow[2] * b + flow[3] * d
        left *= flow[4]
    turn, begin = (state[0] - jumps[0][0], state[1] - jumps[1][0]), (carried[0][0], carried[1][0])
    starts = _starts(mode, fading, speed, begin, whole, turn)
    floors, most = zeros(len(law.sizes)), 0.0
    for start in starts:
        most = max(most, fading.reach * amplitude(fading, (start[0], start[1])))
    for g in range(len(floors)):
        floors[g] = math.inf
        for i in range(law.groups[g], law.groups[g + 1]):
            floors[g] = min(floors[g], pieces[i][LOWEST])
    return OscillatorMotion(speed, fading, pieces, flows, forced, floors, starts, most)


def _polynomials(law: LawSeries, series: Series, constant: float, speed: float, terms: int) -> Row:
    """Ordinates of the output's polynomials, piece after piece."""
    out, power = zeros(len(law.derivatives[0])), 1.0
    for j in range(len(out)):
        out[j] = constant
    for k in range(terms):
        add_scaled(out, series.output[k] * power, law.derivatives[k])
        power *= speed
    return out


def flow_over(mode: Oscillator, time: float, out: Row) -> None:
    """e^{At} of (η, η̇) over a time (s), row by row."""
    impulse, rate, _ = impulse_at(mode.damping, mode.stiffness, time)
    out[0], out[1] = rate + mode.damping * impulse, impulse
    out[2], out[3] = -mode.stiffness * impulse, rate


def _starts(mode: Oscillator, size: Norm, speed: float, begin: Pair, flow: Row, turn: Pair) -> Rows:
    """Free (η, η̇) where each turn begins; ``begin`` is the polynomial's where the run does."""
    if math.isinf(mode.duration):
        a, d = 1.0 - flow[0], 1.0 - flow[3]
        divisor, steady = a * d - flow[1] * flow[2], zero_rows(1, 2)
        steady[0][0] = (d * turn[0] + flow[1] * turn[1]) / divisor
        steady[0][1] = (flow[2] * turn[0] + a * turn[1]) / divisor
        return steady
    turns, once = max(1, math.ceil(speed * mode.duration / TURN)), size.decay * TURN / speed
    if once * turns > -LEAST:
        turns = 1 + math.ceil(-LEAST / once)
    starts = zero_rows(turns, 2)
    starts[0][0], starts[0][1] = -begin[0], -begin[1]
    for i in range(1, turns):
        place, rate = starts[i - 1][0], starts[i - 1][1]
        starts[i][0] = flow[0] * place + flow[1] * rate + turn[0]
        starts[i][1] = flow[2] * place + flow[3] * rate + turn[1]
    return starts


def end_of(motion: OscillatorMotion, duration: float) -> float:
    """Where a run (s) ends, or what follows is as before; rad."""
    return min(len(motion.starts) * TURN, motion.speed * duration)

"""The motion of an oscillator on a turning cam at one speed: piece by piece, turn by turn.

Between two joints of the law the response is a polynomial, Σ hₖ Ωᵏ s⁽ᵏ⁾(θ) with hₖ the Taylor
coefficients of the transfer function. Where a derivative of s jumps that polynomial jumps, and
free vibration makes up for it: joints excite the mode, and nothing else does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.free_flight import compute_impulse_response
from cam_rig.laws.rows import Row, Rows, Stack, zeros
from cam_rig.units import TURN

#: Two terms of the series after the second that are below this part of the largest are rounding.
SETTLED = 1e-14
#: Rounding of the terms may take this part of the output.
LOST, EPS = 1e-5, 2.0**-52
#: Logarithm of what is left of a vibration that has faded: 1e-17.
LEAST = -39.0

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]
#: Rows of sizes, each of a derivative of s: what it does not exceed in a group; by what it jumps,
#: unsigned, where the group begins and at the joints inside.
LARGEST, JUMP, INNER = range(3)


class LawSeries(NamedTuple):
    """A law of n pieces of degree p with all its derivatives; neighbouring ones make g groups."""

    derivatives: Stack  #: ``(p + 1, p + 2, n)``: the first ordinates of all s⁽ᵏ⁾(θ), the second, …
    jumps: Rows  #: ``(p + 2, n)``: of s⁽ᵏ⁾ at the start of each piece
    breaks: Row  #: ``(n + 1,)``, rad
    lengths: Row  #: ``(m,)``, rad: spans that differ
    alike: list[int]  #: ``(n,)``: which of them each piece has
    groups: list[int]  #: ``(g + 1,)``: with which piece each group begins
    largest: Row  #: ``(p + 2,)``: what |s⁽ᵏ⁾| does not exceed
    sizes: Stack  #: ``(3, p + 2, g)``, rows as above
    steepest: Rows  #: ``(n, 5)``: what s to its fourth derivative do not exceed in each piece
    harmonics: Row  #: ``(h,)``: what |cₖ| of s = Σ cₖ e^{ikθ} does not exceed, from k = 1 on
    rest: Row  #: ``(h,)``: nor the sum of |cₖ|/k from each of them to infinity
    beyond: Row  #: what no |cₖ| exceeds from k = h + 1 on, and from each time as far again


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


class ModeOnLaw(NamedTuple):
    """A mode that a law excites."""

    law: LawSeries
    mode: Oscillator
    series: Series


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
    own: Row  #: terms of the series of η at this speed, up to where it has settled
    forced: Rows  #: ``(p + 1, n)``: ordinates of the output's polynomial part
    lowest: Row  #: ``(n,)``: the least of each piece
    group_lowest: Row  #: ``(g,)``: and of each group
    highest: Row  #: ``(n,)``: the largest absolute one of each piece
    flows: Rows  #: ``(m, 5)``: e^{At} over each length, and its norm
    whole: Rows  #: ``(4, n)``: the flow from the turn's start to each piece
    added: Rows  #: ``(2, n)``: (η, η̇) that the turn's joints have added there
    lefts: Row  #: ``(n,)``: what is left there of a norm since the turn's start
    starts: Rows  #: ``(t, 2)``: free (η, η̇) where turns begin, until the motion repeats or ends
    settled: Pair  #: (η, η̇) where a turn begins once the motion repeats; infinite if never
    floors: Row  #: ``(n,)``: what the output is not below in each piece, in any turn


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


def on_law(law: LawSeries, mode: Oscillator) -> ModeOnLaw:
    """The mode on a law, with as many coefficients as a piece has derivatives: long division."""
    count = len(law.jumps) - 1
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
    return ModeOnLaw(law, mode, Series(own, output))


def resolved(run: ModeOnLaw, speed: float) -> bool:
    """Whether rounding leaves the output its digits.

    Where the mode has few periods in a short piece of high degree, the terms grow and cancel
    against the free vibration.
    """
    output, largest, power, most, first = run.series.output, run.law.largest, 1.0, 0.0, 0.0
    for k in range(len(output)):
        most = max(most, abs(output[k]) * power * largest[k])
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


def state_at(law: LawSeries, own: Row, speed: float, piece: int) -> Pair:
    """η and η̇ of the polynomial where a piece begins."""
    place, rate = 0.0, 0.0
    for k in range(len(own)):
        place += own[k] * law.derivatives[0][k][piece]
        rate += own[k] * law.derivatives[0][k + 1][piece]
    return place, rate * speed


def add_all(out: Row, weights: Row, rows: Rows, first: int) -> None:
    """Add rows from ``first`` on, each so many times: compiled code takes several numbers at once.

    Two rows at a time, for what is added up is then read and written half as often.
    """
    for k in range(0, len(weights) - 1, 2):
        a, b, one, other = weights[k], weights[k + 1], rows[first + k], rows[first + k + 1]
        for i in range(len(out)):
            out[i] += a * one[i] + b * other[i]
    if len(weights) % 2 == 1:
        a, one = weights[-1], rows[first + len(weights) - 1]
        for i in range(len(out)):
            out[i] += a * one[i]


def scaled(terms: Row, count: int, speed: float) -> Row:
    """The first terms of a series times powers of the speed, ``(count,)``."""
    out, power = zeros(count), 1.0
    for k in range(count):
        out[k] = terms[k] * power
        power *= speed
    return out


def moved(flow: Row, state: Pair) -> Pair:
    """A flow times (η, η̇)."""
    place = flow[0] * state[0] + flow[1] * state[1]
    return place, flow[2] * state[0] + flow[3] * state[1]


def motion_at(run: ModeOnLaw, speed: float) -> OscillatorMotion:
    """The mode at a speed (rad/s)."""
    law, mode, series = run
    count, fading = len(law.alike), norm_of(mode)
    terms = term_count(law, series, speed)
    flows, lowest, highest = zeros((len(law.lengths), 5)), zeros(count), zeros(count)
    for m in range(len(flows)):
        flow_over(mode, law.lengths[m] / speed, flows[m])
        flows[m][4] = math.exp(-fading.decay * law.lengths[m] / speed)
    weights, own = scaled(series.output, terms, speed), scaled(series.own, terms, speed)
    forced = _polynomials(law, weights, mode.constant, lowest, highest)
    group_lowest = zeros(len(law.groups) - 1)
    for g in range(len(group_lowest)):
        group_lowest[g] = lowest[law.groups[g]]
        for i in range(law.groups[g], law.groups[g + 1]):
            group_lowest[g] = min(group_lowest[g], lowest[i])
    jumps = zeros((2, count))
    for k in range(2):  # of the polynomial's η, and of its η̇
        add_all(jumps[k], own, law.jumps, k)
    for i in range(count):
        jumps[1][i] *= speed
    whole, lefts, floors = zeros((4, count)), zeros(count), zeros(count)
    turn, flow = _along(law, flows, jumps, whole, lefts)
    begin = state_at(law, own, speed, 0)
    repeated = _repeated(flow, turn)
    starts, most = _starts(mode, fading, speed, begin, flow, turn, repeated), 0.0
    for start in starts:
        most = max(most, fading.reach * amplitude(fading, (start[0], start[1])))
    places, rates, rate, half = jumps[0], jumps[1], fading.rate, fading.half
    for i in range(count):
        place, velocity = rate * places[i], rates[i] + half * places[i]
        ringing = fading.reach * math.sqrt(place * place + velocity * velocity)
        floors[i] = lowest[i] - ringing - most * lefts[i]
    cam = (speed, fading, own, forced, lowest, group_lowest, highest)
    settled = begin[0] + repeated[0], begin[1] + repeated[1]
    return OscillatorMotion(*cam, flows, whole, jumps, lefts, starts, settled, floors)


def _along(
    law: LawSeries, flows: Rows, added: Rows, whole: Rows, lefts: Row
) -> tuple[Pair, Quadruple]:
    """Go along the turn: from jumps in ``added`` to what they have added, and the flow up to there.

    What is returned is both at the turn's end.
    """
    places, rates, last = added[0], added[1], (added[0][0], added[1][0])
    place, rate, a, b, c, d, left = last[0], last[1], 1.0, 0.0, 0.0, 1.0, 1.0
    whole_a, whole_b, whole_c, whole_d = whole[0], whole[1], whole[2], whole[3]
    for i in range(len(lefts)):
        place, rate = place - places[i], rate - rates[i]
        places[i], rates[i], lefts[i] = place, rate, left
        whole_a[i], whole_b[i], whole_c[i], whole_d[i] = a, b, c, d
        flow = flows[law.alike[i]]
        p, q, r, s = flow[0], flow[1], flow[2], flow[3]
        place, rate = p * place + q * rate, r * place + s * rate
        a, b, c, d = p * a + q * c, p * b + q * d, r * a + s * c, r * b + s * d
        left *= flow[4]
    return (place - last[0], rate - last[1]), (a, b, c, d)


def _polynomials(law: LawSeries, weights: Row, constant: float, lowest: Row, highest: Row) -> Rows:
    """Ordinates of the output's polynomials; the least, the largest absolute one of each piece."""
    out = zeros((len(law.derivatives), len(lowest)))
    for j in range(len(out)):
        row = out[j]
        for i in range(len(row)):
            row[i] = constant
        add_all(row, weights, law.derivatives[j], 0)
        if j == 0:
            for i in range(len(row)):
                lowest[i], highest[i] = row[i], abs(row[i])
        else:
            for i in range(len(row)):
                lowest[i], highest[i] = min(lowest[i], row[i]), max(highest[i], abs(row[i]))
    return out


def flow_over(mode: Oscillator, time: float, out: Row) -> None:
    """e^{At} of (η, η̇) over a time (s), row by row."""
    impulse, rate, _ = compute_impulse_response(mode.damping, mode.stiffness, time)
    out[0], out[1] = rate + mode.damping * impulse, impulse
    out[2], out[3] = -mode.stiffness * impulse, rate


def _repeated(flow: Quadruple, turn: Pair) -> Pair:
    """Free (η, η̇) that a turn leaves as it was; infinite where it leaves any so."""
    a, d = 1.0 - flow[0], 1.0 - flow[3]
    divisor = a * d - flow[1] * flow[2]
    if divisor == 0.0:
        return math.inf, math.inf
    place, rate = d * turn[0] + flow[1] * turn[1], flow[2] * turn[0] + a * turn[1]
    return place / divisor, rate / divisor


def _starts(
    mode: Oscillator,
    size: Norm,
    speed: float,
    begin: Pair,
    flow: Quadruple,
    turn: Pair,
    repeated: Pair,
) -> Rows:
    """Free (η, η̇) where each turn begins; ``begin`` is the polynomial's where the run does."""
    if math.isinf(mode.duration):
        steady = zeros((1, 2))
        steady[0][0], steady[0][1] = repeated
        return steady
    turns, once = max(1, math.ceil(speed * mode.duration / TURN)), size.decay * TURN / speed
    if once * turns > -LEAST:
        turns = 1 + math.ceil(-LEAST / once)
    starts = zeros((turns, 2))
    starts[0][0], starts[0][1] = -begin[0], -begin[1]
    for i in range(1, turns):
        place, rate = starts[i - 1][0], starts[i - 1][1]
        starts[i][0] = flow[0] * place + flow[1] * rate + turn[0]
        starts[i][1] = flow[2] * place + flow[3] * rate + turn[1]
    return starts


def end_of(motion: OscillatorMotion, duration: float) -> float:
    """Where a run (s) ends, or what follows is as before; rad."""
    return min(len(motion.starts) * TURN, motion.speed * duration)

"""Masses in the air, one flight at a time: where they are, and the acceleration in a window.

The physics is that of `cam_rig.dynamics.linear.exponential`, which gives the samples of a flight.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.laws.polynomials import restricted
from cam_rig.laws.rows import Row, Rows, dot, zeros

#: Below this time, in units of the fastest rate, the power series is used, of so many terms.
SHORT, SERIES_TERMS = 0.5, 18
#: Two terms of the series below this are the last: the first is 1.
LEAST = 2.0**-62

Response = tuple[float, float, float]


def impulse_at(damping: float, stiffness: float, time: float) -> Response:
    """S (s), Ṡ (1) and ∫S (s²) of ẍ + 2δ ẋ + κ x = 0 at a time in s; 2δ in 1/s, κ in 1/s²."""
    if damping * time <= SHORT and stiffness * time * time <= SHORT * SHORT:
        return _series(damping * time, stiffness * time * time, time)
    decay = 0.5 * damping
    square = stiffness - decay * decay
    if square > 0.0:
        return _oscillating(decay, math.sqrt(square), stiffness, time)
    return _creeping(decay, math.sqrt(-square), stiffness, time)


def _series(damping: float, stiffness: float, time: float) -> Response:
    """Taylor's series in the time as the unit; its terms follow from the equation of motion."""
    term, before, impulse, step = 1.0, 0.0, 0.0, 0.0
    for i in range(2, SERIES_TERMS + 1):
        inverse = 1.0 / i
        further = term * inverse
        impulse += term
        step += further
        before, term = further, -(damping * further + stiffness * before * inverse)
        if abs(before) + abs(term) < LEAST:
            break
    return impulse * time, 1.0 - damping * impulse - stiffness * step, step * time * time


def _oscillating(decay: float, rate: float, stiffness: float, time: float) -> Response:
    envelope = math.exp(-decay * time)
    impulse = envelope * math.sin(rate * time) / rate
    slope = envelope * math.cos(rate * time) - decay * impulse
    return impulse, slope, (1.0 - slope - 2.0 * decay * impulse) / stiffness


def _creeping(decay: float, root: float, stiffness: float, time: float) -> Response:
    """Overdamped or critical: never a growing exponential."""
    fast = decay + root
    slow, apart = stiffness / fast, 2.0 * root
    growth = -math.expm1(-apart * time) / apart if apart > 0.0 else time
    impulse = math.exp(-slow * time) * growth
    slope = math.exp(-fast * time) - slow * impulse
    if slow > 0.1 * fast:
        return impulse, slope, (1.0 - slope - 2.0 * decay * impulse) / stiffness
    settled = -math.expm1(-slow * time) / slow if slow > 0.0 else time
    return impulse, slope, (settled + math.expm1(-fast * time) / fast) / apart


#: |A| t of a window; up to `SMALL` the exponential of a matrix is a series of so many terms.
REACH, SMALL, TERMS = 2.0, 0.5, 18
#: Places in a free system's rows, of up to four states: the matrix A, the load b, the row, the
#: energy, V and its inverse, the pairs' damping and stiffness, the inverse times the load, row and
#: energy times V, the series; as in `FreeSystem`.
MATRIX, LOAD, ROW, ENERGY, SHAPES, INVERSE = 0, 4, 5, 6, 10, 14

DAMPING, STIFFNESS, DRIFT, SEEN, SERIES = 18, 19, 20, 21, 26


class FreeTable(NamedTuple):
    """Numbers of a `FreeSystem` of n states."""

    rows: Rows  #: ``(51, n)``
    window: float  #: s
    paired: bool  #: whether there are pairs; without them their rows are not used


class LiftOffState(NamedTuple):
    """The state at lift-off."""

    free: FreeTable
    start: Row  #: ``(n,)``
    rates: Row  #: ẋ there
    pairs: Rows  #: its numbers by pairs, ``(m, 3)``


class Moved(NamedTuple):
    """X − x₀ and ẋ, ``(n,)`` each."""

    way: Row
    rates: Row


def lift_off_state(free: FreeTable, start: Row) -> LiftOffState:
    """The flight from a state ``(n,)``."""
    rows, size = free.rows, len(start)
    rates = product(rows, MATRIX, start)
    for i in range(size):
        rates[i] += rows[LOAD][i]
    pairs = zeros((size // 2, 3))
    if free.paired:
        own = product(rows, INVERSE, start)
        for i in range(size // 2):
            place, velocity = own[2 * i], own[2 * i + 1]
            damping, stiffness = rows[DAMPING][i], rows[STIFFNESS][i]
            gain, push = rows[DRIFT][2 * i], rows[DRIFT][2 * i + 1]
            pairs[i][0] = velocity + gain
            pairs[i][1] = stiffness * place - push - damping * gain
            pairs[i][2] = -stiffness * place - damping * velocity + push
    return LiftOffState(free, start, rates, pairs)


def product(rows: Rows, first: int, column: Row) -> Row:
    """The square matrix from a row on, times a column."""
    out = zeros(len(column))
    for i in range(len(column)):
        out[i] = dot(rows[first + i], column)
    return out


def place_of(lift_off: LiftOffState, state: Row) -> float:
    """What a state ``(n,)``, or its rate, says of the mass that meets the cam."""
    return dot(lift_off.free.rows[ROW], state)


def moved(lift_off: LiftOffState, time: float) -> Moved:
    """How far the states have come, and their rates, at a time in s."""
    if not lift_off.free.paired:
        return _by_exponential(lift_off, time)
    rows, size = lift_off.free.rows, len(lift_off.start)
    way, rates = zeros(size), zeros(size)
    for i in range(size // 2):
        way[2 * i], way[2 * i + 1], rates[2 * i], rates[2 * i + 1] = _pair(lift_off, i, time)
    return Moved(product(rows, SHAPES, way), product(rows, SHAPES, rates))


def _pair(lift_off: LiftOffState, i: int, time: float) -> tuple[float, float, float, float]:
    """How far a pair (q, q̇) has come, and its rates."""
    stiffness, pair = lift_off.free.rows[STIFFNESS][i], lift_off.pairs[i]
    impulse, slope, step = impulse_at(lift_off.free.rows[DAMPING][i], stiffness, time)
    rate, pull, force = pair[0], pair[1], pair[2]
    return (
        rate * impulse - pull * step,
        force * impulse - stiffness * rate * step,
        rate * slope - pull * impulse,
        force * slope - stiffness * rate * impulse,
    )


def seen(lift_off: LiftOffState, time: float) -> tuple[float, float, float]:
    """Way (m) and velocity (m/s) of the mass on the cam; what |its acceleration| is below later."""
    if not lift_off.free.paired:
        gone = _by_exponential(lift_off, time)
        way, velocity = place_of(lift_off, gone.way), place_of(lift_off, gone.rates)
        return way, velocity, largest_acceleration(lift_off, gone.rates)
    rows, way, velocity = lift_off.free.rows, 0.0, 0.0
    one, two, three, four = 0.0, 0.0, 0.0, 0.0  # parts of the energy
    for i in range(len(lift_off.start) // 2):
        place, further, rate, faster = _pair(lift_off, i, time)
        j = 2 * i
        way += rows[SEEN][j] * place + rows[SEEN][j + 1] * further
        velocity += rows[SEEN][j] * rate + rows[SEEN][j + 1] * faster
        one += rows[SEEN + 1][j] * rate + rows[SEEN + 1][j + 1] * faster
        two += rows[SEEN + 2][j] * rate + rows[SEEN + 2][j + 1] * faster
        three += rows[SEEN + 3][j] * rate + rows[SEEN + 3][j + 1] * faster
        four += rows[SEEN + 4][j] * rate + rows[SEEN + 4][j + 1] * faster
    return way, velocity, math.sqrt(one * one + two * two + three * three + four * four)


def flow_of(free: FreeTable, time: float, size: int) -> Rows:
    """e^{At}, ``(size, size)``, at a time in s."""
    if not free.paired:
        return _exponential(free, time, size)[0]
    part, rows = zeros((size, size)), free.rows
    for i in range(size // 2):
        damping, stiffness = rows[DAMPING][i], rows[STIFFNESS][i]
        impulse, rate, _ = impulse_at(damping, stiffness, time)
        one, two = rows[INVERSE + 2 * i], rows[INVERSE + 2 * i + 1]
        for j in range(size):
            part[2 * i][j] = (rate + damping * impulse) * one[j] + impulse * two[j]
            part[2 * i + 1][j] = rate * two[j] - stiffness * impulse * one[j]
    return _times(rows[SHAPES : SHAPES + size], part, 1.0)


def _by_exponential(lift_off: LiftOffState, time: float) -> Moved:
    """The same where pairs are too much alike, and lose their digits: (P ẋ₀, E ẋ₀)."""
    flow, gone = _exponential(lift_off.free, time, len(lift_off.start))
    return Moved(product(gone, 0, lift_off.rates), product(flow, 0, lift_off.rates))


def _exponential(free: FreeTable, time: float, size: int) -> tuple[Rows, Rows]:
    """E = e^{At} and its integral P by scaling and squaring: twice the time is E², and P + E P."""
    rows = free.rows
    reach, doublings = abs(time) * REACH / free.window, 0
    while reach > SMALL:
        reach, doublings = 0.5 * reach, doublings + 1
    part = time
    for _ in range(doublings):
        part *= 0.5
    flow, gone, term = zeros((size, size)), zeros((size, size)), zeros((size, size))
    for i in range(size):
        flow[i][i], gone[i][i], term[i][i] = 1.0, part, 1.0
    for order in range(1, TERMS):
        term = _times(rows, term, part / order)
        _add(flow, term, 1.0)
        _add(gone, term, part / (order + 1))
    for _ in range(doublings):
        _add(gone, _times(flow, gone, 1.0), 1.0)
        flow = _times(flow, flow, 1.0)
    return flow, gone


def _times(one: Rows, other: Rows, scale: float) -> Rows:
    size = len(other)
    out = zeros((size, size))
    for i in range(size):
        for j in range(size):
            total = 0.0
            for k in range(size):
                total += one[i][k] * other[k][j]
            out[i][j] = scale * total
    return out


def _add(one: Rows, other: Rows, scale: float) -> None:
    for i in range(len(one)):
        for j in range(len(one)):
            one[i][j] += scale * other[i][j]


def largest_acceleration(lift_off: LiftOffState, rates: Row) -> float:
    """What |acceleration| (m/s²) does not exceed from a time with these rates on: energy falls."""
    total = 0.0
    for i in range(len(rates)):
        part = dot(lift_off.free.rows[ENERGY + i], rates)
        total += part * part
    return math.sqrt(total)


def accelerations(lift_off: LiftOffState, rates: Row, length: float) -> Row:
    """Bernstein ordinates of the acceleration (m/s²) in ``length`` s, up to a window."""
    rows, size = lift_off.free.rows, len(lift_off.free.rows) - SERIES
    ordinates = zeros(size)
    for j in range(size):
        ordinates[j] = dot(rows[SERIES + j], rates)
    part = length / lift_off.free.window
    return ordinates if part >= 1.0 else restricted(ordinates, size, 0.0, part)

"""By how much the output may sag below its chord over a step of the speed, group by group.

At a cam angle of a run the output is a smooth function of the speed. A vibration that was excited
with amplitude N a time t ago is N e^{At}, with A t = A τ/Ω for the cam angle τ since, so its second
derivative grows with t² and fades with e^{−decay t}: Σ N tᵠ e^{−decay t} is carried from group to
group. What excites is counted in two ways, of which the better one holds for each group: the jumps
at joints, which free vibration makes up for; and all that the law's motion does, ∫ e^{A τ/Ω} u dθ.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.rows import Row, Rows, dot, zero_rows, zeros
from cam_rig.dynamics.modal.motion import (
    INNER,
    JUMP,
    LARGEST,
    WAY,
    LawSeries,
    Norm,
    Oscillator,
    Series,
)
from cam_rig.units import TURN

#: Numbers of a group's sag over a step w: B of all for B w²/8, what vibrations do not exceed, B of
#: the polynomial part alone.
BENT, FREE, FORCED = range(3)
#: A second derivative, or a part that fades in a turn, below this is none.
TINY = 1e-100
#: Sums over what was excited: of N tᵠ for q = 0, 1 and 2, of N' for 0 and 1, of N'', where N' and
#: N'' are dN/dΩ and d²N/dΩ².
SIZE, AGE, AGE_2, SLOPE, SLOPE_AGE, BEND, SUMS = range(7)


class Times(NamedTuple):
    """Between which speeds (rad/s), and how long (s) the run is."""

    low: float
    high: float
    duration: float


def sags_between(
    law: LawSeries, mode: Oscillator, size: Norm, series: Series, low: float, high: float, out: Rows
) -> None:
    """The sags of all groups of a run between two speeds (rad/s), ``(g, 3)``."""
    count, times = len(law.sizes), Times(low, high, mode.duration)
    begins, along, pushed = zero_rows(count, 3), zero_rows(count, 3), zero_rows(count, 3)
    other, none, lefts = zero_rows(count, 3), zero_rows(count, 3), zeros(count)
    weights, bends = _weights(size, series, high), _bends(series, high)
    for i in range(count):
        sizes = law.sizes[i]
        _excited(begins[i], sizes[JUMP], weights)
        _excited(along[i], sizes[INNER], weights)
        _pushed(pushed[i], sizes[WAY], mode, low, high)
        forced = dot(bends, sizes[LARGEST])
        direct = 2.0 * abs(mode.motion[2]) * sizes[LARGEST][2]
        out[i][BENT], out[i][FREE], out[i][FORCED] = forced, 0.0, forced
        other[i][BENT], other[i][FREE], other[i][FORCED] = direct, 0.0, direct
        span = law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]
        lefts[i] = math.exp(-size.decay * span / high)
    start = zeros(3)
    if mode.duration < math.inf:
        still = zeros(len(law.starts))
        for k in range(len(still)):
            still[k] = law.starts[k][0]
        _excited(start, still, weights)
    _vibrate(law, size, times, lefts, begins, along, start, out)
    _vibrate(law, size, times, lefts, none, pushed, zeros(3), other)
    for i in range(count):
        if other[i][BENT] < out[i][BENT]:
            for j in range(3):
                out[i][j] = other[i][j]


def _weights(size: Norm, series: Series, speed: float) -> Rows:
    """What jumps of derivatives add to N, N' and N'' up to a speed, ``(3, p + 2)``."""
    rate, power, count = size.rate + size.half, 1.0, len(series.own)
    out = zero_rows(3, count + 1)
    for k in range(count + 1):
        weight = rate * abs(series.own[k]) if k < count else 0.0
        if k > 0:
            weight += abs(series.own[k - 1])
        weight *= power
        out[0][k], out[1][k] = weight, k * weight / speed
        out[2][k] = k * (k - 1) * weight / (speed * speed)
        power *= speed
    return out


def _bends(series: Series, speed: float) -> Row:
    """What derivatives add to the polynomial's second derivative up to a speed, ``(p + 1,)``."""
    out, power = zeros(len(series.output)), 1.0
    for k in range(2, len(out)):
        out[k] = k * (k - 1) * abs(series.output[k]) * power
        power *= speed
    return out


def _excited(out: Row, sizes: Row, weights: Rows) -> None:
    """N of jumps of such sizes, N' and N''."""
    for i in range(3):
        out[i] += dot(weights[i], sizes)


def _pushed(out: Row, ways: Row, mode: Oscillator, low: float, high: float) -> None:
    """The same of what the law's motion pushes over a group."""
    still, turning = abs(mode.drive[0]) / low * ways[0], abs(mode.drive[2]) * ways[2]
    out[0] = still + abs(mode.drive[1]) * ways[1] + high * turning
    out[1], out[2] = still / low + turning, 2.0 * still / (low * low)


def _vibrate(
    law: LawSeries,
    size: Norm,
    times: Times,
    lefts: Row,
    begins: Rows,
    along: Rows,
    start: Row,
    out: Rows,
) -> None:
    """Add vibrations to the sags: excited where groups begin, along them, and at the start."""
    sums, own, end = zeros(SUMS), zeros(SUMS), times.high * times.duration
    count = len(begins)
    if end > TURN:
        for i in range(count):
            time = (law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]) / times.low
            if i > 0:
                _add(sums, begins[i], 0.0)
            _fade(sums, lefts[i], time)
            _add(sums, along[i], time)
        _add(sums, begins[0], 0.0)
        _repeat(sums, size, times)
    longest = min(times.duration, 1.0 / max(size.decay, TINY))
    _add(sums, start, longest)
    for i in range(count):
        if law.breaks[law.groups[i]] >= end:
            break
        time = (law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]) / times.low
        if i > 0:
            _add(sums, begins[i], 0.0)
        _add_sag(out[i], sums, size, min(time, longest), times.low)
        _fade(sums, lefts[i], time)
        for j in range(SUMS):
            own[j] = 0.0
        _add(own, along[i], time)
        _add_sag(out[i], own, size, 0.0, times.low)
        _add(sums, along[i], time)


def _add(sums: Row, excited: Row, age: float) -> None:
    """Add what was excited so long ago (s)."""
    for i, q in ((SIZE, 0), (SLOPE, 1)):
        sums[i] += excited[q]
        sums[i + 1] += excited[q] * age
    sums[AGE_2] += excited[0] * age * age
    sums[BEND] += excited[2]


def _fade(sums: Row, left: float, time: float) -> None:
    """All is older by a time (s), and this part of it is left."""
    sums[AGE_2] += time * (2.0 * sums[AGE] + time * sums[SIZE])
    sums[AGE] += time * sums[SIZE]
    sums[SLOPE_AGE] += time * sums[SLOPE]
    for i in range(SUMS):
        sums[i] *= left


def _repeat(sums: Row, size: Norm, times: Times) -> None:
    """What a turn has excited becomes what all turns before have; Σ gᵐ mᵠ over m turns."""
    turn, turns = TURN / times.low, times.high * times.duration / TURN
    left = math.exp(-size.decay * TURN / times.high)
    endless = 1.0 / max(-math.expm1(-size.decay * TURN / times.high), TINY)
    once = min(turns, endless)
    linear = turn * min(0.5 * turns * turns, left * endless * endless)
    square = left * (1.0 + left) * endless * endless * endless
    square = turn * turn * min(turns * turns * turns / 3.0, square)
    sums[AGE_2] = sums[AGE_2] * once + 2.0 * sums[AGE] * linear + sums[SIZE] * square
    sums[AGE] = sums[AGE] * once + sums[SIZE] * linear
    sums[SLOPE_AGE] = sums[SLOPE_AGE] * once + sums[SLOPE] * linear
    for i in (SIZE, SLOPE, BEND):
        sums[i] *= once


def _add_sag(out: Row, sums: Row, size: Norm, time: float, low: float) -> None:
    """Add the vibration of a group, up to so much (s) older than at its beginning, to its sag."""
    rate = size.faster / low
    age = sums[AGE] + time * sums[SIZE]
    square = sums[AGE_2] + time * (2.0 * sums[AGE] + time * sums[SIZE])
    slope = sums[SLOPE_AGE] + time * sums[SLOPE]
    bent = sums[BEND] + rate * (2.0 * slope + rate * square + 2.0 / low * age)
    out[BENT] += size.reach * bent
    out[FREE] += size.reach * sums[SIZE]

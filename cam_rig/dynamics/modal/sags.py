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

from cam_rig.dynamics.events.rows import Row, Rows, zero_rows, zeros
from cam_rig.dynamics.modal.motion import (
    INNER,
    JUMP,
    LARGEST,
    WAY,
    LawSeries,
    Norm,
    Oscillator,
    Series,
    add_scaled,
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
    """The sags of all groups of a run between two speeds (rad/s), ``(3, g)``."""
    count, times = len(law.groups) - 1, Times(low, high, mode.duration)
    other, lefts, none = zero_rows(3, count), zeros(count), zero_rows(3, count)
    weights, forced = _weights(size, series, high), _forced(law, series, high)
    direct = 2.0 * abs(mode.motion[2])
    for i in range(count):
        out[BENT][i], out[FREE][i], out[FORCED][i] = forced[i], 0.0, forced[i]
        other[BENT][i] = other[FORCED][i] = direct * law.sizes[LARGEST][2][i]
        span = law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]
        lefts[i] = math.exp(-size.decay * span / high)
    begins, along = _excited(law.sizes[JUMP], weights), _excited(law.sizes[INNER], weights)
    start = zeros(3)
    if mode.duration < math.inf:
        for k in range(len(weights[0])):
            still = abs(law.derivatives[k][0][0])
            for i in range(3):
                start[i] += weights[i][k] * still
    _vibrate(law, size, times, lefts, begins, along, start, out)
    pushed = _pushed(law.sizes[WAY], mode, low, high)
    _vibrate(law, size, times, lefts, none, pushed, zeros(3), other)
    for i in range(count):
        if other[BENT][i] < out[BENT][i]:
            for j in range(3):
                out[j][i] = other[j][i]


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


def _forced(law: LawSeries, series: Series, speed: float) -> Row:
    """What the polynomial's second derivative does not exceed up to a speed, group by group."""
    out, power = zeros(len(law.groups) - 1), 1.0
    for k in range(2, len(series.output)):
        add_scaled(out, k * (k - 1) * abs(series.output[k]) * power, law.sizes[LARGEST][k])
        power *= speed
    return out


def _excited(sizes: Rows, weights: Rows) -> Rows:
    """N of jumps of such sizes, N' and N'', group by group."""
    out = zero_rows(3, len(sizes[0]))
    for i in range(3):
        for k in range(len(sizes)):
            add_scaled(out[i], weights[i][k], sizes[k])
    return out


def _pushed(ways: Rows, mode: Oscillator, low: float, high: float) -> Rows:
    """The same of what the law's motion pushes over a group."""
    drive, out = mode.drive, zero_rows(3, len(ways[0]))
    add_scaled(out[0], abs(drive[0]) / low, ways[0])
    add_scaled(out[0], abs(drive[1]), ways[1])
    add_scaled(out[0], high * abs(drive[2]), ways[2])
    add_scaled(out[1], abs(drive[0]) / (low * low), ways[0])
    add_scaled(out[1], abs(drive[2]), ways[2])
    add_scaled(out[2], 2.0 * abs(drive[0]) / (low * low * low), ways[0])
    return out


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
    count = len(lefts)
    if end > TURN:
        for i in range(count):
            time = (law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]) / times.low
            if i > 0:
                _add(sums, begins[0][i], begins[1][i], begins[2][i], 0.0)
            _fade(sums, lefts[i], time)
            _add(sums, along[0][i], along[1][i], along[2][i], time)
        _add(sums, begins[0][0], begins[1][0], begins[2][0], 0.0)
        _repeat(sums, size, times)
    longest = min(times.duration, 1.0 / max(size.decay, TINY))
    _add(sums, start[0], start[1], start[2], longest)
    for i in range(count):
        if law.breaks[law.groups[i]] >= end:
            break
        time = (law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]) / times.low
        if i > 0:
            _add(sums, begins[0][i], begins[1][i], begins[2][i], 0.0)
        _add_sag(out, i, sums, size, min(time, longest), times.low)
        _fade(sums, lefts[i], time)
        for j in range(SUMS):
            own[j] = 0.0
        _add(own, along[0][i], along[1][i], along[2][i], time)
        _add_sag(out, i, own, size, 0.0, times.low)
        _add(sums, along[0][i], along[1][i], along[2][i], time)


def _add(sums: Row, excited: float, slope: float, bend: float, age: float) -> None:
    """Add N, N' and N'' of what was excited so long ago (s)."""
    sums[SIZE] += excited
    sums[AGE] += excited * age
    sums[AGE_2] += excited * age * age
    sums[SLOPE] += slope
    sums[SLOPE_AGE] += slope * age
    sums[BEND] += bend


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


def _add_sag(out: Rows, group: int, sums: Row, size: Norm, time: float, low: float) -> None:
    """Add the vibration of a group, up to so much (s) older than at its beginning, to its sag."""
    rate = size.faster / low
    age = sums[AGE] + time * sums[SIZE]
    square = sums[AGE_2] + time * (2.0 * sums[AGE] + time * sums[SIZE])
    slope = sums[SLOPE_AGE] + time * sums[SLOPE]
    bent = sums[BEND] + rate * (2.0 * slope + rate * square + 2.0 / low * age)
    out[BENT][group] += size.reach * bent
    out[FREE][group] += size.reach * sums[SIZE]

"""By how much the output may sag below its chord over a step of the speed, group by group.

At a cam angle of a run the output is a smooth function of the speed. A vibration that was excited
with amplitude N a time t ago is N e^{At}, with A t = A τ/Ω for the cam angle τ since, so its second
derivative grows with t² and fades with e^{−decay t}: Σ N tᵠ e^{−decay t} is carried from group to
group. What excites are the jumps at joints, which free vibration makes up for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.modal.motion import (
    INNER,
    JUMP,
    LARGEST,
    LawSeries,
    Norm,
    Oscillator,
    Series,
    add_all,
)
from cam_rig.laws.rows import Row, Rows, zero_rows, zeros
from cam_rig.units import TURN

#: Numbers of a group's sag over a step w: B of all for B w²/8, what vibrations do not exceed, B of
#: the polynomial part alone.
BENT, FREE, FORCED = range(3)
#: A second derivative, or a part that fades in a turn, below this is none.
TINY = 1e-100
#: Sums over what was excited: of N tᵠ for q = 0, 1 and 2, of N' tᵠ for 0 and 1, of N'', where N'
#: and N'' are dN/dΩ and d²N/dΩ².
Sums = tuple[float, float, float, float, float, float]
NONE: Sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


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
    lefts = zeros(count)
    weights, forced = _weights(size, series, high), _forced(law, series, high)
    for i in range(count):
        out[BENT][i], out[FREE][i], out[FORCED][i] = forced[i], 0.0, forced[i]
        span = law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]
        lefts[i] = math.exp(-size.decay * span / high)
    begins, along = _excited(law.sizes[JUMP], weights), _excited(law.sizes[INNER], weights)
    start = zeros(3)
    if mode.duration < math.inf:
        for k in range(len(weights[0])):
            still = abs(law.derivatives[0][k][0])
            for i in range(3):
                start[i] += weights[i][k] * still
    _vibrate(law, size, times, lefts, begins, along, start, out)


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
    out, weights, power = zeros(len(law.groups) - 1), zeros(len(series.output)), 1.0
    for k in range(2, len(weights)):
        weights[k] = k * (k - 1) * abs(series.output[k]) * power
        power *= speed
    add_all(out, weights, law.sizes[LARGEST], 0)
    return out


def _excited(sizes: Rows, weights: Rows) -> Rows:
    """N of jumps of such sizes, N' and N'', group by group."""
    out = zero_rows(3, len(sizes[0]))
    for i in range(3):
        add_all(out[i], weights[i], sizes, 0)
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
    sums, end = NONE, times.high * times.duration
    count = len(lefts)
    if end > TURN:
        for i in range(count):
            time = (law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]) / times.low
            if i > 0:
                sums = _added(sums, begins[0][i], begins[1][i], begins[2][i], 0.0)
            sums = _faded(sums, lefts[i], time)
            sums = _added(sums, along[0][i], along[1][i], along[2][i], time)
        sums = _added(sums, begins[0][0], begins[1][0], begins[2][0], 0.0)
        sums = _repeated(sums, size, times)
    longest = min(times.duration, 1.0 / max(size.decay, TINY))
    sums = _added(sums, start[0], start[1], start[2], longest)
    for i in range(count):
        if law.breaks[law.groups[i]] >= end:
            break
        time = (law.breaks[law.groups[i + 1]] - law.breaks[law.groups[i]]) / times.low
        if i > 0:
            sums = _added(sums, begins[0][i], begins[1][i], begins[2][i], 0.0)
        own = _added(NONE, along[0][i], along[1][i], along[2][i], time)
        before = _bent(sums, size, min(time, longest), times.low)
        out[BENT][i] += size.reach * (before + _bent(own, size, 0.0, times.low))
        out[FREE][i] += size.reach * (sums[0] + own[0])
        sums = _faded(sums, lefts[i], time)
        sums = _added(sums, along[0][i], along[1][i], along[2][i], time)


def _added(sums: Sums, excited: float, slope: float, bend: float, age: float) -> Sums:
    """With N, N' and N'' of what was excited so long ago (s)."""
    n, n_t, n_tt, d, d_t, dd = sums
    n_t, n_tt, d_t = n_t + excited * age, n_tt + excited * age * age, d_t + slope * age
    return n + excited, n_t, n_tt, d + slope, d_t, dd + bend


def _faded(sums: Sums, left: float, time: float) -> Sums:
    """All is older by a time (s), and this part of it is left."""
    n, n_t, n_tt, d, d_t, dd = sums
    n_tt, n_t, d_t = n_tt + time * (2.0 * n_t + time * n), n_t + time * n, d_t + time * d
    return left * n, left * n_t, left * n_tt, left * d, left * d_t, left * dd


def _repeated(sums: Sums, size: Norm, times: Times) -> Sums:
    """What a turn has excited becomes what all turns before have; Σ gᵐ mᵠ over m turns."""
    turn, turns = TURN / times.low, times.high * times.duration / TURN
    left = math.exp(-size.decay * TURN / times.high)
    endless = 1.0 / max(-math.expm1(-size.decay * TURN / times.high), TINY)
    once = min(turns, endless)
    linear = turn * min(0.5 * turns * turns, left * endless * endless)
    square = left * (1.0 + left) * endless * endless * endless
    square = turn * turn * min(turns * turns * turns / 3.0, square)
    n, n_t, n_tt, d, d_t, dd = sums
    n_tt = n_tt * once + 2.0 * n_t * linear + n * square
    return n * once, n_t * once + n * linear, n_tt, d * once, d_t * once + d * linear, dd * once


def _bent(sums: Sums, size: Norm, time: float, low: float) -> float:
    """B of a vibration up to so much (s) older, for a reach of one."""
    n, n_t, n_tt, d, d_t, dd = sums
    rate, age = size.faster / low, n_t + time * n
    square, slope = n_tt + time * (2.0 * n_t + time * n), d_t + time * d
    return dd + rate * (2.0 * slope + rate * square + 2.0 / low * age)

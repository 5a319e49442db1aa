"""By how much the output may sag below its chord over a step of the speed.

Group by group: at a cam angle of a run the output is a smooth function of the speed. A vibration
that was excited with amplitude N a time t ago is N e^{At}, with A t = A τ/Ω for the cam angle τ
since, so its second derivative grows with t² and fades with e^{−decay t}: Σ N tᵠ e^{−decay t} is
carried from group to group. What excites are the jumps at joints, which free vibration makes up
for.

By harmonics: with s = Σ cₖ e^{ikθ} and λ = −half + i rate, q = η̇ − λ̄ η is the response of q̇ = λ
q + u, and once settled Σ cₖ e^{ikθ} u(λ)/(ikΩ − λ) plus what is linear in Ω. The reciprocal z⁻¹
lies off its chord between z₁ and z₂ by (z − z₁)(z − z₂)/(z₁ z₂ z); and by no more than its largest
value, for it goes along a circle through 0. So a harmonic that is far from resonance adds next to
nothing, however much the law has of others. From rest e^{λt} q(0) is missing, which fades and turns
with the speed: of what a harmonic is off its chord 1 − e^{(λ − ikΩ)t} remains, |λ − ikΩ|/half of it
or less.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.modal.motion import (
    INNER,
    JUMP,
    LARGEST,
    LawSeries,
    ModeOnLaw,
    Norm,
    Oscillator,
    OscillatorMotion,
    Pair,
    Series,
    add_all,
    amplitude,
)
from cam_rig.laws.rows import Row, Rows, zeros
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


def sags_between(run: ModeOnLaw, size: Norm, low: float, high: float, out: Rows) -> None:
    """The sags of all groups of a run between two speeds (rad/s), ``(3, g)``."""
    law, mode, series = run
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
    out = zeros((3, count + 1))
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
    out = zeros((3, len(sizes[0])))
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


# By the law's harmonics.

#: From one of `LawSeries.beyond` to the next; and beyond so many times resonance a harmonic is far.
RATIO, FAR = 2.0**0.25, 3.0
#: What harmonics k that are far add to the sag for cₖ/k, w = 1 and Ω = 1: both signs of k.
FROM_FAR = 0.25 * (1.0 + (FAR / (FAR - 1.0)) ** 3)


class Sag(NamedTuple):
    """Over a step w, a part x of it on, nowhere more than this."""

    below: float  #: by how much a curve lies below its chord
    bow: float  #: the same, over 4 x (1 − x)
    bent: float  #: |d²F/dΩ²| w²/8


def rings(mode: Oscillator, size: Norm) -> bool:
    """Whether a mode vibrates, and settles in the run: else its harmonics tell nothing."""
    return mode.stiffness > 2.0 * size.half * size.half and size.half * mode.duration > 1.0


def settled_sag(run: ModeOnLaw, begin: OscillatorMotion, high: float) -> Sag:
    """Of q from a motion to a speed (rad/s), but for the chord of what a run from rest lacks."""
    mode, size, rate = run.mode, begin.norm, begin.norm.rate
    first, second, third = mode.drive
    real = first - second * size.half + third * (size.half * size.half - rate * rate)
    imaginary = rate * (second - 2.0 * third * size.half)
    excited = math.sqrt(real * real + imaginary * imaginary)
    sag = _of_harmonics(run.law, size, begin.speed, high, mode.duration < math.inf)
    return Sag(excited * sag.below, excited * sag.bow, excited * sag.bent)


def sag_of(run: ModeOnLaw, begin: OscillatorMotion, sag: Sag, settled: Pair, high: float) -> Sag:
    """Of the output, from that of q; at the speed ``high`` the settled motion begins a turn so."""
    mode = run.mode
    size, low, rate = begin.norm, begin.speed, begin.norm.rate
    below, bow, bent = sag
    if mode.duration < math.inf:
        old, change = begin.settled, high / low - 1.0
        by = amplitude(size, (settled[0] - old[0], settled[1] - old[1]))
        most = max(amplitude(size, old), amplitude(size, settled))
        turned = change * (1.0 + change) * math.sqrt(rate * rate + size.half * size.half)
        turned /= size.half
        linear, square = turned * (change * most + by), turned * turned * most
        free = _most_of(0.0, 0.25 * linear, 0.125 * square)
        below, bow = below + min(free, 2.0 * most + 0.5 * by), bow + free
        linear += turned * (change * bent + 4.0 * bent)
        square += turned * turned * bent
        bent += _most_of(bent, 0.25 * linear, 0.125 * square)
    reach, width = size.reach, high - low
    direct = 0.25 * abs(mode.motion[2]) * run.law.largest[2] * width * width
    return Sag(reach * below + direct, reach * bow + direct, reach * bent + direct)


def _of_harmonics(law: LawSeries, size: Norm, low: float, high: float, rest: bool) -> Sag:
    """Of q in steady state for u(λ) = 1; from rest but for the chord of q(0), ``bent`` as settled.

    By each harmonic, up to those that are far.
    """
    rate, square, width = size.rate, size.half * size.half, high - low
    below, bow, bent, far = 0.0, 0.0, 0.0, FROM_FAR * width * width / (low * low * low)
    quarter, count, most, both = 0.25 * width * width, len(law.harmonics), 1.0, 1.0
    if rest:
        most, both = 4.0, 2.0
    for i in range(count):
        k, bound = i + 1.0, law.harmonics[i]
        if k * low > FAR * rate:
            return _with_far(below, bow, bent, far * law.rest[i], both)
        first, last, against = k * low - rate, k * high - rate, k * low + rate
        begin, end, least = first * first, last * last, max(0.0, first, -last)
        near, part = square + least * least, quarter * k * k
        inverse, other = 1.0 / math.sqrt(near), part / (against * against * against)
        arc = part / math.sqrt((square + begin) * (square + end))
        turned = inverse * math.sqrt(min(most, 1.0 + max(begin, end) / square))
        below += bound * (min(arc, 1.0) * turned + both * other)
        bow += bound * (arc * turned + both * other)
        bent += bound * (part / near * inverse + other)
    k = count + 1.0
    for bound in law.beyond:
        if k * low > FAR * rate:
            return _with_far(below, bow, bent, far * bound, both)
        number, last = 1.0 + k * (RATIO - 1.0), k * RATIO
        first, against = max(0.0, k * low - rate, rate - last * high), k * low + rate
        near, part = math.sqrt(square + first * first), quarter * last * last
        once = 2.0 / size.half + 2.0 / low * (1.0 + math.log(number))
        once, steep = min(once, number / near), part / (near * near)
        other = number * part / (against * against * against)
        arcs = min(min(2.0, steep) * once, min(1.0, steep) * number / near)
        below += both * bound * (arcs + other)
        bow += both * bound * (steep * once + other)
        bent += bound * (steep * once + other)
        k = last
    return Sag(math.inf, math.inf, math.inf)


def _with_far(below: float, bow: float, bent: float, far: float, both: float) -> Sag:
    """With what harmonics that are far add."""
    return Sag(below + both * far, bow + both * far, bent + far)


def _most_of(start: float, linear: float, square: float) -> float:
    """The largest of e^{−τ} (start + linear τ + square τ²) for τ ≥ 0; all are 0 or above."""
    a, b = 2.0 * square - linear, start - linear
    root = a * a - 4.0 * square * b
    if root <= 0.0 or square <= 0.0:
        return max(start, linear)
    most = max(0.0, 0.5 * (a + math.sqrt(root)) / square)
    return max(start, math.exp(-most) * (linear + 2.0 * square * most))

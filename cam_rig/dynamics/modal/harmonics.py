"""By how much the output may sag below its chord over a step of the speed, by the law's harmonics.

With s = Σ cₖ e^{ikθ} and λ = −half + i rate, q = η̇ − λ̄ η is the response of q̇ = λ q + u, and once
settled Σ cₖ e^{ikθ} u(λ)/(ikΩ − λ) plus what is linear in Ω. The reciprocal z⁻¹ lies off its chord
between z₁ and z₂ by (z − z₁)(z − z₂)/(z₁ z₂ z); and by no more than its largest value, for it goes
along a circle through 0. So a harmonic that is far from resonance adds next to nothing, however
much the law has of others. From rest e^{λt} q(0) is missing, which fades and turns with the speed:
of what a harmonic is off its chord 1 − e^{(λ − ikΩ)t} remains, |λ − ikΩ|/half of it or less.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.modal.motion import (
    LawSeries,
    Norm,
    Oscillator,
    OscillatorMotion,
    Pair,
    amplitude,
)

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


def settled_sag(law: LawSeries, mode: Oscillator, begin: OscillatorMotion, high: float) -> Sag:
    """Of q from a motion to a speed (rad/s), but for the chord of what a run from rest lacks."""
    size, rate = begin.norm, begin.norm.rate
    first, second, third = mode.drive
    real = first - second * size.half + third * (size.half * size.half - rate * rate)
    imaginary = rate * (second - 2.0 * third * size.half)
    excited = math.sqrt(real * real + imaginary * imaginary)
    sag = _of_harmonics(law, size, begin.speed, high, mode.duration < math.inf)
    return Sag(excited * sag.below, excited * sag.bow, excited * sag.bent)


def sag_of(
    law: LawSeries, mode: Oscillator, begin: OscillatorMotion, sag: Sag, settled: Pair, high: float
) -> Sag:
    """Of the output, from that of q; at the speed ``high`` the settled motion begins a turn so."""
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
    direct = 0.25 * abs(mode.motion[2]) * law.largest[2] * width * width
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

"""Chord error of the output over a step of the speed, from the harmonics of the law.

With s = Σ cₖ e^{ikθ} and λ₁ = −δ + iρ, the complex amplitude q = η̇ − λ̄₁ η of the settled motion is
û(λ₁) Σ cₖ e^{ikθ}/(ikΩ − λ₁) plus a function that is linear in Ω, which has no chord error (29).
The chord error of 1/z on a straight line is known exactly, so a harmonic far from resonance adds
almost nothing (30). A run from rest lacks the vibration e^{λ₁t} q(0), which fades and turns with
the speed (31), (32). Numbers in brackets are those of docs/proofs.md, part 2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.contact import StemVibration
from cam_rig.dynamics.modal.motion import (
    LawSeries,
    ModeOnLaw,
    Oscillator,
    OscillatorMotion,
    VibrationNorm,
    amplitude,
)

#: Ratio of the ends of a block of harmonics that are bounded together.
BLOCK_RATIO = 2.0**0.25
#: Multiple of the resonance frequency above which a harmonic is far (30).
FAR_RATIO = 3.0
#: Chord error of the far harmonics ±k per cₖ/k, for w = 1 and Ω = 1 (30).
FAR_ERROR = 0.25 * (1.0 + (FAR_RATIO / (FAR_RATIO - 1.0)) ** 3)


class ChordError(NamedTuple):
    """Upper bounds of the chord error e(x) over a step w, at the fraction x of the step."""

    largest: float  #: of |e(x)|
    bow: float  #: of |e(x)| / (4 x (1 − x))
    bend: float  #: of |d²F/dΩ²| w²/8


def can_use_harmonics(mode: Oscillator, norm: VibrationNorm) -> bool:
    """Return True if the mode vibrates and settles within the run."""
    return mode.stiffness > 2.0 * norm.delta * norm.delta and norm.delta * mode.duration > 1.0


def bound_settled(run: ModeOnLaw, begin: OscillatorMotion, high: float) -> ChordError:
    """Return the chord error of q from a motion to a speed (rad/s) (29), (31).

    For a run from rest the term (32) is missing: `bound_output` adds it.
    """
    mode, norm, rho = run.mode, begin.norm, begin.norm.rho
    d0, d1, d2 = mode.drive.lift, mode.drive.velocity, mode.drive.acceleration
    real = d0 - d1 * norm.delta + d2 * (norm.delta * norm.delta - rho * rho)
    imaginary = rho * (d1 - 2.0 * d2 * norm.delta)
    excited = math.sqrt(real * real + imaginary * imaginary)
    error = _bound_harmonics(run.law, norm, begin.speed, high, mode.duration < math.inf)
    return ChordError(excited * error.largest, excited * error.bow, excited * error.bend)


def bound_output(
    run: ModeOnLaw,
    begin: OscillatorMotion,
    error: ChordError,
    repeating: StemVibration,
    high: float,
) -> ChordError:
    """Return the chord error of the output, from that of q.

    ``repeating`` is the settled (η, η̇) at the start of a turn at the speed ``high``.
    """
    mode, norm, low, rho = run.mode, begin.norm, begin.speed, begin.norm.rho
    largest, bow, bend = error.largest, error.bow, error.bend
    if mode.duration < math.inf:  # (32)
        old, change = begin.repeating, high / low - 1.0
        difference = amplitude(
            norm,
            StemVibration(
                repeating.displacement - old.displacement, repeating.velocity - old.velocity
            ),
        )
        size = max(amplitude(norm, old), amplitude(norm, repeating))
        turned = change * (1.0 + change) * math.sqrt(rho * rho + norm.delta * norm.delta)
        turned /= norm.delta
        linear, square = turned * (change * size + difference), turned * turned * size
        free = _max_fading(0.0, 0.25 * linear, 0.125 * square)
        largest = largest + min(free, 2.0 * size + 0.5 * difference)
        bow = bow + free
        linear += turned * (change * bend + 4.0 * bend)
        square += turned * turned * bend
        bend += _max_fading(bend, 0.25 * linear, 0.125 * square)
    reach, width = norm.reach, high - low
    direct = 0.25 * abs(mode.cam.acceleration) * run.law.max_derivatives[2] * width * width
    return ChordError(reach * largest + direct, reach * bow + direct, reach * bend + direct)


def _bound_harmonics(
    law: LawSeries, norm: VibrationNorm, low: float, high: float, from_rest: bool
) -> ChordError:
    """Return the chord error of q for û(λ₁) = 1: near harmonics one by one, then far ones.

    From rest each harmonic has the factor (31), except in ``bend``.
    """
    rho, delta_squared, width = norm.rho, norm.delta * norm.delta, high - low
    largest, bow, bend, far = 0.0, 0.0, 0.0, FAR_ERROR * width * width / (low * low * low)
    quarter, count, max_square, factor = 0.25 * width * width, len(law.harmonics), 1.0, 1.0
    if from_rest:
        max_square, factor = 4.0, 2.0
    for i in range(count):
        k, c = i + 1.0, law.harmonics[i]
        if k * low > FAR_RATIO * rho:
            return _add_far(ChordError(largest, bow, bend), far * law.tails[i], factor)
        first, last, mirrored = k * low - rho, k * high - rho, k * low + rho
        begin, end, nearest = first * first, last * last, max(0.0, first, -last)
        near, part = delta_squared + nearest * nearest, quarter * k * k
        inverse, other = 1.0 / math.sqrt(near), part / (mirrored * mirrored * mirrored)
        arc = part / math.sqrt((delta_squared + begin) * (delta_squared + end))
        turned = inverse * math.sqrt(min(max_square, 1.0 + max(begin, end) / delta_squared))
        largest += c * (min(arc, 1.0) * turned + factor * other)
        bow += c * (arc * turned + factor * other)
        bend += c * (part / near * inverse + other)
    return _bound_blocks(law, norm, low, high, factor, ChordError(largest, bow, bend))


def _bound_blocks(
    law: LawSeries,
    norm: VibrationNorm,
    low: float,
    high: float,
    factor: float,
    error: ChordError,
) -> ChordError:
    """Return the error with blocks of harmonics added, up to the far ones (30)."""
    rho, delta, quarter = norm.rho, norm.delta, 0.25 * (high - low) * (high - low)
    largest, bow, bend, k = error.largest, error.bow, error.bend, len(law.harmonics) + 1.0
    far = FAR_ERROR * (high - low) * (high - low) / (low * low * low)
    for c in law.block_maxima:
        if k * low > FAR_RATIO * rho:
            return _add_far(ChordError(largest, bow, bend), far * c, factor)
        number, last = 1.0 + k * (BLOCK_RATIO - 1.0), k * BLOCK_RATIO
        first, mirrored = max(0.0, k * low - rho, rho - last * high), k * low + rho
        near, part = math.sqrt(delta * delta + first * first), quarter * last * last
        inverses = 2.0 / delta + 2.0 / low * (1.0 + math.log(number))
        inverses, steep = min(inverses, number / near), part / (near * near)
        other = number * part / (mirrored * mirrored * mirrored)
        arcs = min(min(2.0, steep) * inverses, min(1.0, steep) * number / near)
        largest += factor * c * (arcs + other)
        bow += factor * c * (steep * inverses + other)
        bend += c * (steep * inverses + other)
        k = last
    return ChordError(math.inf, math.inf, math.inf)


def _add_far(error: ChordError, far: float, factor: float) -> ChordError:
    return ChordError(
        largest=error.largest + factor * far,
        bow=error.bow + factor * far,
        bend=error.bend + far,
    )


def _max_fading(start: float, linear: float, square: float) -> float:
    """Return the maximum of e^{−τ} (start + linear τ + square τ²) for τ ≥ 0; no number is < 0."""
    a, b = 2.0 * square - linear, start - linear
    discriminant = a * a - 4.0 * square * b
    if discriminant <= 0.0 or square <= 0.0:
        return max(start, linear)
    position = max(0.0, 0.5 * (a + math.sqrt(discriminant)) / square)
    return max(start, math.exp(-position) * (linear + 2.0 * square * position))

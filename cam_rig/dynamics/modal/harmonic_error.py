"""Chord error of the output over a step of the cam speed, by harmonics of the law.

At a fixed cam angle θ the output of a vibration mode, for example the contact force, is a function
of the cam speed Ω. Its chord error between two speeds is its deviation from the straight line
between its values there.

With the Fourier series s = Σ cₖ e^{ikθ} of the law and the eigenvalue λ₁ = −δ + iρ of the mode, the
complex amplitude q = η̇ − λ̄₁ η of the steady motion is û(λ₁) Σ cₖ e^{ikθ}/(ikΩ − λ₁) plus a
function that is linear in Ω, whose chord error is zero (29). Here û(λ) = d₀ + d₁ λ + d₂ λ² has the
weights dᵢ with which the cam drives the mode. The chord error of 1/z on a straight line is known
exactly, and that of a harmonic far from resonance is very small (30). A run from rest differs from
the steady motion by the vibration e^{λ₁t} q(0). It fades, and its phase changes with the speed
(31), (32).

Numbers in brackets are those of docs/proofs.md, part 2.
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

#: Ratio of the last to the first harmonic of a block. All harmonics of the law in a block share one
#: bound, which saves time.
BLOCK_RATIO = 2.0**0.25
#: Ratio of the frequency kΩ of a harmonic to the resonance frequency ρ above which the harmonic
#: counts as far from resonance, with the small bound (30) of docs/proofs.md.
FAR_RATIO = 3.0
#: Upper bound of the chord error of the harmonics ±k far from resonance, per cₖ/k, for a speed step
#: of 1 rad/s at 1 rad/s, by (30) of docs/proofs.md.
FAR_ERROR = 0.25 * (1.0 + (FAR_RATIO / (FAR_RATIO - 1.0)) ** 3)


class ChordError(NamedTuple):
    """Upper bounds of the chord error of a function F of the cam speed Ω.

    The chord error e(x) is the deviation of F from the straight line between its values at the two
    speeds of a step of width w. Here x is the position in the step, from 0 to 1.
    """

    max_error: float  #: upper bound of |e(x)| in the step
    parabola: float  #: upper bound of |e(x)| / (4 x (1 − x)): height of a parabola above |e|
    curvature: float  #: upper bound of |d²F/dΩ²| w²/8


def can_use_harmonics(mode: Oscillator, norm: VibrationNorm) -> bool:
    """Return True if the bounds of this module apply to a vibration mode.

    The bounds limit the chord error by harmonics of the law. The damping must be below 1/√2 of the
    critical damping (κ > 2δ²), and the free vibration must fade by more than the factor e within
    the run.
    """
    return mode.stiffness > 2.0 * norm.delta * norm.delta and norm.delta * mode.duration > 1.0


def bound_steady(run: ModeOnLaw, motion: OscillatorMotion, high: float) -> ChordError:
    """Return bounds of the chord error of a mode's steady amplitude over a speed step.

    The chord error is the deviation of a function of the cam speed from the straight line between
    its values at the two ends of the step. The function is the complex amplitude q = η̇ − λ̄₁ η of
    the steady motion at a fixed cam angle, with the displacement η and the eigenvalue λ₁ of the
    mode. The bounds are (29) and (31) of docs/proofs.md. ``motion`` is the motion at the lower
    speed, and ``high`` the higher speed in rad/s. For a run from rest `bound_output` adds the term
    (32).
    """
    mode, norm, rho = run.mode, motion.norm, motion.norm.rho
    d0, d1, d2 = mode.drive.lift, mode.drive.velocity, mode.drive.acceleration
    real = d0 - d1 * norm.delta + d2 * (norm.delta * norm.delta - rho * rho)
    imaginary = rho * (d1 - 2.0 * d2 * norm.delta)
    excited = math.sqrt(real * real + imaginary * imaginary)
    error = _bound_harmonics(run.law, norm, motion.speed, high, mode.duration < math.inf)
    return ChordError(
        excited * error.max_error, excited * error.parabola, excited * error.curvature
    )


def bound_output(
    run: ModeOnLaw,
    motion: OscillatorMotion,
    error: ChordError,
    steady_start: StemVibration,
    high: float,
) -> ChordError:
    """Return bounds of the chord error of a mode's output over a speed step.

    The chord error is the deviation from the straight line between the values at the two speeds.
    The output is, for example, the contact force. ``error`` is the chord error of the complex
    amplitude of the steady motion, from `bound_steady`. For a run from rest the fading vibration
    (32) of docs/proofs.md is added. ``motion`` is the motion at the lower speed. ``steady_start``
    is displacement and velocity of the steady motion at the start of a turn at the higher speed
    ``high`` (rad/s).
    """
    mode, norm, low, rho = run.mode, motion.norm, motion.speed, motion.norm.rho
    max_error, parabola, curvature = error.max_error, error.parabola, error.curvature
    if mode.duration < math.inf:  # from rest: the term (32) of the fading vibration
        old, change = motion.steady_start, high / low - 1.0
        difference = amplitude(
            norm,
            StemVibration(
                steady_start.displacement - old.displacement, steady_start.velocity - old.velocity
            ),
        )
        size = max(amplitude(norm, old), amplitude(norm, steady_start))
        turned = change * (1.0 + change) * math.sqrt(rho * rho + norm.delta * norm.delta)
        turned /= norm.delta
        linear, square = turned * (change * size + difference), turned * turned * size
        free = _max_fading(0.0, 0.25 * linear, 0.125 * square)
        max_error = max_error + min(free, 2.0 * size + 0.5 * difference)
        parabola = parabola + free
        linear += turned * (change * curvature + 4.0 * curvature)
        square += turned * turned * curvature
        curvature += _max_fading(curvature, 0.25 * linear, 0.125 * square)
    reach, width = norm.reach, high - low
    direct = 0.25 * abs(mode.cam.acceleration) * run.law.max_derivatives[2] * width * width
    return ChordError(
        max_error=reach * max_error + direct,
        parabola=reach * parabola + direct,
        curvature=reach * curvature + direct,
    )


def _bound_harmonics(
    law: LawSeries, norm: VibrationNorm, low: float, high: float, from_rest: bool
) -> ChordError:
    """Return bounds of the chord error of a mode's amplitude, for unit excitation.

    The chord error is the deviation of the complex amplitude from the straight line between its
    values at the cam speeds ``low`` and ``high`` (rad/s). Unit excitation means that the factor
    û(λ₁) of the module's text, with which the cam drives the mode, is 1. Harmonics of the law below
    `FAR_RATIO` times the resonance frequency are bounded singly or in blocks, and all higher
    harmonics together. In a run from rest each harmonic has the additional factor (31) of
    docs/proofs.md, except in the bound ``curvature``.
    """
    rho, delta_squared, width = norm.rho, norm.delta * norm.delta, high - low
    max_error, parabola, curvature = 0.0, 0.0, 0.0
    far = FAR_ERROR * width * width / (low * low * low)
    quarter, count, max_square, factor = 0.25 * width * width, len(law.harmonics), 1.0, 1.0
    if from_rest:
        max_square, factor = 4.0, 2.0
    for i in range(count):
        k, c = i + 1.0, law.harmonics[i]
        if k * low > FAR_RATIO * rho:
            return _add_far(ChordError(max_error, parabola, curvature), far * law.tails[i], factor)
        first, last, mirrored = k * low - rho, k * high - rho, k * low + rho
        start, end, nearest = first * first, last * last, max(0.0, first, -last)
        near, part = delta_squared + nearest * nearest, quarter * k * k
        inverse, other = 1.0 / math.sqrt(near), part / (mirrored * mirrored * mirrored)
        arc = part / math.sqrt((delta_squared + start) * (delta_squared + end))
        turned = inverse * math.sqrt(min(max_square, 1.0 + max(start, end) / delta_squared))
        max_error += c * (min(arc, 1.0) * turned + factor * other)
        parabola += c * (arc * turned + factor * other)
        curvature += c * (part / near * inverse + other)
    error = ChordError(max_error, parabola, curvature)
    return _bound_blocks(law, norm, low, high, factor, error)


def _bound_blocks(
    law: LawSeries,
    norm: VibrationNorm,
    low: float,
    high: float,
    factor: float,
    error: ChordError,
) -> ChordError:
    """Return the chord error ``error`` with the bounds of the higher harmonics added.

    The higher harmonics of the law are bounded in blocks, and together if they are far above
    resonance, by (30) of docs/proofs.md. ``low`` and ``high`` are the cam speeds (rad/s) at the
    ends of the step. ``factor`` multiplies the bounds ``max_error`` and ``parabola`` (2 in a run
    from rest, otherwise 1). The result is infinite if even the last block is not far above
    resonance.
    """
    rho, delta, quarter = norm.rho, norm.delta, 0.25 * (high - low) * (high - low)
    max_error, parabola, curvature = error.max_error, error.parabola, error.curvature
    k = len(law.harmonics) + 1.0
    far = FAR_ERROR * (high - low) * (high - low) / (low * low * low)
    for c in law.block_maxima:
        if k * low > FAR_RATIO * rho:
            return _add_far(ChordError(max_error, parabola, curvature), far * c, factor)
        number, last = 1.0 + k * (BLOCK_RATIO - 1.0), k * BLOCK_RATIO
        first, mirrored = max(0.0, k * low - rho, rho - last * high), k * low + rho
        near, part = math.sqrt(delta * delta + first * first), quarter * last * last
        inverses = 2.0 / delta + 2.0 / low * (1.0 + math.log(number))
        inverses, steep = min(inverses, number / near), part / (near * near)
        other = number * part / (mirrored * mirrored * mirrored)
        arcs = min(min(2.0, steep) * inverses, min(1.0, steep) * number / near)
        max_error += factor * c * (arcs + other)
        parabola += factor * c * (steep * inverses + other)
        curvature += c * (steep * inverses + other)
        k = last
    return ChordError(math.inf, math.inf, math.inf)


def _add_far(error: ChordError, far: float, factor: float) -> ChordError:
    """Return a chord error with the bound ``far`` of harmonics far above resonance added.

    ``factor`` multiplies the bound in ``max_error`` and ``parabola`` (2 from rest, otherwise 1).
    """
    return ChordError(
        max_error=error.max_error + factor * far,
        parabola=error.parabola + factor * far,
        curvature=error.curvature + far,
    )


def _max_fading(start: float, linear: float, square: float) -> float:
    """Return an upper bound of e^{−τ} (start + linear τ + square τ²) for τ ≥ 0.

    The three coefficients must not be negative. The function bounds the chord error of a fading
    vibration.
    """
    a, b = 2.0 * square - linear, start - linear
    discriminant = a * a - 4.0 * square * b
    if discriminant <= 0.0 or square <= 0.0:
        return max(start, linear)
    position = max(0.0, 0.5 * (a + math.sqrt(discriminant)) / square)
    return max(start, math.exp(-position) * (linear + 2.0 * square * position))

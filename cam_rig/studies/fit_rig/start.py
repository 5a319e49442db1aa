"""Start values of a search: encoder zero, follower on the cam, stem, restitution."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.studies.fit_rig.numbers import build_follower
from cam_rig.studies.fit_rig.residuals import FORCE_ZERO, NO_TURN_RESIDUAL, ZERO, Predicted
from cam_rig.studies.fit_rig.search import (
    MAX_SQUARE,
    Candidate,
    FitSolution,
    continue_from,
    log_ratio_of_all,
    search,
)
from cam_rig.studies.fit_rig.steady_turn import TURN_POINTS
from cam_rig.studies.fit_rig.turns import MIN_PRESS_FRACTION, MeasuredSegment
from cam_rig.units import TURN, FloatArray

#: Number of cam angles tried as the encoder's zero.
PHASES = 360
#: Every n-th sample is used in the search for start values.
SAMPLE_STRIDE = 8
#: Natural frequencies of the stems that are tried: lowest (Hz), highest (Hz), and ratio of
#: neighbours.
FREQUENCIES = (8.0, 3000.0, 1.1)
#: Ratio of neighbouring frequencies near the likeliest. A vibration with little damping is in phase
#: with the forces only if the error of its frequency is about its damping ratio.
FINE_FACTOR = 1.01
#: Powers of that ratio that are tried.
FINE_EXPONENTS = range(-10, 11)
#: Largest r.m.s. change of the forces by the parameters of one mass next to a stem, relative to the
#: forces.
MAX_MOVABLE_FRACTION = 0.1
#: Log ratio that three parameters reach by chance in one of twenty cases. The best of n stems
#: reaches ln n more.
CHANCE_LOG_RATIO = 3.91
#: Largest number of parts of a turn over which residuals are averaged.
MAX_PARTS = 256
#: Smallest number of samples in a part.
MIN_PART_SAMPLES = 6
#: Largest number of samples of a segment with which a stem is tried.
MAX_STEM_SAMPLES = 600
#: Points per period of the stem. Interpolation between them has an error of 0.5 % of the vibration.
POINTS_PER_PERIOD = 32
#: Largest number of points per turn. The error is larger beyond 2048 periods per turn.
MAX_POINTS = 2**16
#: Shares of the mass on the roller's side that are tried.
SHARES = (0.25, 0.5)
#: Damping ratios of the stem that are tried.
DAMPING_RATIOS = (0.005, 0.05)
#: Parameters of the fitted parts of the force, in the order of the columns.
FORCE_PARTS = ("mass", "damping", "spring_stiffness", "preload")


def rough_start(
    law: Law, segments: tuple[MeasuredSegment, ...], base: dict[str, float]
) -> tuple[dict[str, float], float, float]:
    """Return start values, the encoder's phase (rad) and the zero of the lift (m).

    On the cam lift and force are linear in the parameters at a fixed phase: s + zero, and m ω² s''
    + c ω s' + k s + preload. The phase is the best of `PHASES` phases.
    """
    best, result = math.inf, (dict(base), 0.0, 0.0)
    lifts = [
        (h.angle + h.speed * h.lift.since[::SAMPLE_STRIDE], h.lift.value[::SAMPLE_STRIDE])
        for h in segments
    ]
    angle, lift = (np.concatenate(x) for x in zip(*lifts, strict=True))
    angles, speed, force = np.hstack([_pressed(segment) for segment in segments])
    for phase in np.arange(PHASES) * (TURN / PHASES):
        missed, zero, numbers = 0.0, 0.0, dict(base)
        if lift.size:
            off = lift - law.motion_at(angle + phase)[0]
            zero = float(np.median(off))
            missed += float(((off - zero) ** 2).sum()) / float(lift.var())
        if force.size:
            parts, sizes = _force_parts(law, speed, angles + phase)
            _, triangle = np.linalg.qr(np.column_stack([parts, force]))
            fitted, off = nnls(triangle[:, :-1], triangle[:, -1])  # no parameter is negative
            missed += float(off) ** 2 / float(force.var())
            fitted_values = dict(zip(FORCE_PARTS, (fitted / sizes).tolist(), strict=True))
            numbers |= {
                n: v for n, v in fitted_values.items() if v > 0.0 or n in ("preload", "damping")
            }
        if missed < best:
            best, result = missed, (numbers, float(phase), zero)
    return result


def _force_parts(law: Law, speed: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit columns ``(n, 4)`` of the force by `FORCE_PARTS`, and their norms."""
    s, slope, curvature = law.motion_at(angle)
    parts = np.stack([curvature * speed**2, slope * speed, s, np.ones_like(s)], axis=1)
    sizes = np.linalg.norm(parts, axis=0)
    sizes[sizes == 0.0] = 1.0  # all samples in contact are on a dwell
    return parts / sizes, sizes


def _pressed(segment: MeasuredSegment) -> FloatArray:
    """Return cam angle, speed and force of some samples in contact, ``(3, n)``."""
    since, force = segment.force.since, segment.force.value
    on = np.flatnonzero(force > MIN_PRESS_FRACTION * force.max(initial=0.0))[::SAMPLE_STRIDE]
    return np.stack(
        [segment.angle + segment.speed * since[on], np.full(on.size, segment.speed), force[on]]
    )


def has_pattern(fit: Candidate) -> bool:
    """Return True if the force residual repeats from turn to turn, beyond noise."""
    squares, parts = pattern(fit)
    return squares > parts + math.sqrt(2.0 * parts)


def pattern(fit: Candidate) -> tuple[float, float]:
    """Return the squares of the mean force residuals over parts of a turn.

    The second result is the number of parts. The squares are in standard deviations. White noise
    gives the number of parts, within √2 of its root. Noise that is correlated over n samples gives
    n times as much.
    """
    squares = parts = 0.0
    for i, predicted in enumerate(fit.predicted):
        if predicted is None or not predicted.force.residual.size:
            continue
        residuals = predicted.force.residual / fit.likelihood.force_deviation(i)
        count = max(4, min(MAX_PARTS, residuals.size // MIN_PART_SAMPLES))
        part = (np.mod(predicted.force.angle, TURN) * (count / TURN)).astype(int) % count
        sizes = np.bincount(part, minlength=count)
        sums = np.bincount(part, residuals, minlength=count)
        squares += float((sums[sizes > 0] ** 2 / sizes[sizes > 0]).sum())
        parts += float(np.count_nonzero(sizes))
    return squares, parts


class TriedStem(NamedTuple):
    """Squared errors (N²) of the forces with a stem, its frequency and its parameters.

    ``sse`` is that with the parameters of one mass, ``moved`` that with parameters fitted to the
    stem. ``rate`` is its natural frequency in rad/s.
    """

    sse: float
    moved: float
    rate: float
    numbers: dict[str, float]


#: Error of a stem with the parameters of one mass.
AS_IT_IS = attrgetter("sse")
#: Error of a stem with parameters fitted to it.
MOVED = attrgetter("moved")


def find_stem(one_mass: Candidate) -> tuple[dict[str, float], float]:
    """Return the stem whose force fits best with the parameters of one mass.

    The second result is the logarithm of its likelihood ratio to a rigid stem. The parameters of
    one mass have compensated a part of the stem's effect. A stem that is far likelier with changed
    parameters is therefore returned. A stem that is likelier only by chance, as the best of many,
    is not.
    """
    values, forces = one_mass.values, _pressing(one_mass)
    low, high, factor = FREQUENCIES
    steps = range(round(math.log(high / low) / math.log(factor)))
    tried = list(_stems(values, forces, [TURN * low * factor**k for k in steps]))
    for near in {min(tried, key=key).rate for key in (AS_IT_IS, MOVED)}:
        tried += _stems(values, forces, [near * FINE_FACTOR**k for k in FINE_EXPONENTS])
    least, best = min(tried, key=AS_IT_IS), min(tried, key=MOVED)
    half = 0.5 * forces.measured.size
    if half * math.log(least.moved / best.moved) < CHANCE_LOG_RATIO + math.log(len(tried)):
        best = least
    rigid = forces.parts @ [values[name] for name in FORCE_PARTS]
    return best.numbers, half * math.log(forces.sse(rigid)[1] / best.moved)


@dataclass(frozen=True, eq=False)
class PressingSamples:
    """Samples in contact of all segments, and the parts of their steady force."""

    segments: list[tuple[float, FloatArray]]  #: speed (rad/s) and cam angles (rad) of each
    measured: FloatArray  #: N, ``(n,)`` of all segments
    parts: FloatArray  #: ``(n, 4)``: the force by `FORCE_PARTS`
    columns: FloatArray  #: the same orthonormal
    lift: NDArray[np.complex128]  #: Fourier coefficients of the law, m

    @classmethod
    def of(
        cls, law: Law, segments: list[tuple[float, FloatArray]], measured: FloatArray
    ) -> PressingSamples:
        """Return the samples with the parts of the force of a law."""
        speeds = np.concatenate([np.full(angle.size, speed) for speed, angle in segments])
        parts, sizes = _force_parts(law, speeds, np.concatenate([angle for _, angle in segments]))
        angles = np.arange(float(MAX_POINTS)) * (TURN / MAX_POINTS)
        lift = np.fft.rfft(law.motion_at(angles)[0], norm="forward")
        return cls(segments, measured, parts * sizes, np.asarray(np.linalg.qr(parts)[0]), lift)

    def on_a_stem(self, p: TwoMassParameters) -> FloatArray:
        """Return the steady contact force (N) of two masses, as if the cam could pull.

        The force of the roller is its inertia. The force of the end mass is that of Z₂ = k₂ + c₂ iΩ
        − m₂ Ω² in series with the stem Z₁ = k₁ + c₁ iΩ. It is Z₁ Z₂ / (Z₁ + Z₂) s for each harmonic
        of the law.
        """
        own, vibrating = math.sqrt(p.stiffness / p.end_mass), []
        for speed, angle in self.segments:
            wanted = min(max(TURN_POINTS, POINTS_PER_PERIOD * own / speed), MAX_POINTS)
            lift = self.lift[: 2 ** math.ceil(math.log2(wanted) - 1.0) + 1]
            rate = 1j * speed * np.arange(lift.size)
            stem = p.stem_stiffness + p.stem_damping * rate
            end = p.spring_stiffness + p.damping * rate + p.end_mass * rate**2
            force = np.fft.irfft(lift * (stem * end / (stem + end)), norm="forward")
            force, position = np.append(force, force[0]), np.mod(angle, TURN) * (force.size / TURN)
            vibrating.append(np.interp(position, np.arange(force.size), force))
        inertia = p.roller_mass * self.parts[:, 0]
        return np.asarray(inertia + np.concatenate(vibrating) + p.share * p.preload)

    def sse(self, forces: FloatArray) -> tuple[float, float]:
        """Return the squared errors of forces (N²), with fixed and with fitted parameters.

        Fitted parameters may change the forces only a little. A very soft stem moves a mass so far
        that the linear change is not valid. Its errors count in full.
        """
        off = forces - self.measured
        move = self.columns.T @ off
        missed, part, whole = (float(x @ x) for x in (off, move, self.measured))
        return missed, missed - (part if part < MAX_MOVABLE_FRACTION**2 * whole else 0.0)


def _pressing(one_mass: Candidate) -> PressingSamples:
    """Return at most `MAX_STEM_SAMPLES` samples in contact of each segment."""
    like, segments, forces = one_mass.likelihood, [], []
    for i in range(len(one_mass.segments)):
        _, counted = like.samples(i)
        on = np.flatnonzero(counted.value > MIN_PRESS_FRACTION * counted.value.max(initial=0.0))
        some = counted.where(on[:: -(-on.size // MAX_STEM_SAMPLES) or 1])
        segments.append((like.speed_of(one_mass.x, i), like.angles(one_mass.x, i, some.since)))
        forces.append(some.value)
    return PressingSamples.of(like.law, segments, np.concatenate(forces))


def _stems(
    values: dict[str, float], forces: PressingSamples, rates: list[float]
) -> Iterator[TriedStem]:
    """Yield the trials of stems with these natural frequencies (rad/s)."""
    for rate, share, ratio in product(rates, SHARES, DAMPING_RATIOS):
        end = values["mass"] * (1.0 - share)
        numbers = {
            "stem_stiffness": max(end * rate**2 - values["spring_stiffness"], end * rate),
            "roller_share": share,
            "stem_damping": 2.0 * ratio * end * rate,
        }
        two = build_follower(values | numbers, None)
        assert isinstance(two, TwoMassParameters)
        yield TriedStem(*forces.sse(forces.on_a_stem(two)), rate, numbers)


# Restitution: bounces make local maxima of the likelihood, so the whole range is searched first.

#: Restitutions that are tried first.
RESTITUTIONS = (1e-3, *(0.025 * k for k in range(1, 37)))
#: Number of finer steps that are then tried near the best.
FINE_STEPS = 16
#: Restitution below which only its upper limit is reported.
SMALL_BOUNCE = 0.02
#: Number of Gauss-Newton steps to the phase of a segment with a trial restitution.
PHASE_STEPS = 4
#: Step of the angle for their derivatives, rad.
ANGLE_STEP = 1e-6
#: Squares per sample that noise explains, including a landing next to a sample.
MAX_NOISE_SQUARES = 1.5
#: Chi-squared quantile of 95 % for one parameter.
SQUARE_95 = 3.84
#: Smallest number of samples in flight that identify the force's zero. It makes flights longer.
MIN_FLYING_SAMPLES = 4
#: Smallest zero of the force that is reported, in standard errors.
MIN_ZERO_ERRORS = 6.0
#: Smallest zero of the force that is reported, relative to the preload.
MIN_ZERO_FRACTION = 0.005
#: Number of estimates of the force's zero, each with the flights of the previous one.
ZERO_ROUNDS = 5


def search_restitution(fit: Candidate, fixed: dict[str, float]) -> FitSolution:
    """Return a search for the restitution and the other free parameters.

    It starts from the likeliest restitution with the values of the candidate.
    """
    if "restitution" in fixed:
        return search(continue_from(fit, fit.likelihood.free, fit.values))
    likely, _, _ = _likely(fit)
    middle = _tried(fit, 0.5 * (likely[0].bounce + likely[-1].bounce))
    bounce = {"restitution": max(middle.bounce, RESTITUTIONS[0])}
    start = continue_from(fit, fit.smooth, fit.values | bounce)
    start.x[start.likelihood.instruments.phases] = middle.phases
    return free_restitution(search(start), (*fit.smooth, "restitution"))


def free_restitution(fixed: FitSolution, free: tuple[str, ...]) -> FitSolution:
    """Return a search with the fixed restitution freed, if it is likelier.

    If bounces are lower than the noise of the lift, no derivative identifies the restitution, and a
    search drifts. The restitution is then listed as free with its derivatives, at its previous
    value.
    """
    released = search(continue_from(fixed, free, fixed.values))
    if len(released.segments) == len(fixed.segments) and log_ratio_of_all(released, fixed) >= 0.0:
        return released
    start = continue_from(fixed, free, fixed.values)
    masks = [fixed.likelihood.force_masks[i] for i in fixed.steady]
    pressing = [fixed.likelihood.pressing[i] for i in fixed.steady]
    new = replace(start.likelihood, force_masks=masks, pressing=pressing)
    return FitSolution(new, start.x, new.slopes(start.x), new.residuals(start.x))


def estimate_restitution(fit: Candidate) -> tuple[float, float] | None:
    """Return the restitution and its standard error, with the other parameters fixed.

    The error is half the range of possible values, because the other parameters are not free. The
    result is None if no restitution explains the flights to their noise.
    """
    _, possible, step = _likely(fit)
    best = min(possible, key=lambda trial: trial.sse)
    if best.sse >= MAX_NOISE_SQUARES * best.samples:
        return None
    low, high = possible[0].bounce, possible[-1].bounce
    return 0.5 * (low + high), 0.5 * (high - low + step)


def _likely(fit: Candidate) -> tuple[list[Tried], list[Tried], float]:
    """Return likely restitutions, possible restitutions, and the step between two."""
    coarse = [_tried(fit, bounce) for bounce in RESTITUTIONS]
    least = min(trial.sse for trial in coarse)
    near = [k for k, trial in enumerate(coarse) if trial.sse <= least + MAX_SQUARE]
    ends = RESTITUTIONS[max(0, near[0] - 1)], RESTITUTIONS[min(len(RESTITUTIONS) - 1, near[-1] + 1)]
    fine = [_tried(fit, bounce) for bounce in np.linspace(*ends, FINE_STEPS + 1).tolist()]
    least = min(trial.sse for trial in fine)
    likely, possible = (
        [trial for trial in fine if trial.sse <= least + more] for more in (SQUARE_95, MAX_SQUARE)
    )
    return likely, possible, (ends[1] - ends[0]) / FINE_STEPS


class Tried(NamedTuple):
    """Trial of a restitution.

    ``sse`` is the sum of squares over ``samples`` samples. ``phases`` (rad) are those of the
    segments.
    """

    bounce: float
    sse: float
    phases: FloatArray
    samples: int


def _tried(fit: Candidate, bounce: float) -> Tried:
    """Return the trial of one restitution."""
    start = continue_from(fit, fit.smooth, fit.values | {"restitution": bounce})
    new, x = start.likelihood, start.x
    missed, samples = 0.0, 0
    for i, segment in enumerate(new.segments):  # all forces, because bounces would hide them
        predicted = new.predicted(x, i)
        if predicted is None:
            samples += segment.lift.value.size + segment.force.value.size
            missed += NO_TURN_RESIDUAL**2 * segment.force.value.size
        elif predicted.turn.events:
            new.pressing[i] = np.abs(predicted.turn.evaluate(predicted.force.angle)[1])
            samples += segment.lift.value.size + segment.force.value.size
            x[new.instruments.phases.start + i], off = _phase(start, i, predicted)
            missed += off
    return Tried(bounce, missed, x[new.instruments.phases], samples)


def _phase(start: Candidate, i: int, predicted: Predicted) -> tuple[float, float]:
    """Return the phase (rad) of a segment that fits its turn, and its sum of squares."""
    phase = float(start.x[start.likelihood.instruments.phases][i])
    lift, moved = start.segments[i].lift.value.size > 0, 0.0
    for _ in range(PHASE_STEPS):
        off = _off(start, i, predicted, moved, lift)
        rise = (_off(start, i, predicted, moved + ANGLE_STEP, lift) - off) / ANGLE_STEP
        moved -= float(rise @ off) / max(float(rise @ rise), 1e-300)
    squares = [_off(start, i, predicted, moved, which) ** 2 for which in (True, False)]
    # A landing with an error of less than a sample changes one force completely.
    return phase + moved, float(sum(np.minimum(part, MAX_SQUARE).sum() for part in squares))


def _off(start: Candidate, i: int, predicted: Predicted, moved: float, lift: bool) -> FloatArray:
    """Return residuals of lift, or force, in standard deviations, ``moved`` rad later."""
    like, x = start.likelihood, start.x
    measured = like.samples(i)
    if lift:
        computed = predicted.turn.evaluate(predicted.lift.angle + moved)[0] + like.single(x, ZERO)
        return (computed - measured[0].value) / like.lift_noise
    computed = predicted.turn.evaluate(predicted.force.angle + moved)[1] + like.single(
        x, FORCE_ZERO
    )
    return (computed - measured[1].value) / like.force_deviation(i)


def add_zero_offset(fit: Candidate) -> Candidate:
    """Return the candidate with the force sensor's zero, if it has flights.

    In flight the sensor shows its zero.
    """
    like, low = fit.likelihood, forces_in_flight(fit)
    start = continue_from(fit, like.free, fit.values, zero_offset=True)
    if low.size < MIN_FLYING_SAMPLES:
        return fit
    x, index = start.x, start.likelihood.instruments.index[FORCE_ZERO]
    x[index] = float(np.median(low))
    if "preload" in like.free:
        k = like.free.index("preload")
        x[k] = max(0.0, x[k] - x[index])
    return start


def find_zero_in_flight(flying: Candidate) -> float | None:
    """Return the zero (N) of the force, or None if flights do not identify it."""
    like, x, zero = flying.likelihood, flying.x.copy(), 0.0
    if "preload" not in like.free:
        return None
    index, low = like.free.index("preload"), np.empty(0)
    for _ in range(ZERO_ROUNDS):
        low = forces_in_flight(Candidate(like, x.copy()))
        if low.size < MIN_FLYING_SAMPLES:
            return None
        zero = float(np.median(low))
        x[index] = max(0.0, flying.x[index] - zero)
    error = float(np.abs(low - zero).mean()) / math.sqrt(low.size)
    return (
        zero if abs(zero) > MIN_ZERO_ERRORS * error + MIN_ZERO_FRACTION * flying.x[index] else None
    )


def forces_in_flight(fit: Candidate) -> FloatArray:
    """Return the measured forces (N) at which the follower is off the cam."""
    flying = [
        fit.likelihood.samples(i)[1].value[predicted.turn.evaluate(predicted.force.angle)[1] == 0.0]
        for i, predicted in enumerate(fit.predicted)
        if predicted is not None
    ]
    return np.concatenate([np.empty(0), *flying])

"""Maximum likelihood search: least squares of the residuals of periodic turns.

The errors are taken as normal and independent between samples. The lift has one standard deviation.
The force has a constant part and a part proportional to it. The sum of squares in standard
deviations is then twice the negative logarithm of the likelihood.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.optimize import least_squares, nnls

from cam_rig.errors import ConfigError
from cam_rig.studies.fit_rig.numbers import search_limits
from cam_rig.studies.fit_rig.residuals import NO_TURN_RESIDUAL, RATIO, Likelihood, Predicted
from cam_rig.studies.fit_rig.turns import MeasuredSegment
from cam_rig.units import TURN, FloatArray, autocorrelation, rms

#: Largest number of searches, each with updated noise and samples next to landings.
MAX_ROUNDS = 8
#: Distance (rad) from a landing within which forces are left out of the first search.
FIRST_GUARD = 0.05
#: The same distance (rad) in the later searches.
GUARD = 0.01
#: Largest number of steps of the first two searches, before the noise is known.
MAX_FIRST_STEPS = 6
#: Largest number of steps of the later searches.
MAX_STEPS = 40
#: Relative decrease of the sum of squares at which a search stops.
SSE_RTOL = 3e-7
#: Largest growth of a sum of squares by chance, with at most twenty parameters.
MAX_CHANCE_SSE = 60.0
#: Smallest and largest damping ratio of a force sensor.
DAMPING_RATIO_LIMITS = (1e-4, 2.0)
#: Number of reweighted least squares for the noise.
NOISE_ROUNDS = 4
#: Smallest noise floor relative to the total noise.
MIN_FLOOR_FRACTION = 0.05


@dataclass(frozen=True, eq=False)
class Candidate:
    """Likelihood and its search variables ``(n,)``, from which a search can start."""

    likelihood: Likelihood
    x: FloatArray

    @property
    def segments(self) -> tuple[MeasuredSegment, ...]:
        """Measured segments of the likelihood."""
        return self.likelihood.segments

    @property
    def values(self) -> dict[str, float]:
        """Parameters of the follower, free and fixed."""
        return self.likelihood.values(self.x)

    @property
    def smooth(self) -> tuple[str, ...]:
        """Free parameters except the restitution."""
        return tuple(name for name in self.likelihood.free if name != "restitution")

    @cached_property
    def predicted(self) -> tuple[Predicted | None, ...]:
        """Computed lift and force of each segment, or None without a periodic turn."""
        return tuple(self.likelihood.predicted(self.x, i) for i in range(len(self.segments)))

    @property
    def steady(self) -> list[int]:
        """Indices of the segments with a periodic turn."""
        return [i for i, predicted in enumerate(self.predicted) if predicted is not None]

    @property
    def landings(self) -> list[int]:
        """Number of landings per turn of each segment.

        It is 1 without a periodic turn, because such a follower bounces.
        """
        return [
            1
            if predicted is None
            else sum(event.kind == "landing" for event in predicted.turn.events)
            for predicted in self.predicted
        ]


@dataclass(frozen=True, eq=False)
class FitSolution(Candidate):
    """Result of a search: Jacobian ``(m, n)`` and residuals ``(m,)``.

    Both are in standard deviations. ``bounce`` is a restitution with its standard error that was
    estimated separately from the search. ``zero`` (N) is the force that the sensor shows in flights
    that were left out, or None if it is zero.
    """

    slopes: FloatArray
    residuals: FloatArray
    bounce: tuple[float, float] | None = None
    zero: float | None = None


def search(start: Candidate) -> FitSolution:
    """Return the least-squares solution from ``start``.

    The noise and the samples next to landings are updated between searches.
    """
    likelihood, x = start.likelihood, start.x
    bounds = _limits(likelihood, x.size)
    margin = np.where(np.isfinite(bounds), 1e-9 * np.maximum(1.0, np.abs(bounds)), 0.0)
    inner = bounds[0] + margin[0], bounds[1] - margin[1]
    x = np.clip(x, *inner)
    for i in range(MAX_ROUNDS):
        moved = likelihood.keep_clear(x, FIRST_GUARD if i == 0 else GUARD)
        sized = _size_noise(likelihood, likelihood.residuals(x))
        if i > 1 and not moved and not sized:
            break
        result = least_squares(
            likelihood.residuals,
            x,
            likelihood.slopes,
            bounds=tuple(bounds),
            x_scale="jac",
            ftol=SSE_RTOL,
            xtol=1e-10,
            gtol=1e-12,
            max_nfev=MAX_FIRST_STEPS if i < 2 else MAX_STEPS,
        )
        x = np.clip(result.x, *inner)
    return FitSolution(likelihood, result.x, np.asarray(result.jac), result.fun)


def _limits(likelihood: Likelihood, size: int) -> FloatArray:
    """Return the lower and upper limits of the search variables, ``(2, size)``."""
    unbounded = np.array([[-np.inf], [np.inf]]) * np.ones(size - len(likelihood.free))
    bounds = np.hstack([search_limits(likelihood.free), unbounded])
    if (index := likelihood.instruments.index.get(RATIO)) is not None:
        bounds[:, index] = DAMPING_RATIO_LIMITS
    return bounds


def _size_noise(likelihood: Likelihood, residuals: FloatArray) -> bool:
    """Estimate the noise from residuals, and return True if it changed by over 1 %."""
    lifts, forces, pressing, start = [np.empty(0)], [np.empty(0)], [np.empty(0)], 0
    for i, (segment, mask) in enumerate(
        zip(likelihood.segments, likelihood.force_masks, strict=True)
    ):
        middle = start + segment.lift.value.size
        end = middle + int(mask.sum())
        if (residuals[start:end] != NO_TURN_RESIDUAL).any():  # else it contains no noise
            lifts.append(residuals[start:middle])
            forces.append(residuals[middle:end] * likelihood.force_deviation(i))
            pressing.append(likelihood.pressing[i][mask])
        start = end
    before = np.array(likelihood.noise)
    lift, force = np.concatenate(lifts), np.concatenate(forces)
    if lift.any():
        likelihood.lift_noise *= rms(lift)
    if force.any():
        likelihood.force_noise, likelihood.force_part = estimate_noise(
            force, np.concatenate(pressing)
        )
    changed = np.abs(np.array(likelihood.noise) - before)
    return bool((changed > 0.01 * before + 1e-4 * np.array([0.0, 0.0, 1.0])).any())


def estimate_noise(residual: FloatArray, force: FloatArray) -> tuple[float, float]:
    """Return the floor (N) and the relative part of a force noise.

    Residuals and forces are in N, ``(n,)`` each. The squares of the residuals are a² + b² F² on
    average. They scatter by √2 of that, which sets the weights of the least squares.
    """
    squares, scale = residual**2, max(float(np.abs(force).max(initial=0.0)), 1e-12)
    whole = float(squares.mean())
    parts = np.stack([np.ones(force.size), (force / scale) ** 2], axis=1)
    variance = np.full(force.size, whole)
    fitted = np.array([whole, 0.0])
    for _ in range(NOISE_ROUNDS):
        fitted, _ = nnls(parts / variance[:, None], squares / variance)
        fitted[0] = max(fitted[0], MIN_FLOOR_FRACTION**2 * whole)
        variance = parts @ fitted
    return math.sqrt(fitted[0]), math.sqrt(fitted[1]) / scale


def continue_from(
    before: Candidate,
    free: tuple[str, ...],
    values: dict[str, float],
    only: Sequence[int] | None = None,
    **having: Any,
) -> Candidate:
    """Return a candidate with other free parameters and values.

    ``only`` are the indices of the segments to use. ``having`` are changed fields of the
    likelihood, such as ``backlash``. Segments without a periodic turn are left out.
    """
    old = before.likelihood
    steady = [i for i in before.steady if only is None or i in only]
    if not steady:
        raise ConfigError(
            "at no speed does the motion of the follower repeat from turn to turn; needed: a speed "
            "below the jump speed"
        )
    new = replace(
        old,
        segments=tuple(old.segments[i] for i in steady),
        free=free,
        fixed={name: value for name, value in values.items() if name not in free},
        force_masks=[],
        pressing=[],
        **having,
    )
    instruments, old_instruments = new.instruments, old.instruments
    x = new.start(values, 0.0, 0.0)
    x[instruments.phases] = before.x[old_instruments.phases][steady]
    x[instruments.speeds] = before.x[old_instruments.speeds][steady]
    for name, index in instruments.index.items():
        x[index] = old.single(before.x, name)
    return Candidate(new, x)


def design_matrix(fit: Candidate) -> FloatArray:
    """Return the columns 1 and ω t at the middle of each segment, ``(n, 2)``."""
    return np.array([[1.0, h.speed * h.line.middle] for h in fit.segments])


def contradicts(some: FitSolution, whole: FitSolution) -> bool:
    """Return True if the parameters of all segments do not fit some of them.

    The test is the growth of the sum of squares of these segments. If one follower explains both,
    it grows by about the number of parameters.
    """
    part, full = some.likelihood, whole.likelihood
    order = [full.segments.index(segment) for segment in part.segments if segment in full.segments]
    if len(order) < len(part.segments):
        return False
    moved = continue_from(whole, full.free, whole.values, only=order)
    new = replace(moved.likelihood, force_masks=part.force_masks, pressing=part.pressing)
    new.lift_noise, new.force_noise, new.force_part = part.noise
    moved_sse, sse = (float(off @ off) for off in (new.residuals(moved.x), some.residuals))
    return moved_sse - sse > MAX_CHANCE_SSE


def log_ratio(first: FitSolution, other: FitSolution) -> float:
    """Return the logarithm of the likelihood ratio of two solutions.

    It uses the segments and samples that both have.
    """
    common = [
        (i, other.segments.index(h)) for i, h in enumerate(first.segments) if h in other.segments
    ]
    both = [first.likelihood.force_masks[i] & other.likelihood.force_masks[k] for i, k in common]
    logs = []
    for side, solution in enumerate((first, other)):
        indices = [pair[side] for pair in common]
        like = replace(solution.likelihood, force_masks=list(solution.likelihood.force_masks))
        for i, mask in zip(indices, both, strict=True):
            like.force_masks[i] = mask
        _size_noise(like, like.residuals(solution.x))
        total = 0.0
        for i in indices:
            total -= like.segments[i].lift.value.size * math.log(like.lift_noise)
            total -= float(np.log(like.force_deviation(i)).sum())
        logs.append(total)
    return logs[0] - logs[1]


# A search leaves out the forces next to landings. A follower that bounces through the whole turn
# leaves out nearly all forces, including those that contradict it. Two solutions are therefore
# compared by these samples too. The angle of a landing may have a small error, so the residual of a
# sample is its distance from all forces within that error.

#: Largest square of a residual in a comparison of restitutions.
MAX_SQUARE = 36.0


def log_ratio_of_all(first: FitSolution, other: FitSolution) -> float:
    """Return the logarithm of the likelihood ratio, including samples near landings."""
    ratio = log_ratio(first, other)
    for i, segment in enumerate(first.segments):
        if segment in other.segments:
            ratio += 0.5 * _square_difference(first, i, other, other.segments.index(segment))
    return ratio


def _square_difference(first: FitSolution, i: int, other: FitSolution, k: int) -> float:
    """Return the difference of the squares of the samples that a solution leaves out."""
    some = np.flatnonzero(~(first.likelihood.force_masks[i] & other.likelihood.force_masks[k]))
    if not some.size:
        return 0.0
    widths = (
        s.likelihood.landing_errors(s.x, index, GUARD)[some]
        for s, index in ((first, i), (other, k))
    )
    wide = np.maximum(GUARD, np.maximum(*widths))
    return float((_squares(other, k, some, wide) - _squares(first, i, some, wide)).sum())


def _squares(fit: FitSolution, i: int, some: NDArray[np.intp], wide: FloatArray) -> FloatArray:
    """Return squared distances of samples from all forces within ``wide`` (rad).

    They are in standard deviations.
    """
    like = fit.likelihood
    low, high = like.forces_about(fit.x, i, some, wide)
    value = like.segments[i].force.value[some]
    nearest = np.clip(value, low, high)
    deviation = np.hypot(like.force_noise, like.force_part * nearest)
    return np.asarray(np.minimum(((value - nearest) / deviation) ** 2, MAX_SQUARE))


# Standard errors and null directions from the derivatives and residuals of a search.

#: Relative change of the residuals below which a direction is not identifiable.
NULL_RTOL = 1e-6
#: Smallest component of a parameter in a direction that contains it.
MIN_COMPONENT = 0.05
#: Residual relative to the noise above which a solution is no fit.
MAX_MISFIT = 3.0


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance ``(n, n)`` of the search variables, and groups with a null direction.

    ``correlation_lengths`` are the lengths, in samples, over which residuals of lift and of force
    are correlated, the largest of all segments.
    """

    covariance: FloatArray
    null_groups: tuple[tuple[int, ...], ...]
    correlation_lengths: tuple[float, float]

    @property
    def errors(self) -> FloatArray:
        """Standard errors, ``(n,)``."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def uncertainty(solution: FitSolution) -> Uncertainty:
    """Return the covariance (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹ under noise of correlation R."""
    inverse, null_groups = normal_inverse(solution.slopes)
    scores, correlation_lengths = _scores(solution.likelihood, solution.slopes, solution.residuals)
    return Uncertainty(inverse @ scores @ inverse, null_groups, correlation_lengths)


def variance_inflation(solution: FitSolution, k: int) -> float:
    """Return the factor by which correlated noise increases a parameter's variance."""
    plain = normal_inverse(solution.slopes)[0][k, k]
    return float(uncertainty(solution).covariance[k, k] / plain) if plain > 0.0 else 1.0


def normal_inverse(slopes: FloatArray) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    """Return (JᵀJ)⁻¹ ``(n, n)``, and groups of parameters with a null direction.

    ``slopes`` is J with the shape ``(m, n)``.
    """
    sizes = np.linalg.norm(slopes, axis=0)
    sizes[sizes == 0.0] = 1.0
    scaled = slopes / sizes
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    identifiable = values > NULL_RTOL**2 * values.max(initial=0.0)
    inverse = (vectors[:, identifiable] / values[identifiable]) @ vectors[:, identifiable].T
    columns = (
        np.flatnonzero(np.abs(vector) > MIN_COMPONENT) for vector in vectors[:, ~identifiable].T
    )
    return inverse / np.outer(sizes, sizes), tuple(tuple(group.tolist()) for group in columns)


def _scores(
    likelihood: Likelihood, slopes: FloatArray, residuals: FloatArray
) -> tuple[FloatArray, tuple[float, float]]:
    """Return JᵀRJ ``(n, n)``, and the correlation lengths of lift and force residuals.

    R is computed for each segment and quantity separately, as that of stationary noise. The speed
    errors, the last rows, are independent.
    """
    start = slopes.shape[0] - len(likelihood.segments)
    total, lengths = slopes[start:].T @ slopes[start:], ([1.0], [1.0])
    start = 0
    for i in range(len(likelihood.segments)):
        for values, size in zip(lengths, likelihood.sizes(i), strict=True):
            part = slice(start, start + size)
            start += size
            if size:
                correlation = autocorrelation(residuals[part])
                values.append(1.0 + 2.0 * float(correlation[1:].sum()))
                total += _correlated(slopes[part], correlation)
    return total, (max(lengths[0]), max(lengths[1]))


def _correlated(slopes: FloatArray, correlation: FloatArray) -> FloatArray:
    """Return JᵀRJ of stationary noise by Fourier transform: Σ P |J|².

    P is the power spectrum of ``correlation``.
    """
    if correlation.size == 1:
        return np.asarray(slopes.T @ slopes)
    size = next_fast_len(slopes.shape[0] + correlation.size, real=True)
    lags = np.zeros(size)
    lags[: correlation.size] = correlation
    lags[size - correlation.size + 1 :] = correlation[:0:-1]
    power = np.maximum(np.fft.rfft(lags).real, 0.0)  # a truncated one has negative values
    power[1 : (size + 1) // 2] *= 2.0  # and at the negative frequency
    lines = np.fft.rfft(slopes, size, axis=0)
    return np.asarray(((lines.conj().T * power) @ lines).real / size)


def explain_misfit(solution: FitSolution, correlation_lengths: tuple[float, float]) -> str:
    """Return the reason why a solution cannot be trusted, or an empty text.

    Readings at nearly the same cam angle differ by their noise. The residuals should not be larger.
    With lifts alone, flights and bounces make many local minima. A search may stop near the
    follower, where neighbouring residuals are correlated. If a single speed has flights, several
    minima are equally likely. ``correlation_lengths`` are those of `Uncertainty`.
    """
    flying = sum(map(bool, solution.landings))
    if flying and not any(segment.force.value.size for segment in solution.segments):
        if correlation_lengths[0] > MAX_MISFIT:
            return (
                f"the residuals of the lift are correlated over {correlation_lengths[0]:.2g} "
                "samples: measure a force too, or speeds at which the follower bounces less"
            )
        if flying == 1:
            return "a single speed that lifts off identifies nothing: measure another, or a force"
    for name, unit, factor in (("lift", "mm", 1e3), ("force", "N", 1.0)):
        signals = [
            getattr(predicted, name) for predicted in solution.predicted if predicted is not None
        ]
        residuals = np.concatenate([signal.residual for signal in signals])
        noise = [
            np.diff((signal.value - signal.residual)[np.argsort(np.mod(signal.angle, TURN))])
            / math.sqrt(2.0)
            for signal in signals
        ]
        size = rms(residuals) if residuals.size else 0.0
        apart = rms(np.concatenate(noise)) if size else 0.0
        if size > MAX_MISFIT * apart:
            return (
                f"the {name} is {size * factor:.3g} {unit} r.m.s. from any such follower, its "
                f"noise {apart * factor:.2g} {unit}: is it that cam, that unit, that sign?"
            )
    return ""

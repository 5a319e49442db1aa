"""The numbers that make what was measured likeliest: least squares on exact turns.

With errors that are normal and independent from sample to sample, of one size for the lift and of a
floor and a part of the force, the sum of squares in standard deviations is twice the negative
logarithm of the likelihood.
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
from cam_rig.studies.fit_rig.residuals import FAR, RATIO, Likelihood, Predicted
from cam_rig.studies.fit_rig.turns import MeasuredHold
from cam_rig.units import TURN, FloatArray, autocorrelation, rms

#: Looks at which samples lie beside a landing, at most; distances from one, rad.
MOST_ROUNDS, FIRST_GUARD, GUARD = 8, 0.05, 0.01
#: Steps of the first searches, whose noise is not known yet, and of the others.
FIRST_STEPS, MOST_STEPS = 6, 40
#: A search is over where the sum of squares falls by this part of it.
SETTLED = 3e-7
#: A sum of squares that grows by more than this is no chance, of twenty numbers at most.
CONTRARY = 60.0
#: Damping ratios of a force sensor, least and most.
RATIOS = (1e-4, 2.0)
#: Looks at the noise; its floor, in parts of the whole.
NOISE_ROUNDS, LEAST_FLOOR = 4, 0.05


@dataclass(frozen=True, eq=False)
class Candidate:
    """A likelihood and values of what it seeks, ``(n,)``: a search may begin there."""

    likelihood: Likelihood
    x: FloatArray

    @property
    def holds(self) -> tuple[MeasuredHold, ...]:
        """Of its likelihood."""
        return self.likelihood.holds

    @property
    def values(self) -> dict[str, float]:
        """The follower's numbers, sought and given."""
        return self.likelihood.values(self.x)

    @property
    def smooth(self) -> tuple[str, ...]:
        """What is sought but for the restitution."""
        return tuple(name for name in self.likelihood.sought if name != "restitution")

    @cached_property
    def predicted(self) -> tuple[Predicted | None, ...]:
        """Each hold as the numbers make it; None where its turns differ."""
        return tuple(self.likelihood.predicted(self.x, i) for i in range(len(self.holds)))

    @property
    def steady(self) -> list[int]:
        """The holds in which each turn is as the one before."""
        return [i for i, there in enumerate(self.predicted) if there is not None]

    @property
    def landings(self) -> list[int]:
        """A turn, of each hold; one where no turn is as the one before, for it bounces."""
        return [
            1 if there is None else sum(event.kind == "landing" for event in there.turn.events)
            for there in self.predicted
        ]


@dataclass(frozen=True, eq=False)
class FitSolution(Candidate):
    """Where a search ended: its Jacobian ``(m, n)`` and residuals ``(m,)``, in standard deviations.

    ``bounce`` is a restitution with its standard error that was found beside the search; ``zero``
    (N) what the force sensor shows in flights that were left out, where that is not nothing.
    """

    slopes: FloatArray
    residuals: FloatArray
    bounce: tuple[float, float] | None = None
    zero: float | None = None


def search(start: Candidate) -> FitSolution:
    """The least squares from ``start`` on, with the noise and the samples beside landings anew."""
    likelihood, x = start.likelihood, start.x
    bounds = _limits(likelihood, x.size)
    margin = np.where(np.isfinite(bounds), 1e-9 * np.maximum(1.0, np.abs(bounds)), 0.0)
    inner = bounds[0] + margin[0], bounds[1] - margin[1]
    x = np.clip(x, *inner)
    for i in range(MOST_ROUNDS):
        moved = likelihood.keep_clear(x, FIRST_GUARD if i == 0 else GUARD)
        sized = _size_noise(likelihood, likelihood.residuals(x))
        if i > 1 and not moved and not sized:
            break
        found = least_squares(
            likelihood.residuals,
            x,
            likelihood.slopes,
            bounds=tuple(bounds),
            x_scale="jac",
            ftol=SETTLED,
            xtol=1e-10,
            gtol=1e-12,
            max_nfev=FIRST_STEPS if i < 2 else MOST_STEPS,
        )
        x = np.clip(found.x, *inner)
    return FitSolution(likelihood, found.x, np.asarray(found.jac), found.fun)


def _limits(likelihood: Likelihood, size: int) -> FloatArray:
    """``(2, size)``: lowest and highest of what is sought."""
    free = np.array([[-np.inf], [np.inf]]) * np.ones(size - len(likelihood.sought))
    bounds = np.hstack([search_limits(likelihood.sought), free])
    if (at := likelihood.instruments.at.get(RATIO)) is not None:
        bounds[:, at] = RATIOS
    return bounds


def _size_noise(likelihood: Likelihood, residuals: FloatArray) -> bool:
    """Take the noise from the residuals; whether it changed by more than a hundredth."""
    lifts, forces, pressing, at = [np.empty(0)], [np.empty(0)], [np.empty(0)], 0
    for i, (hold, kept) in enumerate(zip(likelihood.holds, likelihood.kept, strict=True)):
        middle = at + hold.lift.value.size
        end = middle + int(kept.sum())
        if (residuals[at:end] != FAR).any():  # else no steady turn, which tells no noise
            lifts.append(residuals[at:middle])
            forces.append(residuals[middle:end] * likelihood.force_deviation(i))
            pressing.append(likelihood.pressing[i][kept])
        at = end
    before = np.array(likelihood.noise)
    lift, force = np.concatenate(lifts), np.concatenate(forces)
    if lift.any():
        likelihood.lift_noise *= rms(lift)
    if force.any():
        likelihood.force_noise, likelihood.force_part = noise_of(force, np.concatenate(pressing))
    changed = np.abs(np.array(likelihood.noise) - before)
    return bool((changed > 0.01 * before + 1e-4 * np.array([0.0, 0.0, 1.0])).any())


def noise_of(residual: FloatArray, force: FloatArray) -> tuple[float, float]:
    """Floor (N) and part of the force of a noise, from residuals and forces (N), ``(n,)`` each.

    Their squares are a² + b² F² on average, and scatter by √2 of that: weighted least squares.
    """
    squares, scale = residual**2, max(float(np.abs(force).max(initial=0.0)), 1e-12)
    whole = float(squares.mean())
    parts = np.stack([np.ones(force.size), (force / scale) ** 2], axis=1)
    variance = np.full(force.size, whole)
    fitted = np.array([whole, 0.0])
    for _ in range(NOISE_ROUNDS):
        fitted, _ = nnls(parts / variance[:, None], squares / variance)
        fitted[0] = max(fitted[0], LEAST_FLOOR**2 * whole)
        variance = parts @ fitted
    return math.sqrt(fitted[0]), math.sqrt(fitted[1]) / scale


def continued(
    before: Candidate,
    sought: tuple[str, ...],
    values: dict[str, float],
    only: Sequence[int] | None = None,
    **having: Any,
) -> Candidate:
    """A candidate of other numbers, of ``only`` some holds, ``having`` other instruments."""
    old = before.likelihood
    steady = [i for i in before.steady if only is None or i in only]
    if not steady:
        raise ConfigError(
            "at no speed does the follower move alike from turn to turn; needed: a speed at which "
            "it does, so one below the jump speed"
        )
    new = replace(
        old,
        holds=tuple(old.holds[i] for i in steady),
        sought=sought,
        given={name: value for name, value in values.items() if name not in sought},
        kept=[],
        pressing=[],
        **having,
    )
    here, there = new.instruments, old.instruments
    x = new.start(values, 0.0, 0.0)
    x[here.phases] = before.x[there.phases][steady]
    x[here.speeds] = before.x[there.speeds][steady]
    for name, at in here.at.items():
        x[at] = old.single(before.x, name)
    return Candidate(new, x)


def lever(found: Candidate) -> FloatArray:
    """1 and ω t in the middle of each hold, ``(n, 2)``."""
    return np.array([[1.0, h.speed * h.hold.middle] for h in found.holds])


def contradict(some: FitSolution, all_of_it: FitSolution) -> bool:
    """Whether the numbers of all holds are none of some of them, by what these then miss more.

    Where both are of one follower, the sum of squares grows by about as much as there are numbers.
    """
    here, there = some.likelihood, all_of_it.likelihood
    order = [there.holds.index(hold) for hold in here.holds if hold in there.holds]
    if len(order) < len(here.holds):
        return False
    moved = continued(all_of_it, there.sought, all_of_it.values, only=order)
    new = replace(moved.likelihood, kept=here.kept, pressing=here.pressing)
    new.lift_noise, new.force_noise, new.force_part = here.noise
    missed, least = (float(off @ off) for off in (new.residuals(moved.x), some.residuals))
    return missed - least > CONTRARY


def log_ratio(one: FitSolution, other: FitSolution) -> float:
    """Logarithm of how much likelier one solution is, of the holds and samples that both have."""
    common = [(i, other.holds.index(h)) for i, h in enumerate(one.holds) if h in other.holds]
    both = [one.likelihood.kept[i] & other.likelihood.kept[k] for i, k in common]
    logs = []
    for side, solution in enumerate((one, other)):
        there = [pair[side] for pair in common]
        like = replace(solution.likelihood, kept=list(solution.likelihood.kept))
        for i, kept in zip(there, both, strict=True):
            like.kept[i] = kept
        _size_noise(like, like.residuals(solution.x))
        total = 0.0
        for i in there:
            total -= like.holds[i].lift.value.size * math.log(like.lift_noise)
            total -= float(np.log(like.force_deviation(i)).sum())
        logs.append(total)
    return logs[0] - logs[1]


# What the forces beside landings say, which a search leaves out. One that bounces through the whole
# turn leaves out nearly all of the force, and so what contradicts it: two solutions are compared by
# these samples too. There a landing may be off by a little, so a sample is as far off as it is from
# all that the follower shows within that little.

#: A square counts so much at most where restitutions are compared.
MOST_SQUARE = 36.0


def log_ratio_of_all(one: FitSolution, other: FitSolution) -> float:
    """Logarithm of how much likelier what was measured is by one solution, bounces and all."""
    found = log_ratio(one, other)
    for i, hold in enumerate(one.holds):
        if hold in other.holds:
            found += 0.5 * _missed_more(one, i, other, other.holds.index(hold))
    return found


def _missed_more(one: FitSolution, i: int, other: FitSolution, k: int) -> float:
    """By how much more squares the other misses what one of both leaves out of a hold."""
    some = np.flatnonzero(~(one.likelihood.kept[i] & other.likelihood.kept[k]))
    if not some.size:
        return 0.0
    widths = (s.likelihood.beside(s.x, at, GUARD)[some] for s, at in ((one, i), (other, k)))
    wide = np.maximum(GUARD, np.maximum(*widths))
    return float((_squares(other, k, some, wide) - _squares(one, i, some, wide)).sum())


def _squares(found: FitSolution, i: int, some: NDArray[np.intp], wide: FloatArray) -> FloatArray:
    """In deviations, of how far samples are from all that is shown within ``wide`` (rad)."""
    like = found.likelihood
    low, high = like.forces_about(found.x, i, some, wide)
    value = like.holds[i].force.value[some]
    nearest = np.clip(value, low, high)
    deviation = np.hypot(like.force_noise, like.force_part * nearest)
    return np.asarray(np.minimum(((value - nearest) / deviation) ** 2, MOST_SQUARE))


# What a search's slopes and residuals say of its numbers: standard errors, null directions.

#: Directions in which the residuals change by less than this part of the most are told by nothing.
NULL = 1e-6
#: Part of a direction that a number of it has at least.
SHARE = 0.05
#: What is left beyond so many times the noise is no fit.
MUCH = 3.0


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance ``(n, n)`` of what was sought, and groups of numbers with a null direction.

    ``alike`` are the lengths, in samples, over which residuals of lift and of force are
    correlated, the largest of all holds.
    """

    covariance: FloatArray
    null_groups: tuple[tuple[int, ...], ...]
    alike: tuple[float, float]

    @property
    def errors(self) -> FloatArray:
        """Standard errors, ``(n,)``."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def uncertainty(solution: FitSolution) -> Uncertainty:
    """Covariance (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹ of least squares under noise of correlation R."""
    inverse, null_groups = normal_inverse(solution.slopes)
    scores, alike = _scores(solution.likelihood, solution.slopes, solution.residuals)
    return Uncertainty(inverse @ scores @ inverse, null_groups, alike)


def inflation(solution: FitSolution, k: int) -> float:
    """By what factor the noise's correlation widens the variance of an unknown."""
    plain = normal_inverse(solution.slopes)[0][k, k]
    return float(uncertainty(solution).covariance[k, k] / plain) if plain > 0.0 else 1.0


def normal_inverse(slopes: FloatArray) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    """(JᵀJ)⁻¹ ``(n, n)`` of slopes ``(m, n)``, and groups of unknowns with a null direction."""
    sizes = np.linalg.norm(slopes, axis=0)
    sizes[sizes == 0.0] = 1.0
    scaled = slopes / sizes
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    told = values > NULL**2 * values.max(initial=0.0)
    inverse = (vectors[:, told] / values[told]) @ vectors[:, told].T
    columns = (np.flatnonzero(np.abs(vector) > SHARE) for vector in vectors[:, ~told].T)
    return inverse / np.outer(sizes, sizes), tuple(tuple(group.tolist()) for group in columns)


def _scores(
    likelihood: Likelihood, slopes: FloatArray, residuals: FloatArray
) -> tuple[FloatArray, tuple[float, float]]:
    """JᵀRJ ``(n, n)``, and the lengths over which residuals of lift and force are correlated.

    R is of each hold and quantity by itself, and of one stationary noise there; the speeds, behind
    them all, are independent.
    """
    at = slopes.shape[0] - len(likelihood.holds)
    total, lengths = slopes[at:].T @ slopes[at:], ([1.0], [1.0])
    at = 0
    for i in range(len(likelihood.holds)):
        for found, size in zip(lengths, likelihood.sizes(i), strict=True):
            part = slice(at, at + size)
            at += size
            if size:
                correlation = autocorrelation(residuals[part])
                found.append(1.0 + 2.0 * float(correlation[1:].sum()))
                total += _correlated(slopes[part], correlation)
    return total, (max(lengths[0]), max(lengths[1]))


def _correlated(slopes: FloatArray, correlation: FloatArray) -> FloatArray:
    """JᵀRJ of one stationary noise: by Fourier, Σ P |J|² with P the power of ``correlation``."""
    if correlation.size == 1:
        return np.asarray(slopes.T @ slopes)
    size = next_fast_len(slopes.shape[0] + correlation.size, real=True)
    lags = np.zeros(size)
    lags[: correlation.size] = correlation
    lags[size - correlation.size + 1 :] = correlation[:0:-1]
    power = np.maximum(np.fft.rfft(lags).real, 0.0)  # a cut-off one is below zero here and there
    power[1 : (size + 1) // 2] *= 2.0  # and at the negative frequency
    lines = np.fft.rfft(slopes, size, axis=0)
    return np.asarray(((lines.conj().T * power) @ lines).real / size)


def misfit(solution: FitSolution, alike: tuple[float, float]) -> str:
    """Why nothing that was found is to be trusted; empty where it may be.

    Readings at nearly one cam angle differ by their noise, and what is left should be no more. Of
    lifts alone, flights and bounces make many valleys: a search may end beside the follower, where
    neighbours err alike (``alike``, as in `Uncertainty`), or in one of several that are as likely,
    if a single speed flies.
    """
    flying = sum(map(bool, solution.landings))
    if flying and not any(hold.force.value.size for hold in solution.holds):
        if alike[0] > MUCH:
            return (
                f"the residuals of the lift are correlated over {alike[0]:.2g} samples: "
                "measure a force too, or speeds at which the follower bounces less"
            )
        if flying == 1:
            return "a single speed that lifts off identifies nothing: measure another, or a force"
    for name, unit, factor in (("lift", "mm", 1e3), ("force", "N", 1.0)):
        shown = [getattr(there, name) for there in solution.predicted if there is not None]
        left = np.concatenate([one.left for one in shown])
        noise = [
            np.diff((one.value - one.left)[np.argsort(np.mod(one.angle, TURN))]) / math.sqrt(2.0)
            for one in shown
        ]
        size = rms(left) if left.size else 0.0
        apart = rms(np.concatenate(noise)) if size else 0.0
        if size > MUCH * apart:
            return (
                f"the {name} is {size * factor:.3g} {unit} r.m.s. from any such follower, its "
                f"noise {apart * factor:.2g} {unit}: is it that cam, that unit, that sign?"
            )
    return ""

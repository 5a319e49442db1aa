"""The numbers that make what was measured likeliest: least squares on exact turns.

With errors that are normal and independent from sample to sample, of one size for the lift and of a
floor and a part of the force, the sum of squares in standard deviations is twice the negative
logarithm of the likelihood.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.optimize import least_squares, nnls

from cam_rig.errors import ConfigError
from cam_rig.measured.rig_fit.numbers import RATIO, search_limits, to_search
from cam_rig.measured.rig_fit.residuals import FAR, Likelihood
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
    """A likelihood and values of what it seeks, ``(n,)``: a search may begin there.

    Nothing says how sure they are: only a `FitSolution` does.
    """

    likelihood: Likelihood
    x: FloatArray


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

    def __post_init__(self) -> None:
        unknowns, samples = self.likelihood.instruments.size, self.likelihood.count
        shapes = self.x.shape, self.residuals.shape, self.slopes.shape
        if shapes != ((unknowns,), (samples,), (samples, unknowns)):
            raise ValueError(
                f"a solution of {samples} residuals and {unknowns} unknowns has x, residuals and "
                f"Jacobian of shapes {', '.join(map(str, shapes))}"
            )


def search(start: Candidate) -> FitSolution:
    """The least squares from ``start`` on, with the noise and the samples beside landings anew."""
    likelihood, x = start.likelihood, start.x
    bounds = _limits(likelihood, x.size)
    inner = [
        b + 1e-9 * max(1.0, abs(b)) * d if math.isfinite(b) else b
        for bs, d in zip(bounds, (1.0, -1.0), strict=True)
        for b in bs.tolist()
    ]
    x = np.clip(x, inner[: x.size], inner[x.size :])
    for i in range(MOST_ROUNDS):
        moved = likelihood.keep_clear(x, FIRST_GUARD if i == 0 else GUARD)
        sized = _size_noise(likelihood, likelihood.residuals(x))
        if i > 1 and not moved and not sized:
            break
        found = least_squares(
            likelihood.residuals,
            x,
            likelihood.slopes,
            bounds=bounds,
            x_scale="jac",
            ftol=SETTLED,
            xtol=1e-10,
            gtol=1e-12,
            max_nfev=FIRST_STEPS if i < 2 else MOST_STEPS,
        )
        x = np.clip(found.x, inner[: x.size], inner[x.size :])
    return FitSolution(likelihood, found.x, np.asarray(found.jac), found.fun)


def _limits(likelihood: Likelihood, size: int) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest of what is sought, ``(size,)`` each."""
    low, high = search_limits(likelihood.sought)
    free = np.full(size - low.size, np.inf)
    bounds = np.concatenate([low, -free]), np.concatenate([high, free])
    if (at := likelihood.instruments.at(RATIO)) is not None:
        bounds[0][at], bounds[1][at] = RATIOS
    return bounds


def _size_noise(likelihood: Likelihood, residuals: FloatArray) -> bool:
    """Take the noise from the residuals; whether it changed by more than a hundredth.

    That of the force is a floor and a part in proportion to the force, as of most sensors.
    """
    lifts, forces, pressing, at = [np.empty(0)], [np.empty(0)], [np.empty(0)], 0
    for i, (hold, kept) in enumerate(zip(likelihood.holds, likelihood.kept, strict=True)):
        middle = at + hold.lift.value.size
        end = middle + int(kept.sum())
        if (residuals[at:end] == FAR).all():  # no steady turn: that says nothing of the noise
            at = end
            continue
        lifts.append(residuals[at:middle])
        forces.append(residuals[middle:end] * likelihood.force_deviation(i))
        pressing.append(likelihood.pressing[i][kept])
        at = end
    before = np.array([likelihood.lift_noise, likelihood.force_noise, likelihood.force_part])
    lift, force = np.concatenate(lifts), np.concatenate(forces)
    if lift.any():
        likelihood.lift_noise *= rms(lift)
    if force.any():
        likelihood.force_noise, likelihood.force_part = noise_of(force, np.concatenate(pressing))
    after = np.array([likelihood.lift_noise, likelihood.force_noise, likelihood.force_part])
    return bool((np.abs(after - before) > 0.01 * before + 1e-4 * np.array([0.0, 0.0, 1.0])).any())


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
    play: bool | None = None,
    resonance: bool | None = None,
    tare: bool | None = None,
    only: list[int] | None = None,
) -> Candidate:
    """A candidate of other numbers, with the instruments as they were.

    ``play``, ``resonance`` and ``tare`` are what else they may have, None as they had; ``only``
    are some holds.
    """
    old = before.likelihood
    steady = [i for i in steady_holds_of(before) if only is None or i in only]
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
        play=old.play if play is None else play,
        resonance=old.resonance if resonance is None else resonance,
        tare=old.tare if tare is None else tare,
    )
    x = np.zeros(new.instruments.size)
    x[: len(sought)] = [to_search(name, values[name]) for name in sought]
    here, there = new.instruments, old.instruments
    x[here.phases] = before.x[there.phases][steady]
    x[here.speeds] = before.x[there.speeds][steady]
    for name in here.single:
        to = here.at(name)
        assert to is not None
        x[to] = old.single(before.x, name)
    return Candidate(new, x)


def steady_holds_of(found: Candidate) -> list[int]:
    """The holds in which each turn is as the one before."""
    like = found.likelihood
    return [i for i in range(len(like.holds)) if like.predicted(found.x, i) is not None]


def landings_of(found: Candidate) -> list[int]:
    """Landings a turn, of each hold; one where no turn is as the one before, for it bounces."""
    like = found.likelihood
    turns = (like.predicted(found.x, i) for i in range(len(like.holds)))
    return [
        1 if turn is None else sum(event.kind == "landing" for event in turn.turn.events)
        for turn in turns
    ]


def contradict(some: FitSolution, all_of_it: FitSolution) -> bool:
    """Whether the numbers of all holds are none of some of them, by what these then miss more.

    Where both are of one follower, the sum of squares grows by about as much as there are numbers.
    """
    here, there = some.likelihood, all_of_it.likelihood
    order = [there.holds.index(hold) for hold in here.holds if hold in there.holds]
    if len(order) < len(here.holds):
        return False
    moved = continued(all_of_it, there.sought, there.values(all_of_it.x), only=order)
    new = moved.likelihood
    new.kept, new.pressing = here.kept, here.pressing
    new.lift_noise, new.force_noise, new.force_part = (
        here.lift_noise,
        here.force_noise,
        here.force_part,
    )
    missed, least = (float(off @ off) for off in (new.residuals(moved.x), some.residuals))
    return missed - least > CONTRARY


def log_ratio(one: FitSolution, other: FitSolution) -> float:
    """Logarithm of how much likelier what was measured is by one solution than by another.

    Of the holds that both have, and there of the samples that lie beside a landing of neither.
    """
    mine, theirs = (
        {id(hold): i for i, hold in enumerate(solution.likelihood.holds)}
        for solution in (one, other)
    )
    common = [(mine[key], theirs[key]) for key in mine if key in theirs]
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


# What a search's slopes and residuals say of its numbers: standard errors, null directions.

#: Directions in which the residuals change by less than this part of the most are told by nothing.
BLIND = 1e-6

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
    blind: tuple[tuple[int, ...], ...]
    alike: tuple[float, float]

    @property
    def errors(self) -> FloatArray:
        """Standard errors, ``(n,)``."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def uncertainty(solution: FitSolution) -> Uncertainty:
    """Covariance (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹ of least squares under noise of correlation R."""
    inverse, told, vectors = _inverse(solution.slopes)
    scores, alike = _scores(solution.likelihood, solution.slopes, solution.residuals)
    columns = (np.flatnonzero(np.abs(vector) > SHARE) for vector in vectors[:, ~told].T)
    blind = tuple(tuple(group.tolist()) for group in columns)
    return Uncertainty(inverse @ scores @ inverse, blind, alike)


def inflation(solution: FitSolution, k: int) -> float:
    """By what factor the noise's correlation widens the variance of an unknown."""
    plain = _inverse(solution.slopes)[0][k, k]
    return float(uncertainty(solution).covariance[k, k] / plain) if plain > 0.0 else 1.0


def _inverse(slopes: FloatArray) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """(JᵀJ)⁻¹ ``(n, n)``; which directions are told; all, in columns, of scaled unknowns."""
    sizes = np.linalg.norm(slopes, axis=0)
    sizes[sizes == 0.0] = 1.0
    scaled = slopes / sizes
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    told = values > BLIND**2 * values[-1]
    inverse = (vectors[:, told] / values[told]) @ vectors[:, told].T
    return inverse / np.outer(sizes, sizes), told, vectors


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
    for hold, kept in zip(likelihood.holds, likelihood.kept, strict=True):
        for found, size in zip(lengths, (hold.lift.value.size, int(kept.sum())), strict=True):
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
    likelihood = solution.likelihood
    flying = landings_of(solution)
    if any(flying) and not any(hold.force.value.size for hold in likelihood.holds):
        if alike[0] > MUCH:
            return (
                f"the residuals of the lift are correlated over {alike[0]:.2g} samples: "
                "measure a force too, or speeds at which the follower bounces less"
            )
        if sum(map(bool, flying)) == 1:
            return "a single speed that lifts off identifies nothing: measure another, or a force"
    for name, unit, factor in (("lift", "mm", 1e3), ("force", "N", 1.0)):
        left, noise = list[FloatArray](), list[FloatArray]()
        for i in range(len(likelihood.holds)):
            predicted = likelihood.predicted(solution.x, i)
            if predicted is None:
                continue
            angle, there, off = (
                (predicted.lift_angle, predicted.lift, predicted.lift_left)
                if name == "lift"
                else (predicted.force_angle, predicted.force, predicted.force_left)
            )
            order = np.argsort(np.mod(angle, TURN))
            left.append(off)
            noise.append(np.diff((there - off)[order]) / math.sqrt(2.0))
        size = rms(np.concatenate(left)) if any(x.size for x in left) else 0.0
        apart = rms(np.concatenate(noise)) if size else 0.0
        if size > MUCH * apart:
            return (
                f"the {name} is {size * factor:.3g} {unit} r.m.s. from any such follower, its "
                f"noise {apart * factor:.2g} {unit}: is it that cam, that unit, that sign?"
            )
    return ""

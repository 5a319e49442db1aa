"""What a search's slopes and residuals say of its numbers: standard errors, null directions.

The covariance is that of least squares: the inverse of JᵀJ, with residuals in standard deviations,
and where these are correlated in time the sandwich of it with their correlation as it is measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from cam_rig.arrays import FloatArray, autocorrelation, rms
from cam_rig.studies.rig_fit.likelihood import Likelihood
from cam_rig.studies.rig_fit.search import FitSolution, landings_of
from cam_rig.units import TURN

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
    """Covariance (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹ of least squares under noise of correlation R.

    Where a restitution's error is that of a profile, the covariance is that of the other numbers
    beside it, and what all change with it.
    """
    along = solution.along
    if along is None:
        columns = np.arange(solution.x.size)
    else:
        sought = solution.likelihood.sought
        columns = np.array([k for k in range(along.size) if sought[k : k + 1] != ("restitution",)])
    inverse, told, vectors = _inverse(solution.slopes[:, columns])
    scores, alike = _scores(solution.likelihood, solution.slopes[:, columns], solution.residuals)
    covariance = np.zeros((solution.x.size, solution.x.size))
    covariance[np.ix_(columns, columns)] = inverse @ scores @ inverse
    if along is not None:
        covariance += np.outer(along, along)
    blind = tuple(tuple(columns[np.abs(vector) > SHARE].tolist()) for vector in vectors[:, ~told].T)
    return Uncertainty(covariance, blind, alike)


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

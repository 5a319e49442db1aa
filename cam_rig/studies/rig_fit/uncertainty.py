"""What a search's slopes and residuals say of its numbers: standard errors, and what is not told.

The covariance is the inverse of the likelihood's curvature, JᵀJ with residuals in standard
deviations; where neighbours err alike, so many count as one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray, rms
from cam_rig.studies.rig_fit.holds import correlation_length
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
    """Covariance ``(n, n)`` of what was sought, and groups of numbers not told from each other.

    ``alike`` are the lengths, in samples, over which residuals of lift and of force err alike, the
    largest of all holds.
    """

    covariance: FloatArray
    blind: tuple[tuple[int, ...], ...]
    alike: tuple[float, float]

    @property
    def errors(self) -> FloatArray:
        """Standard errors, ``(n,)``."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def uncertainty(solution: FitSolution) -> Uncertainty:
    """Standard errors of a solution."""
    slopes, residuals = solution.slopes, solution.residuals
    weights, alike, at = np.ones(residuals.size), [1.0, 1.0], 0
    likelihood = solution.likelihood
    for hold, kept in zip(likelihood.holds, likelihood.kept, strict=True):
        for i, size in enumerate((hold.lift.value.size, int(kept.sum()))):
            if size:
                length = correlation_length(residuals[at : at + size])
                alike[i] = max(alike[i], length)
                weights[at : at + size] = 1.0 / np.sqrt(length)
            at += size
    slopes = slopes * weights[:, None]
    sizes = np.linalg.norm(slopes, axis=0)
    scaled = slopes / np.where(sizes > 0.0, sizes, 1.0)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    told = values > BLIND**2 * values[-1]
    covariance = (vectors[:, told] / values[told]) @ vectors[:, told].T
    covariance /= np.outer(*[np.where(sizes > 0.0, sizes, 1.0)] * 2)
    blind = tuple(
        tuple(np.flatnonzero(np.abs(vector) > SHARE).tolist()) for vector in vectors[:, ~told].T
    )
    return Uncertainty(covariance, blind, (alike[0], alike[1]))


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
                f"what is left of the lift is no noise, {alike[0]:.2g} neighbours err alike: "
                "measure a force too, or speeds at which the follower bounces less"
            )
        if sum(map(bool, flying)) == 1:
            return "a single speed lifts off, which tells it badly: measure another, or a force"
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

"""What a search's slopes and residuals say of its numbers: standard errors, and what is not told.

The covariance is the inverse of the likelihood's curvature, JᵀJ with residuals in standard
deviations; where neighbours err alike, so many count as one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.studies.rig_fit.holds import correlation_length
from cam_rig.studies.rig_fit.search import FitSolution

#: Directions in which the residuals change by less than this part of the most are told by nothing.
BLIND = 1e-6
#: Part of a direction that a number of it has at least.
SHARE = 0.05


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

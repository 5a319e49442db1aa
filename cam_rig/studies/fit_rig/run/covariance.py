"""Covariance of a fitted follower under correlated noise, and unidentifiable parameters.

Neighbouring samples of a sensor have correlated errors. The covariance is therefore the sandwich
estimator (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹, where J is the Jacobian and R the autocorrelation of the residuals.
For white noise it equals (JᵀJ)⁻¹, the inverse of the curvature of the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len

from cam_rig.studies.fit_rig.normal_equations import normal_inverse
from cam_rig.studies.fit_rig.run.likelihood import Likelihood
from cam_rig.studies.fit_rig.run.search import FitSolution
from cam_rig.units import FloatArray, autocorrelation


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance of a fit, and the parameters that it does not identify.

    ``covariance`` ``(n, n)`` is that of the n search variables. ``null_groups`` are tuples of
    indices of search variables: those of one group can change together without a change of the
    residuals. ``correlation_lengths`` are the numbers of samples over which the residuals of the
    lift and of the force are correlated. Each is the largest of all steady-speed segments.
    """

    covariance: FloatArray
    null_groups: tuple[tuple[int, ...], ...]
    correlation_lengths: tuple[float, float]

    @property
    def errors(self) -> FloatArray:
        """Standard errors of the search variables, ``(n,)``."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def sandwich_covariance(solution: FitSolution) -> Uncertainty:
    """Return the covariance (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹ of a fit under correlated noise.

    J is the Jacobian of the residuals, and R the autocorrelation of the noise.
    """
    inverse, null_groups = normal_inverse(solution.jacobian)
    scores, correlation_lengths = _scores(
        solution.likelihood, solution.jacobian, solution.residuals
    )
    return Uncertainty(inverse @ scores @ inverse, null_groups, correlation_lengths)


def variance_inflation(solution: FitSolution, k: int) -> float:
    """Return the factor by which correlated noise increases a parameter's variance.

    It is relative to white noise. ``k`` is the index of the parameter among the search variables.
    The factor is 1 if no sample depends on the parameter.
    """
    plain = normal_inverse(solution.jacobian)[0][k, k]
    return float(sandwich_covariance(solution).covariance[k, k] / plain) if plain > 0.0 else 1.0


def _scores(
    likelihood: Likelihood, jacobian: FloatArray, residuals: FloatArray
) -> tuple[FloatArray, tuple[float, float]]:
    """Return JᵀRJ ``(n, n)``, and the correlation lengths of lift and force residuals.

    J is ``jacobian``, and R the autocorrelation of the residuals. R is computed for each
    steady-speed segment and each quantity separately, as that of stationary noise. The last rows of
    J, one per segment, belong to the errors of the speeds, which are independent. The correlation
    lengths are in samples.
    """
    start = jacobian.shape[0] - len(likelihood.segments)
    total, lengths = jacobian[start:].T @ jacobian[start:], ([1.0], [1.0])
    start = 0
    for i in range(len(likelihood.segments)):
        for values, size in zip(lengths, likelihood.sizes(i), strict=True):
            part = slice(start, start + size)
            start += size
            if size:
                correlation = autocorrelation(residuals[part])
                values.append(1.0 + 2.0 * float(correlation[1:].sum()))
                total += _correlated(jacobian[part], correlation)
    return total, (max(lengths[0]), max(lengths[1]))


def _correlated(jacobian: FloatArray, correlation: FloatArray) -> FloatArray:
    """Return JᵀRJ for stationary noise, ``(n, n)``.

    ``correlation`` is the autocorrelation R by lag, from lag 0 on. The product is computed by
    Fourier transform, as Σ P |J|² with the power spectrum P of the noise.
    """
    if correlation.size == 1:
        return np.asarray(jacobian.T @ jacobian)
    size = next_fast_len(jacobian.shape[0] + correlation.size, real=True)
    lags = np.zeros(size)
    lags[: correlation.size] = correlation
    lags[size - correlation.size + 1 :] = correlation[:0:-1]
    # The truncation of the autocorrelation can make its power spectrum negative.
    power = np.maximum(np.fft.rfft(lags).real, 0.0)
    power[1 : (size + 1) // 2] *= 2.0  # each line also represents its negative frequency
    lines = np.fft.rfft(jacobian, size, axis=0)
    return np.asarray(((lines.conj().T * power) @ lines).real / size)

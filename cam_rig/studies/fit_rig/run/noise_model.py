"""Noise of the measured lift and force, estimated from the residuals of a fit.

The errors are taken as normally distributed and independent between samples. The lift has one
standard deviation. The force F has the standard deviation √(a² + b² F²), with a constant floor a
and a relative part b.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import nnls

from cam_rig.studies.fit_rig.run.likelihood import NO_TURN_RESIDUAL, Likelihood
from cam_rig.units import FloatArray, rms

#: Number of least-squares fits that estimate the noise of the force. Each is weighted with the
#: noise of the previous fit.
NOISE_ROUNDS = 4
#: Smallest constant part of the noise of the force, relative to the total noise. Without it, small
#: forces would get too large weights.
MIN_FLOOR_FRACTION = 0.05


def update_noise(likelihood: Likelihood, residuals: FloatArray) -> bool:
    """Estimate the noise of lift and force from the residuals of a fit.

    ``residuals`` are in standard deviations of the previous noise. The noise in ``likelihood`` is
    changed in place. Returns True if it changed by more than 1 %.
    """
    lifts, forces, pressing, start = [np.empty(0)], [np.empty(0)], [np.empty(0)], 0
    for i, (segment, mask) in enumerate(
        zip(likelihood.segments, likelihood.force_masks, strict=True)
    ):
        middle = start + segment.lift.value.size
        end = middle + int(mask.sum())
        # Residuals of a segment without a periodic turn are a constant and contain no noise.
        if (residuals[start:end] != NO_TURN_RESIDUAL).any():
            lifts.append(residuals[start:middle])
            forces.append(residuals[middle:end] * likelihood.force_deviation(i))
            pressing.append(likelihood.pressing[i][mask])
        start = end
    before = np.array(likelihood.noise)
    lift, force = np.concatenate(lifts), np.concatenate(forces)
    if lift.any():
        likelihood.lift_noise *= rms(lift)
    if force.any():
        likelihood.force_noise, likelihood.relative_force_noise = estimate_force_noise(
            force, np.concatenate(pressing)
        )
    changed = np.abs(np.array(likelihood.noise) - before)
    return bool((changed > 0.01 * before + 1e-4 * np.array([0.0, 0.0, 1.0])).any())


def estimate_force_noise(residual: FloatArray, force: FloatArray) -> tuple[float, float]:
    """Return the constant floor a (N) and the relative part b of the force's noise.

    ``residual`` and ``force`` are in N, ``(n,)`` each. The mean of the squared residuals is a² + b²
    F², which is fitted by least squares. A squared residual scatters by √2 times its mean. The
    weights of the least squares are therefore inverse to the mean.
    """
    squares, scale = residual**2, max(float(np.abs(force).max(initial=0.0)), 1e-12)
    total = float(squares.mean())
    parts = np.stack([np.ones(force.size), (force / scale) ** 2], axis=1)
    variance = np.full(force.size, total)
    fitted = np.array([total, 0.0])
    for _ in range(NOISE_ROUNDS):
        fitted, _ = nnls(parts / variance[:, None], squares / variance)
        fitted[0] = max(fitted[0], MIN_FLOOR_FRACTION**2 * total)
        variance = parts @ fitted
    return math.sqrt(fitted[0]), math.sqrt(fitted[1]) / scale

"""The trigonometric polynomial over a whole turn (eq. 2.2)."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws.fit import Curve


def trigonometric(mean: float, cosine: list[float], sine: list[float]) -> Curve:
    """s(θ) = c₀ + Σ cᵢ cos iθ + sᵢ sin iθ, i from 1, θ in rad, with its derivatives."""
    waves = max(len(cosine), len(sine))
    harmonic = np.arange(1, waves + 1, dtype=np.float64)
    c = np.pad(np.array(cosine, dtype=np.float64), (0, waves - len(cosine)))
    s = np.pad(np.array(sine, dtype=np.float64), (0, waves - len(sine)))

    def curve(angle: FloatArray, order: int) -> FloatArray:
        # the r-th derivative turns (cos, sin) by r quarters: exact, no phase to round
        for_cosine, for_sine = [(c, s), (s, -c), (-c, -s), (-s, c)][order % 4]
        turned = angle[:, None] * harmonic
        scale = harmonic**order
        waves_sum = np.cos(turned) @ (for_cosine * scale) + np.sin(turned) @ (for_sine * scale)
        return np.asarray(waves_sum + (mean if order == 0 else 0.0))

    return curve

"""The simple harmonic rise (1 − cos πu)/2 (worked example b): its acceleration jumps."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray


def simple_harmonic(u: FloatArray, order: int) -> FloatArray:
    """The rise or its derivative in u, order 0 to 3."""
    if order == 0:
        return np.asarray(np.sin(0.5 * np.pi * u) ** 2)  # the same, without cancellation near 0
    half = 0.5 * np.pi**order
    if order == 2:
        return np.asarray(half * np.cos(np.pi * u))
    return np.asarray((half if order == 1 else -half) * np.sin(np.pi * u))

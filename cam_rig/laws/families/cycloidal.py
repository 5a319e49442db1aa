"""The cycloidal rise u − sin(2πu)/2π (paper §2)."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray


def cycloidal(u: FloatArray, order: int) -> FloatArray:
    """The rise or its derivative in u, order 0 to 3."""
    turn = 2.0 * np.pi * u
    if order == 0:
        return np.asarray(u - np.sin(turn) / (2.0 * np.pi))
    if order == 1:
        return np.asarray(1.0 - np.cos(turn))
    if order == 2:
        return np.asarray(2.0 * np.pi * np.sin(turn))
    return np.asarray(4.0 * np.pi**2 * np.cos(turn))

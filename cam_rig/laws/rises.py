"""Rises from 0 to 1 over u ∈ [0, 1] that are one Bézier curve (science: paper §2)."""

from __future__ import annotations

import numpy as np

from cam_rig.laws.bernstein import FloatArray


def poly345() -> FloatArray:
    """Polynomial 3-4-5: 10u³ − 15u⁴ + 6u⁵, C² against a dwell (eq. 3.1)."""
    return np.repeat([0.0, 1.0], 3)


def poly4567() -> FloatArray:
    """Polynomial 4-5-6-7: 35u⁴ − 84u⁵ + 70u⁶ − 20u⁷, C³ against a dwell (eq. 3.2)."""
    return np.repeat([0.0, 1.0], 4)

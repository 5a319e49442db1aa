"""Rises from 0 to 1 over u ∈ [0, 1] that are one Bézier curve, by their ordinates.

The r-th derivative at an end depends on r + 1 ordinates only (eq. 2.7): as many equal ones as
wanted make the joint with a dwell smooth, as many on one line the joint with a straight part.
"""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray


def constant_velocity() -> FloatArray:
    """The straight line u: velocity jumps at both ends (worked example a)."""
    return np.array([0.0, 1.0])


def full_rise(degree: int) -> FloatArray:
    """Ordinates {0…0, 1…1}, half each, of odd degree: C^((degree − 1)/2) (eq. 3.1-3.3).

    Degree 5 is 10u³ − 15u⁴ + 6u⁵, the polynomial 3-4-5, and degree 7 is
    35u⁴ − 84u⁵ + 70u⁶ − 20u⁷, the 4-5-6-7.
    """
    return np.repeat([0.0, 1.0], (degree + 1) // 2)


def half_rise_start(degree: int) -> FloatArray:
    """From rest to constant velocity 2, of even degree: C^(degree / 2) (eq. 3.4-3.6)."""
    half = degree // 2
    return np.concatenate([np.zeros(half), np.linspace(0.0, 1.0, half + 1)])


def half_rise_end(degree: int) -> FloatArray:
    """From constant velocity 2 to rest, of even degree (eq. 3.7-3.9)."""
    return np.asarray(1.0 - half_rise_start(degree)[::-1])

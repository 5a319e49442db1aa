"""Hertz's line contact: two cylinders with parallel axes, pressed together without friction.

Pressure p(x) = p₀ √(1 − x²/b²) over the width 2b. K. L. Johnson, *Contact
Mechanics*, 1985, §4.2.
"""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray


def peak_pressure(load: FloatArray, curvature: FloatArray, modulus: float) -> FloatArray:
    """Largest pressure p₀ (Pa), in the middle of the contact: √(F' E* κ / π).

    Parameters
    ----------
    load : F', N/m, force over the face width
    curvature : κ = 1/R₁ + 1/R₂, 1/m; a concave radius is negative
    modulus : E*, Pa: 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂

    Examples
    --------
    Steel rollers of 20 and 40 mm radius, 100 N/mm:

    >>> steel = 206e9 / (2 * (1 - 0.3**2))
    >>> round(float(peak_pressure(1e5, 1 / 0.02 + 1 / 0.04, steel)) / 1e6, 1)  # MPa
    519.8
    """
    return np.sqrt(load * modulus * curvature / np.pi)


def half_width(load: FloatArray, curvature: FloatArray, modulus: float) -> FloatArray:
    """Half the width of the contact b (m): √(4 F' / (π E* κ))."""
    return np.sqrt(4.0 * load / (np.pi * modulus * curvature))

"""Sound pressure and its level in dB."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Reference sound pressure in air, Pa (IEC 61672).
REFERENCE_PRESSURE = 20e-6


def level_db(pressure: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Level in dB re 20 µPa of an r.m.s. pressure in Pa."""
    return np.asarray(20.0 * np.log10(np.asarray(pressure) / REFERENCE_PRESSURE))


def pressure_pa(level: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """r.m.s. pressure in Pa of a level in dB re 20 µPa."""
    return np.asarray(REFERENCE_PRESSURE * 10.0 ** (np.asarray(level) / 20.0))

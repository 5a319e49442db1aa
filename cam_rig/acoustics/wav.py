"""Measuring a recorded sound: every level a meter would have shown, and what a file needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics.bands import Spectrum, third_octaves
from cam_rig.acoustics.sound_level_meter import (
    FREQUENCY_WEIGHTINGS,
    TIME_WEIGHTINGS,
    SoundLevelMeter,
)
from cam_rig.acoustics.weighting import class_1_up_to_hz
from cam_rig.arrays import FloatArray

#: The 16-bit samples of a sound file reach to this.
FULL_SCALE = 32767


@dataclass(frozen=True)
class Measurement:
    """Levels in dB re 20 µPa by the standard's names, as LAeq and LAFmax, and the flags.

    ``class_1_up_to_hz`` is the nominal frequency up to which the levels are of class 1.
    """

    levels: dict[str, float]
    bands: Spectrum
    peak_pa: float
    overload: bool
    under_range: bool
    class_1_up_to_hz: float


def measure(pressure: FloatArray, rate: int) -> Measurement:
    """Measure samples ``(n,)`` in Pa."""
    levels: dict[str, float] = {}
    overload, lowest = False, np.inf
    for weighting in FREQUENCY_WEIGHTINGS:
        for ballistics in TIME_WEIGHTINGS:
            meter = SoundLevelMeter(rate, weighting, ballistics)
            reading = meter.read(pressure)
            levels[f"L{weighting}eq"] = meter.equivalent
            levels[f"L{weighting}{ballistics}max"] = meter.highest
            overload, lowest = meter.overloaded, min(lowest, reading.level - meter.span[0])
    peak = float(np.abs(pressure).max())
    spectrum, class_1 = third_octaves(pressure, rate), class_1_up_to_hz(rate)
    return Measurement(levels, spectrum, peak, overload, lowest < 0.0, class_1)


def full_scale(peak: float) -> float:
    """Pressure (Pa) that a sound file's largest number stands for: 1, 2 or 5 times a power of 10.

    The smallest of them that ``peak`` does not pass, so files of like loudness share it.
    """
    if peak <= 0.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(peak))
    return float(next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if peak <= step * decade))


def pcm(pressure: FloatArray, scale: float) -> bytes:
    """16-bit little-endian samples, where ``scale`` (Pa) is the largest number."""
    return np.round(pressure * (FULL_SCALE / scale)).astype("<i2").tobytes()

"""The sound of the last turn in third-octave bands.

The contact force of a turn, taken as periodic, is a line spectrum; each line radiates through
the structure of `cam_rig.acoustics.radiation`, p = gain · ω_c · jω/(jω + ω_c) · F, a landing as
the half-sine pulse it is there; the lines are summed in the base-ten bands of IEC 61260. The
background, whose spectrum nobody gives, is not in it.
"""

from __future__ import annotations

import numpy as np

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.arrays import FloatArray

#: Band numbers 10 lg(f/Hz): 5 is 3.15 Hz, slower than any turn's own frequency.
LOWEST_BAND = 5
#: Below this no bar is drawn, Pa²: 0 dB.
SILENCE = 4e-10


def band_numbers(sample_rate: float) -> FloatArray:
    """10 lg(f/Hz) of all bands up to half the sample rate (Hz)."""
    highest = int(np.floor(10.0 * np.log10(sample_rate / 2.0)))
    return np.arange(LOWEST_BAND, highest + 1, dtype=np.float64)


def third_octaves(
    parameters: RadiationParameters, force: FloatArray, impulse: FloatArray, sample_rate: float
) -> FloatArray:
    """Level (dB re 20 µPa, not below 0) of each band over one turn.

    Parameters
    ----------
    force, impulse : ``(n,)`` contact force in N, and the landings' impulses in N·s
    sample_rate : Hz

    Returns
    -------
    as many as `band_numbers`
    """
    power = band_power(parameters, force, impulse, sample_rate)
    return level_db(np.sqrt(np.maximum(power, SILENCE)))


def band_power(
    parameters: RadiationParameters, force: FloatArray, impulse: FloatArray, sample_rate: float
) -> FloatArray:
    """Mean square sound pressure (Pa²) in each band; their sum is that of the turn."""
    frequency = np.asarray(np.fft.rfftfreq(force.size, 1.0 / sample_rate), dtype=np.float64)
    transfer = parameters.gain * parameters.corner_rate / (1.0 - 1j * _ratio(parameters, frequency))
    pulse = _half_sine(parameters.contact_time * frequency)
    lines = np.fft.rfft(force) + np.fft.rfft(impulse) * sample_rate * pulse
    power = 2.0 * np.abs(transfer * lines / force.size) ** 2
    if force.size % 2 == 0:  # the line at half the sample rate is its own mirror
        power[-1] *= 0.5
    numbers = band_numbers(sample_rate)
    band = np.rint(10.0 * np.log10(frequency[1:])).clip(numbers[0], numbers[-1]) - numbers[0]
    return np.bincount(band.astype(np.int64), power[1:], numbers.size).astype(np.float64)


def _ratio(parameters: RadiationParameters, frequency: FloatArray) -> FloatArray:
    """ω_c/ω, and for the constant, which does not sound, as good as infinite."""
    with np.errstate(divide="ignore"):
        return np.minimum(parameters.corner / frequency, 1e150)


def _half_sine(x: FloatArray) -> FloatArray:
    """Magnitude of the spectrum of a half sine of unit area, over duration times frequency."""
    # cos(πx)/(1 − 4x²) as two sinc's, which has no 0/0 at x = 1/2
    return np.asarray(0.25 * np.pi * (np.sinc(x - 0.5) + np.sinc(x + 0.5)))

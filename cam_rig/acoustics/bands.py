"""Third-octave bands (IEC 61260-1): Butterworth filters of order 6, low bands at lower rates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics.level import level_db
from cam_rig.acoustics.weighting import CLASS_1
from cam_rig.arrays import FloatArray

#: n of the lowest and highest band, 10^(n/10) Hz: nominally 12.5 Hz and 16 kHz.
BANDS = (11, 42)
ORDER = 6
#: Half the rate, over the highest band's mid frequency, at least.
ROOM = 0.5 / 0.44
#: A band is filtered at the lowest rate whose half is so many times its upper edge; a rate is not
#: lowered by more than the other.
HEADROOM, MAX_DECIMATION = 1.25, 500
#: r.m.s. pressure (Pa) that silence counts as.
LEAST = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Band levels: exact mid-band frequency (Hz), nominal name, level (dB re 20 µPa)."""

    frequency: FloatArray
    names: tuple[str, ...]
    level_db: FloatArray


def third_octaves(pressure: FloatArray, rate: int) -> Spectrum:
    """Equivalent level in each third-octave band over the samples, ``(n,)`` in Pa.

    The filters begin at rest, so the signal should last some periods of the lowest band's
    width: two seconds for 12.5 Hz. Bands beyond the sample rate's half are left out.
    """
    numbers = np.arange(BANDS[0], BANDS[1] + 1)
    numbers = numbers[10.0 ** (numbers / 10.0) * ROOM * 2.0 <= rate]
    middle = 10.0 ** (numbers / 10.0)
    names = tuple(_name(int(number)) for number in numbers)
    passed = np.array([_passed(pressure, rate, float(frequency)) for frequency in middle])
    return Spectrum(middle, names, level_db(np.maximum(passed, LEAST)))


def _passed(pressure: FloatArray, rate: int, middle: float) -> float:
    """r.m.s. of the band about a frequency."""
    from scipy.signal import butter, resample_poly, sosfilt

    edges = middle * 10.0 ** np.array([-0.05, 0.05])
    factor = min(max(int(rate / 2.0 / (HEADROOM * edges[1])), 1), MAX_DECIMATION)
    slower = resample_poly(pressure, 1, factor) if factor > 1 else pressure
    sections = butter(ORDER, edges, "bandpass", fs=rate / factor, output="sos")
    band = sosfilt(sections, slower)
    return float(np.linalg.norm(band)) / math.sqrt(band.size)


def _name(number: int) -> str:
    nominal = CLASS_1[number - 10][0]
    return f"{nominal / 1000.0:g}k" if nominal >= 1000.0 else f"{nominal:g}"

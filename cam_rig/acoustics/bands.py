"""Third-octave bands (IEC 61260-1), by PyOctaveBand's filter bank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics import FloatArray

#: Nominal frequencies (Hz) of the lowest and highest band.
BANDS = (12.5, 16_000.0)


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
    from pyoctaveband import OctaveFilterBank

    bank = OctaveFilterBank(rate, fraction=3, limits=[BANDS[0], min(BANDS[1], 0.44 * rate)])
    level, names = bank.filter(pressure, detrend=False, nominal=True)
    return Spectrum(np.array(bank.freq), tuple(names), np.asarray(level))

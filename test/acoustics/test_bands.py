"""Third-octave bands on tones."""

import numpy as np
import pytest

from cam_rig.acoustics import pressure_pa, third_octaves

RATE = 48_000


def test_bands_are_the_standards():
    """32 bands from 12.5 Hz to 16 kHz, mid-band frequencies 10^(n/10)."""
    spectrum = third_octaves(np.ones(RATE), RATE)
    assert spectrum.names[0] == "12.5"
    assert spectrum.names[-1] == "16k"
    np.testing.assert_allclose(spectrum.frequency, 10.0 ** (np.arange(11, 43) / 10.0), rtol=1e-3)


@pytest.mark.parametrize("name", ["31.5", "100", "1k", "8k"])
def test_a_tone_is_in_its_band(name):
    """A tone at mid-band reads its level to 0.1 dB there, the neighbours are 17 dB lower."""
    spectrum = third_octaves(np.ones(RATE), RATE)
    band = spectrum.names.index(name)
    t = np.arange(8 * RATE) / RATE
    wave = (
        np.sqrt(2.0) * float(pressure_pa(90.0)) * np.sin(2 * np.pi * spectrum.frequency[band] * t)
    )
    level = third_octaves(wave, RATE).level_db
    assert level[band] == pytest.approx(90.0, abs=0.1)
    assert max(level[band - 1], level[band + 1]) < 90.0 - 17.0
    assert np.delete(level, range(band - 2, band + 3)).max() < 90.0 - 40.0


def test_bands_add_up():
    """White noise: each band holds its share of the bandwidth, and together nearly all."""
    noise = np.random.default_rng(8).normal(size=20 * RATE)
    spectrum = third_octaves(noise, RATE)
    width = spectrum.frequency * (10.0**0.05 - 10.0**-0.05)
    wanted = 10.0 * np.log10(width / (RATE / 2.0) / 4e-10)
    np.testing.assert_allclose(spectrum.level_db[10:], wanted[10:], atol=0.5)


def test_low_rate_leaves_bands_out():
    """At 1 kHz there is no band beyond 400 Hz."""
    assert third_octaves(np.ones(2000), 1000).names[-1] == "400"

"""What a recorded sound measures, and how it becomes numbers of a file."""

import numpy as np
import pytest

from cam_rig.acoustics import pressure_pa
from cam_rig.acoustics.sound_level_meter import full_scale, measure, pcm

RATE = 48_000


def test_levels_of_a_tone():
    """90 dB at 1 kHz: Leq and maxima in every weighting, and the band; no flag."""
    t = np.arange(2 * RATE) / RATE
    wave = np.sqrt(2.0) * float(pressure_pa(90.0)) * np.sin(2.0 * np.pi * 1000.0 * t)
    heard = measure(wave, RATE)
    for name in ("LAeq", "LCeq", "LZeq", "LAFmax", "LCFmax", "LZFmax"):
        assert heard.levels[name] == pytest.approx(90.0, abs=0.05)
    assert heard.levels["LASmax"] == pytest.approx(90.0 + 10.0 * np.log10(1 - np.exp(-2)), abs=0.1)
    assert heard.bands.level_db[heard.bands.names.index("1k")] == pytest.approx(90.0, abs=0.1)
    assert heard.peak_pa == pytest.approx(np.sqrt(2.0) * float(pressure_pa(90.0)), rel=1e-3)
    assert not heard.overload
    assert not heard.under_range
    assert heard.class_1_up_to_hz == 20_000.0


def test_flags():
    """A pressure beyond 130 dB and one below 30 dB are marked."""
    t = np.arange(RATE) / RATE
    wave = np.sin(2.0 * np.pi * 1000.0 * t)
    assert measure(wave * 100.0, RATE).overload
    assert measure(wave * 1e-5, RATE).under_range


@pytest.mark.parametrize(
    ("peak", "scale"), [(0.9, 1.0), (1.0, 1.0), (1.1, 2.0), (3.0, 5.0), (60.0, 100.0), (0.0, 1.0)]
)
def test_full_scale_is_a_round_pressure(peak, scale):
    """1, 2 or 5 times a power of ten, never below the peak."""
    assert full_scale(peak) == pytest.approx(scale, rel=1e-12)


def test_pcm():
    """±scale are the largest numbers, in between in proportion, little-endian."""
    samples = np.frombuffer(pcm(np.array([2.0, -2.0, 0.0, 1.0]), 2.0), dtype="<i2")
    np.testing.assert_array_equal(samples, [32767, -32767, 0, 16384])

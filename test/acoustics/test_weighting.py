"""The digital weightings against annex E and table 3 of IEC 61672-1, at any rate."""

import numpy as np
import pytest
from scipy.signal import sosfreqz

from cam_rig.acoustics.weighting import (
    CLASS_1,
    class_1_up_to_hz,
    exact,
    weighting_filter,
    weighting_power,
)

RATES = [8000, 11_025, 12_000, 16_000, 22_050, 32_000, 44_100, 48_000, 96_000, 192_000, 10**6]
RANDOM = np.random.default_rng(1).integers(8000, 10**6, 20).tolist()


def error_db(curve, rate, frequency):
    """Response of the digital filter less annex E."""
    response = np.abs(sosfreqz(weighting_filter(curve, rate), frequency, fs=rate)[1])
    return 20.0 * np.log10(response) - 10.0 * np.log10(weighting_power(curve, frequency))


def test_the_tables_goals_are_annex_es_formula():
    """Each of the 68 numbers is the formula's, to the table's 0.1 dB."""
    for nominal, a, c, *_ in CLASS_1:
        at = np.array([exact(nominal)])
        assert 10.0 * np.log10(weighting_power("A", at)[0]) == pytest.approx(a, abs=0.0501)
        assert 10.0 * np.log10(weighting_power("C", at)[0]) == pytest.approx(c, abs=0.0501)
    assert weighting_power("Z", np.array([3.0, 20_000.0])).tolist() == [1.0, 1.0]


@pytest.mark.variants(8)
@pytest.mark.parametrize("rate", RATES + RANDOM)
@pytest.mark.parametrize("curve", "AC")
def test_the_response_is_the_analog_one(curve, rate):
    """To 0.07 dB up to nine tenths of half the rate or of 20 kHz, and to 0.55 dB at the end."""
    top = min(rate / 2.0, 20_000.0)
    assert np.abs(error_db(curve, rate, np.geomspace(1.0, 0.9 * top, 300))).max() < 0.07
    assert np.abs(error_db(curve, rate, np.linspace(0.9 * top, top, 50))).max() < 0.55
    poles = [np.roots(section[3:]) for section in weighting_filter(curve, rate)]
    assert max(np.abs(pair).max(initial=0.0) for pair in poles) < 1.0


@pytest.mark.parametrize(
    ("rate", "wanted"),
    [
        (96_000, 20e3),
        (48_000, 20e3),
        (44_100, 20e3),
        (40_000, 20e3),
        (32_000, 16e3),
        (12_000, 5e3),
        (8000, 4e3),
        (1000, 400.0),
        (100, 40.0),
        (19, 0.0),
    ],
)
def test_how_far_class_1_reaches(rate, wanted):
    """To the last third-octave frequency below half the rate; the standard ends at 20 kHz."""
    assert class_1_up_to_hz(rate) == wanted


def test_a_filter_that_falls_off_is_seen(monkeypatch):
    """The bilinear transform at 12 kHz is class 1 up to 3.15 kHz alone, and is told so."""
    from scipy.signal import bilinear_zpk, zpk2sos

    from cam_rig.acoustics import weighting

    def bilinear(curve, rate):
        poles = -2.0 * np.pi * np.array(weighting.POLES[curve])
        zeros = np.zeros(weighting.ZEROS[curve])
        s = 2j * np.pi * 1000.0
        gain = np.abs(np.prod(s - poles) / s**zeros.size)
        return zpk2sos(*bilinear_zpk(zeros, poles, gain, rate))

    monkeypatch.setattr(weighting, "weighting_filter", bilinear)
    assert class_1_up_to_hz(12_000) == 3150.0

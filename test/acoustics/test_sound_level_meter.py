"""The meter and its filters against IEC 61672-1 and 61260-1, and what a recorded sound measures."""

import numpy as np
import pytest
from scipy.signal import bilinear_zpk, sosfreqz, zpk2sos

from cam_rig.acoustics import SoundLevelMeter, level_db, pressure_pa, third_octaves
from cam_rig.acoustics.sound_level_meter import (
    CLASS_1,
    POLES,
    SILENCE_DB,
    ZEROS,
    class_1_up_to_hz,
    exact_frequency,
    full_scale,
    measure,
    pcm,
    weighting_filter,
    weighting_power,
)
from cam_rig.errors import ConfigError, RefusedError
from cam_rig.units import rms

RATE, LOW_RATE = 96_000, 48_000

# The digital weightings against annex E and table 3, at any rate.

RATES = [8000, 11_025, 12_000, 16_000, 22_050, 32_000, 44_100, 48_000, 96_000, 192_000, 10**6]
RATES += np.random.default_rng(1).integers(8000, 10**6, 5).tolist()
#: Up to which frequency the filters are class 1.
REACH = {96_000: 20e3, 48_000: 20e3, 44_100: 20e3, 40_000: 20e3, 32_000: 16e3, 12_000: 5e3}
REACH |= {8000: 4e3, 1000: 400.0, 100: 40.0, 19: 0.0}


def test_the_tables_goals_are_annex_es_formula():
    """Each of the 68 numbers is the formula's, to the table's 0.1 dB."""
    at = np.array([exact_frequency(row[0]) for row in CLASS_1])
    for column, curve in enumerate("AC", start=1):
        goals = [row[column] for row in CLASS_1]
        assert 10.0 * np.log10(weighting_power(curve, at)) == pytest.approx(goals, abs=0.0501)
    assert weighting_power("Z", np.array([3.0, 20_000.0])).tolist() == [1.0, 1.0]


def test_the_response_is_the_analog_one():
    """To 0.07 dB up to nine tenths of half the rate or of 20 kHz, and to 0.55 dB at the end."""
    for i, rate in enumerate(RATES):
        curve, top = "AC"[i % 2], min(rate / 2.0, 20_000.0)
        sections = weighting_filter(curve, rate)
        for frequency, limit in (
            (np.geomspace(1.0, 0.9 * top, 300), 0.07),
            (np.linspace(0.9 * top, top, 50), 0.55),
        ):
            response = np.abs(sosfreqz(sections, frequency, fs=rate)[1])
            wanted = 10.0 * np.log10(weighting_power(curve, frequency))
            assert np.abs(20.0 * np.log10(response) - wanted).max() < limit
        poles = [np.roots(section[3:]) for section in sections]
        assert max(np.abs(pair).max(initial=0.0) for pair in poles) < 1.0


def test_how_far_class_1_reaches(monkeypatch):
    """To the last third-octave frequency below half the rate; the standard ends at 20 kHz."""
    # The bilinear transform at 12 kHz is class 1 up to 3.15 kHz alone, and is told so.
    assert {rate: class_1_up_to_hz(rate) for rate in REACH} == REACH

    def bilinear(curve, rate):
        poles = -2.0 * np.pi * np.array(POLES[curve])
        zeros = np.zeros(ZEROS[curve])
        s = 2j * np.pi * 1000.0
        gain = np.abs(np.prod(s - poles) / s**zeros.size)
        return zpk2sos(*bilinear_zpk(zeros, poles, gain, rate))

    monkeypatch.setattr("cam_rig.acoustics.sound_level_meter.weighting_filter", bilinear)
    assert class_1_up_to_hz(12_000) == 3150.0


# The meter on tones and bursts.

#: Duration in ms of a 4 kHz burst; LAFmax and LASmax less the steady level, LAE less it (table 4).
BURSTS = [
    (1000, 0.0, -2.0, 0.0),
    (500, -0.1, -4.1, -3.0),
    (200, -1.0, -7.4, -7.0),
    (100, -2.6, -10.2, -10.0),
    (50, -4.8, -13.1, -13.0),
    (20, -8.3, -17.0, -17.0),
    (10, -11.1, -20.0, -20.0),
    (5, -14.1, -23.0, -23.0),
    (2, -18.0, -27.0, -27.0),
    (1, -21.0, None, -30.0),
    (0.5, -24.0, None, -33.0),
    (0.25, -27.0, None, -36.0),
]


def tone(frequency, level, seconds, rate=RATE):
    t = np.arange(round(seconds * rate)) / rate
    return np.sqrt(2.0) * float(pressure_pa(level)) * np.sin(2.0 * np.pi * frequency * t)


def steady_level(meter, frequency, level):
    """Leq of a tone once the filters have forgotten its start."""
    seconds = max(0.2, 20.0 / frequency)
    for _ in range(2):
        whole = np.ceil(seconds * frequency) / frequency
        reading = meter.read(tone(frequency, level, whole, meter.rate))
    return reading.equivalent


@pytest.mark.variants(6)
@pytest.mark.parametrize("curve", ["A", "C", "Z"])
@pytest.mark.parametrize("nominal", [row[0] for row in CLASS_1])
def test_frequency_weighting_is_class_1(curve, nominal):
    """From 10 Hz to 20 kHz; the table is of 0.1 dB, and so is the meter."""
    _, a, c, above, below = next(row for row in CLASS_1 if row[0] == nominal)
    wanted = 100.0 + {"A": a, "C": c, "Z": 0.0}[curve]
    error = steady_level(SoundLevelMeter(RATE, curve), exact_frequency(nominal), 100.0) - wanted
    assert below < error < above
    assert abs(error) < 0.07


def test_calibrator_and_range():
    """94 dB at 1 kHz, the calibrator's tone, reads 94.0 dB in every weighting."""
    # A tone reads as what it is from the bottom to the top of 30-130 dB, without a flag.
    for curve, level in (("A", 94.0), ("C", 94.0), ("Z", 94.0), ("A", 30.5), ("A", 129.5)):
        meter = SoundLevelMeter(RATE, curve, "F")
        reading = meter.read(tone(1000.0, level, 1.5))
        assert reading.at_end == pytest.approx(level, abs=0.01)
        assert meter.equivalent == pytest.approx(level, abs=0.01)
        assert not (reading.overload or reading.under_range)


def test_tone_bursts():
    """Maxima and sound exposure of 4 kHz bursts are the standard's, to the table's 0.1 dB."""
    reference = steady_level(SoundLevelMeter(RATE, "A"), 4000.0, 100.0)
    for milliseconds, fast, slow, exposure in BURSTS:
        burst = tone(4000.0, 100.0, milliseconds / 1000.0)
        signal = np.concatenate([burst, np.zeros(RATE // 2)])
        for ballistics, wanted in (("F", fast), ("S", slow)):
            meter = SoundLevelMeter(RATE, "A", ballistics)
            meter.read(signal)
            if wanted is not None:
                assert meter.highest - reference == pytest.approx(wanted, abs=0.15)
            exposed = meter.equivalent + 10.0 * np.log10(signal.size / RATE)
            assert exposed - reference == pytest.approx(exposure, abs=0.15)


def test_decay():
    """After a 4 kHz tone stops the level falls at the rate the standard allows (dB/s)."""
    for ballistics, least, most in (("F", 25.0, 43.5), ("S", 3.4, 5.3)):
        meter = SoundLevelMeter(RATE, "A", ballistics)
        meter.read(tone(4000.0, 100.0, 1.0))
        begin = meter.read(np.zeros(RATE // 10)).at_end
        assert least <= begin - meter.read(np.zeros(RATE)).at_end <= most


def test_blocks_do_not_matter():
    """Cut into blocks of any size, a signal gives the same readings to rounding."""
    # The Leq in Z is the level of the r.m.s. pressure.
    signal = np.random.default_rng(3).normal(size=8000)
    for curve, ballistics in (("A", "F"), ("C", "S"), ("Z", "F")):
        whole = SoundLevelMeter(RATE, curve, ballistics)
        at_end = whole.read(signal).at_end
        for size in (17, 480, 7999):
            cut = SoundLevelMeter(RATE, curve, ballistics)
            for block in np.split(signal, range(size, signal.size, size)):
                last = cut.read(block)
            found = (last.at_end, cut.equivalent, cut.highest)
            assert found == pytest.approx((at_end, whole.equivalent, whole.highest), abs=1e-9)
    assert whole.equivalent == pytest.approx(float(level_db(rms(signal))), abs=1e-9)


def test_level_of_a_steady_sound_is_its_equivalent_level():
    """Pulses once a block: the averaged Fast level comes to Leq, whatever the phase of its end."""
    meter, block = SoundLevelMeter(RATE, "Z", "F"), np.zeros(RATE // 5)
    block[: RATE // 100] = 1.0
    for _ in range(15):
        reading = meter.read(block)
    assert reading.level == pytest.approx(reading.equivalent, abs=1e-3)
    assert reading.highest - reading.at_end > 3.0  # what a reading at one angle would hide


def test_overload_and_under_range_are_shown():
    """A sine 0.1 dB beyond 130 dB is an overload, one 0.1 dB below is none; the mark stays."""
    # The A weighting cannot hide a 20 Hz overload, which comes before it in the instrument. Below
    # 30 dB the number is marked; silence is a number too, not an error.
    meter = SoundLevelMeter(RATE, "A", "F")
    assert not meter.read(tone(1000.0, 129.9, 0.1)).overload
    assert not meter.overloaded
    assert meter.read(tone(1000.0, 130.1, 0.1)).overload
    assert not meter.read(tone(1000.0, 80.0, 0.1)).overload
    assert meter.overloaded
    reading = SoundLevelMeter(RATE, "A", "F").read(tone(20.0, 135.0, 0.5))
    assert reading.level < 90.0 and reading.overload
    assert SoundLevelMeter(RATE, "A", "F").read(tone(1000.0, 25.0, 1.0)).under_range
    silent = SoundLevelMeter(RATE).read(np.zeros(100))
    assert silent.under_range and silent.level == silent.highest == SILENCE_DB


def test_what_is_refused():
    """The standard has no other weightings, and the error lists those it has; no empty block."""
    # A sample that is no number is no silence: the meter reads on as if it had not come.
    for arguments, words in (
        (("B", "F"), "frequency_weighting is 'B'; allowed: A, C, Z"),
        (("A", "I"), "time_weighting is 'I'; allowed: F, S"),
    ):
        with pytest.raises(ConfigError, match=words):
            SoundLevelMeter(RATE, *arguments)
    with pytest.raises(ValueError, match="at least one sample"):
        SoundLevelMeter(RATE).read(np.zeros(0))
    good, words = np.sin(np.arange(4800) * 0.1), r"sample 7 of 4800 is -?(nan|inf) Pa; allowed: fin"
    for broken in (float("nan"), float("inf"), -float("inf")):
        bad = good.copy()
        bad[7] = broken
        meter, other = SoundLevelMeter(LOW_RATE), SoundLevelMeter(LOW_RATE)
        with pytest.raises(RefusedError, match=words):
            meter.read(bad)
        assert meter.read(good) == other.read(good)
        with pytest.raises(RefusedError):
            measure(bad, LOW_RATE)


# What a recorded sound measures, and how it becomes numbers of a file.


def test_levels_of_a_tone():
    """90 dB at 1 kHz: Leq and maxima in every weighting, and the band; no flag."""
    heard = measure(tone(1000.0, 90.0, 2.0, LOW_RATE), LOW_RATE)
    for name in ("LAeq", "LCeq", "LZeq", "LAFmax", "LCFmax", "LZFmax"):
        assert heard.levels[name] == pytest.approx(90.0, abs=0.05)
    assert heard.levels["LASmax"] == pytest.approx(90.0 + 10.0 * np.log10(1 - np.exp(-2)), abs=0.1)
    assert heard.bands.level_db[heard.bands.names.index("1k")] == pytest.approx(90.0, abs=0.1)
    assert heard.peak_pa == pytest.approx(np.sqrt(2.0) * float(pressure_pa(90.0)), rel=1e-3)
    assert not heard.overload and not heard.under_range
    assert heard.class_1_up_to_hz == 20_000.0
    wave = tone(1000.0, 90.0, 0.5, LOW_RATE)
    assert measure(wave * 200.0, LOW_RATE).overload and measure(wave * 1e-4, LOW_RATE).under_range


def test_numbers_of_a_file():
    """Full scale is 1, 2 or 5 times a power of ten, never below the peak."""
    # ±scale are the largest numbers, in between in proportion, little-endian.
    scales = {0.9: 1.0, 1.0: 1.0, 1.1: 2.0, 3.0: 5.0, 60.0: 100.0, 0.0: 1.0}
    assert [full_scale(peak) for peak in scales] == pytest.approx([*scales.values()], rel=1e-12)
    samples = np.frombuffer(pcm(np.array([2.0, -2.0, 0.0, 1.0]), 2.0), dtype="<i2")
    np.testing.assert_array_equal(samples, [32767, -32767, 0, 16384])


def test_bands():
    """32 bands from 12.5 Hz to 16 kHz, mid-band frequencies 10^(n/10); at 1 kHz up to 400 Hz."""
    # White noise: each band holds its share of the bandwidth, and together nearly all.
    spectrum = third_octaves(np.random.default_rng(8).normal(size=10 * LOW_RATE), LOW_RATE)
    assert (spectrum.names[0], spectrum.names[-1]) == ("12.5", "16k")
    np.testing.assert_allclose(spectrum.frequency, 10.0 ** (np.arange(11, 43) / 10.0), rtol=1e-3)
    width = spectrum.frequency * (10.0**0.05 - 10.0**-0.05)
    wanted = 10.0 * np.log10(width / (LOW_RATE / 2.0) / 4e-10)
    np.testing.assert_allclose(spectrum.level_db[12:], wanted[12:], atol=0.6)
    assert third_octaves(np.ones(2000), 1000).names[-1] == "400"


@pytest.mark.parametrize("number", [15, 39])
def test_a_tone_is_in_its_band(number):
    """A tone at mid-band reads its level to 0.1 dB there, the neighbours are 17 dB lower."""
    frequency, band = 10.0 ** (number / 10.0), number - 11
    level = third_octaves(tone(frequency, 90.0, 8.0, LOW_RATE), LOW_RATE).level_db
    assert level[band] == pytest.approx(90.0, abs=0.1)
    assert max(level[band - 1], level[band + 1]) < 90.0 - 17.0
    assert np.delete(level, range(band - 2, band + 3)).max() < 90.0 - 40.0

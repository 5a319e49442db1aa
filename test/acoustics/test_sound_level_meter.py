"""The meter and its filters against IEC 61672-1 and 61260-1, and what a recorded sound measures."""

import numpy as np
import pytest
from scipy.signal import sosfreqz

from cam_rig.acoustics import SoundLevelMeter, level_db, pressure_pa, third_octaves
from cam_rig.acoustics.sound_level_meter import SILENCE, full_scale, measure, pcm
from cam_rig.acoustics.weighting import (
    CLASS_1,
    class_1_up_to_hz,
    exact,
    weighting_filter,
    weighting_power,
)
from cam_rig.errors import ConfigError, RefusedError

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


def test_the_response_is_the_analog_one():
    """To 0.07 dB up to nine tenths of half the rate or of 20 kHz, and to 0.55 dB at the end."""
    for curve in "AC":
        for rate in RATES + RANDOM:
            top = min(rate / 2.0, 20_000.0)
            assert np.abs(error_db(curve, rate, np.geomspace(1.0, 0.9 * top, 300))).max() < 0.07
            assert np.abs(error_db(curve, rate, np.linspace(0.9 * top, top, 50))).max() < 0.55
            poles = [np.roots(section[3:]) for section in weighting_filter(curve, rate)]
            assert max(np.abs(pair).max(initial=0.0) for pair in poles) < 1.0


def test_how_far_class_1_reaches():
    """To the last third-octave frequency below half the rate; the standard ends at 20 kHz."""
    for rate, wanted in [
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
    ]:
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


RATE = 96_000
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


@pytest.mark.variants(8)
@pytest.mark.parametrize("curve", ["A", "C", "Z"])
@pytest.mark.parametrize("nominal", [row[0] for row in CLASS_1])
def test_frequency_weighting_is_class_1(curve, nominal):
    """Tones at every third-octave centre from 10 Hz to 20 kHz read as the standard's table.

    The table is of 0.1 dB, and so is the meter.
    """
    _, a, c, above, below = next(row for row in CLASS_1 if row[0] == nominal)
    wanted = {"A": a, "C": c, "Z": 0.0}[curve]
    error = steady_level(SoundLevelMeter(RATE, curve), exact(nominal), 100.0) - 100.0 - wanted
    assert below < error < above
    assert abs(error) < 0.07


def test_calibrator():
    """94 dB at 1 kHz, the calibrator's tone, reads 94.0 dB in every weighting."""
    for weighting in ["A", "C", "Z"]:
        meter = SoundLevelMeter(RATE, weighting, "F")
        reading = meter.read(tone(1000.0, 94.0, 2.0))
        assert reading.at_end == pytest.approx(94.0, abs=0.01)
        assert meter.equivalent == pytest.approx(94.0, abs=0.01)


def test_linear_over_its_range():
    """A tone reads as what it is from the bottom to the top of 30-130 dB, without a flag."""
    for level in [30.5, 60.0, 94.0, 129.5]:
        reading = SoundLevelMeter(RATE, "A", "F").read(tone(1000.0, level, 2.0))
        assert reading.at_end == pytest.approx(level, abs=0.01)
        assert not reading.overload
        assert not reading.under_range


def test_tone_bursts():
    """Maxima and sound exposure of 4 kHz bursts are the standard's, to the table's 0.1 dB."""
    for milliseconds, fast, slow, exposure in BURSTS:
        burst = tone(4000.0, 100.0, milliseconds / 1000.0)
        signal = np.concatenate([burst, np.zeros(RATE // 2)])
        for weighting, wanted in (("F", fast), ("S", slow)):
            meter = SoundLevelMeter(RATE, "A", weighting)
            reference = steady_level(SoundLevelMeter(RATE, "A"), 4000.0, 100.0)
            meter.read(signal)
            if wanted is not None:
                assert meter.highest - reference == pytest.approx(wanted, abs=0.15)
            exposed = meter.equivalent + 10.0 * np.log10(signal.size / RATE)
            assert exposed - reference == pytest.approx(exposure, abs=0.15)


def test_decay():
    """After a 4 kHz tone stops the level falls at the rate the standard allows (dB/s)."""
    for weighting, least, most in [("F", 25.0, 43.5), ("S", 3.4, 5.3)]:
        meter = SoundLevelMeter(RATE, "A", weighting)
        meter.read(tone(4000.0, 100.0, 1.0))
        begin = meter.read(np.zeros(RATE // 10)).at_end
        end = meter.read(np.zeros(RATE)).at_end
        assert least <= begin - end <= most


@pytest.mark.parametrize("curve", ["A", "C", "Z"])
@pytest.mark.parametrize("ballistics", ["F", "S"])
def test_blocks_do_not_matter(curve, ballistics):
    signal = np.random.default_rng(3).normal(size=20_000)
    whole = SoundLevelMeter(RATE, curve, ballistics)
    at_end = whole.read(signal).at_end
    for size in (17, 480, 19_999):
        cut = SoundLevelMeter(RATE, curve, ballistics)
        for block in np.split(signal, range(size, signal.size, size)):
            last = cut.read(block)
        assert last.at_end == pytest.approx(at_end, abs=1e-9)
        assert cut.equivalent == pytest.approx(whole.equivalent, abs=1e-9)
        assert cut.highest == pytest.approx(whole.highest, abs=1e-9)


def test_level_of_a_steady_sound_is_its_equivalent_level():
    """Pulses once a block: the averaged Fast level comes to Leq, whatever the phase of its end."""
    meter, block = SoundLevelMeter(RATE, "Z", "F"), np.zeros(RATE // 5)
    block[: RATE // 100] = 1.0
    for _ in range(15):
        reading = meter.read(block)
    assert reading.level == pytest.approx(reading.equivalent, abs=1e-3)
    assert reading.highest - reading.at_end > 3.0  # what a reading at one angle would hide


def test_overload_is_shown_and_stays():
    """A sine 0.1 dB beyond 130 dB is an overload, one 0.1 dB below is none; the mark stays."""
    meter = SoundLevelMeter(RATE, "A", "F")
    assert not meter.read(tone(1000.0, 129.9, 0.1)).overload
    assert not meter.overloaded
    assert meter.read(tone(1000.0, 130.1, 0.1)).overload
    assert not meter.read(tone(1000.0, 80.0, 0.1)).overload
    assert meter.overloaded


def test_overload_is_of_the_unweighted_pressure():
    """The A weighting cannot hide a 20 Hz overload, which comes before it in the instrument."""
    reading = SoundLevelMeter(RATE, "A", "F").read(tone(20.0, 135.0, 0.5))
    assert reading.level < 90.0
    assert reading.overload


def test_under_range_is_shown():
    """Below 30 dB the number is marked; silence is a number too, not an error."""
    meter = SoundLevelMeter(RATE, "A", "F")
    assert meter.read(tone(1000.0, 25.0, 1.0)).under_range
    silent = SoundLevelMeter(RATE).read(np.zeros(100))
    assert silent.under_range
    assert silent.level == silent.highest == SILENCE


def test_unknown_weightings_are_refused():
    """The standard has no others, and the error lists those it has."""
    for arguments, words in [
        (("B", "F"), "frequency_weighting is 'B'; allowed: A, C, Z"),
        (("A", "I"), "time_weighting is 'I'; allowed: F, S"),
    ]:
        with pytest.raises(ConfigError, match=words):
            SoundLevelMeter(RATE, *arguments)


def test_empty_block_is_refused():
    with pytest.raises(ValueError, match="at least one sample"):
        SoundLevelMeter(RATE).read(np.zeros(0))


def test_level_db_and_meter_agree():
    signal = np.random.default_rng(5).normal(size=1000)
    meter = SoundLevelMeter(RATE)
    meter.read(signal)
    assert meter.equivalent == pytest.approx(float(level_db(np.sqrt(np.mean(signal**2)))), abs=1e-9)


@pytest.mark.variants(8)
@pytest.mark.parametrize("rate", [12_000, 44_100, 48_000])
@pytest.mark.parametrize("curve", ["A", "C"])
@pytest.mark.parametrize("nominal", [31.5, 1000.0, 2500.0, 4000.0, 5000.0, 12_500.0, 20_000.0])
def test_class_1_up_to_what_is_said(rate, curve, nominal):
    """At any rate the meter is within 0.25 dB of the standard up to the frequency that it says."""
    meter = SoundLevelMeter(rate, curve)
    if nominal > meter.class_1_up_to_hz:
        assert nominal > rate / 2.0
        return
    _, a, c, above, below = next(row for row in CLASS_1 if row[0] == nominal)
    error = steady_level(meter, exact(nominal), 100.0) - 100.0 - {"A": a, "C": c}[curve]
    assert below < error < above
    assert abs(error) < 0.25


def test_a_broken_signal_is_no_silence():
    """A sample that is no number is refused, and the meter reads on as if it had not come."""
    for broken in [float("nan"), float("inf"), -float("inf")]:
        good = np.sin(np.arange(4800) * 0.1)
        bad = good.copy()
        bad[7] = broken
        meter, other = SoundLevelMeter(48_000), SoundLevelMeter(48_000)
        with pytest.raises(
            RefusedError, match=r"sample 7 of 4800 is -?(nan|inf) Pa; allowed: finite"
        ):
            meter.read(bad)
        assert meter.read(good) == other.read(good)
        with pytest.raises(RefusedError):
            measure(bad, 48_000)


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


def test_full_scale_is_a_round_pressure():
    """1, 2 or 5 times a power of ten, never below the peak."""
    for peak, scale in [(0.9, 1.0), (1.0, 1.0), (1.1, 2.0), (3.0, 5.0), (60.0, 100.0), (0.0, 1.0)]:
        assert full_scale(peak) == pytest.approx(scale, rel=1e-12)


def test_pcm():
    samples = np.frombuffer(pcm(np.array([2.0, -2.0, 0.0, 1.0]), 2.0), dtype="<i2")
    np.testing.assert_array_equal(samples, [32767, -32767, 0, 16384])


RATE = 48_000


def test_bands_are_the_standards():
    """32 bands from 12.5 Hz to 16 kHz, mid-band frequencies 10^(n/10)."""
    spectrum = third_octaves(np.ones(RATE), RATE)
    assert spectrum.names[0] == "12.5"
    assert spectrum.names[-1] == "16k"
    np.testing.assert_allclose(spectrum.frequency, 10.0 ** (np.arange(11, 43) / 10.0), rtol=1e-3)


def test_a_tone_is_in_its_band():
    """A tone at mid-band reads its level to 0.1 dB there, the neighbours are 17 dB lower."""
    for name in ["31.5", "100", "1k", "8k"]:
        spectrum = third_octaves(np.ones(RATE), RATE)
        band = spectrum.names.index(name)
        t = np.arange(8 * RATE) / RATE
        wave = (
            np.sqrt(2.0)
            * float(pressure_pa(90.0))
            * np.sin(2 * np.pi * spectrum.frequency[band] * t)
        )
        level = third_octaves(wave, RATE).level_db
        assert level[band] == pytest.approx(90.0, abs=0.1)
        assert max(level[band - 1], level[band + 1]) < 90.0 - 17.0
        assert np.delete(level, range(band - 2, band + 3)).max() < 90.0 - 40.0


def test_bands_add_up():
    noise = np.random.default_rng(8).normal(size=20 * RATE)
    spectrum = third_octaves(noise, RATE)
    width = spectrum.frequency * (10.0**0.05 - 10.0**-0.05)
    wanted = 10.0 * np.log10(width / (RATE / 2.0) / 4e-10)
    np.testing.assert_allclose(spectrum.level_db[10:], wanted[10:], atol=0.5)


def test_low_rate_leaves_bands_out():
    """At 1 kHz there is no band beyond 400 Hz."""
    assert third_octaves(np.ones(2000), 1000).names[-1] == "400"

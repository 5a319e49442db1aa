"""The meter against the tables of IEC 61672-1: weightings, tone bursts, decay, range."""

import numpy as np
import pytest

from cam_rig.acoustics import SoundLevelMeter, level_db, pressure_pa
from cam_rig.acoustics.sound_level_meter import SILENCE, measure
from cam_rig.acoustics.weighting import CLASS_1, exact
from cam_rig.errors import ConfigError, RefusedError

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


@pytest.mark.parametrize("weighting", ["A", "C", "Z"])
def test_calibrator(weighting):
    """94 dB at 1 kHz, the calibrator's tone, reads 94.0 dB in every weighting."""
    meter = SoundLevelMeter(RATE, weighting, "F")
    reading = meter.read(tone(1000.0, 94.0, 2.0))
    assert reading.at_end == pytest.approx(94.0, abs=0.01)
    assert meter.equivalent == pytest.approx(94.0, abs=0.01)


@pytest.mark.parametrize("level", [30.5, 60.0, 94.0, 129.5])
def test_linear_over_its_range(level):
    """A tone reads as what it is from the bottom to the top of 30-130 dB, without a flag."""
    reading = SoundLevelMeter(RATE, "A", "F").read(tone(1000.0, level, 2.0))
    assert reading.at_end == pytest.approx(level, abs=0.01)
    assert not reading.overload
    assert not reading.under_range


@pytest.mark.parametrize(("milliseconds", "fast", "slow", "exposure"), BURSTS)
def test_tone_bursts(milliseconds, fast, slow, exposure):
    """Maxima and sound exposure of 4 kHz bursts are the standard's, to the table's 0.1 dB."""
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


@pytest.mark.parametrize(("weighting", "least", "most"), [("F", 25.0, 43.5), ("S", 3.4, 5.3)])
def test_decay(weighting, least, most):
    """After a 4 kHz tone stops the level falls at the rate the standard allows (dB/s)."""
    meter = SoundLevelMeter(RATE, "A", weighting)
    meter.read(tone(4000.0, 100.0, 1.0))
    begin = meter.read(np.zeros(RATE // 10)).at_end
    end = meter.read(np.zeros(RATE)).at_end
    assert least <= begin - end <= most


@pytest.mark.parametrize("curve", ["A", "C", "Z"])
@pytest.mark.parametrize("ballistics", ["F", "S"])
def test_blocks_do_not_matter(curve, ballistics):
    """Cut into blocks of any size, a signal gives the same readings to rounding."""
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


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("B", "F"), "frequency_weighting is 'B'; allowed: A, C, Z"),
        (("A", "I"), "time_weighting is 'I'; allowed: F, S"),
    ],
)
def test_unknown_weightings_are_refused(arguments, words):
    """The standard has no others, and the error lists those it has."""
    with pytest.raises(ConfigError, match=words):
        SoundLevelMeter(RATE, *arguments)


def test_empty_block_is_refused():
    """No samples, no reading."""
    with pytest.raises(ValueError, match="at least one sample"):
        SoundLevelMeter(RATE).read(np.zeros(0))


def test_level_db_and_meter_agree():
    """The meter's Leq in Z is the level of the r.m.s. pressure."""
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


@pytest.mark.parametrize("broken", [float("nan"), float("inf"), -float("inf")])
def test_a_broken_signal_is_no_silence(broken):
    """A sample that is no number is refused, and the meter reads on as if it had not come."""
    good = np.sin(np.arange(4800) * 0.1)
    bad = good.copy()
    bad[7] = broken
    meter, other = SoundLevelMeter(48_000), SoundLevelMeter(48_000)
    with pytest.raises(RefusedError, match=r"sample 7 of 4800 is -?(nan|inf) Pa; allowed: finite"):
        meter.read(bad)
    assert meter.read(good) == other.read(good)
    with pytest.raises(RefusedError):
        measure(bad, 48_000)

"""Tests of the simulated sound-level meter and of signals of instruments."""

import dataclasses

import numpy as np
import pytest

from cam_rig.acoustics import SoundSource, level_db
from cam_rig.errors import ConfigError
from cam_rig.simulation.instruments import Signal, encoder_count
from cam_rig.simulation.meter import MeterSimulator
from cam_rig.simulation.simulate import MicrophoneSimulator, simulate_ticks
from cam_rig.units import TURN


def listen(loaded, background, frequency="Z", time="F"):
    """Yield the meter's reading of each tick, and its level (dB) by the sound energy.

    A tick is the interval between two cam states, one turn by default. The energy is computed
    directly from the force. `background` is in dB. `frequency` and `time` are the weightings.
    """
    radiation = dataclasses.replace(loaded.radiation, background=background)
    rate = int(loaded.scene.sample_rate.si)
    account = MicrophoneSimulator(radiation, rate)
    meter = MeterSimulator(SoundSource(radiation, rate))
    meter.weigh(frequency, time)
    for tick in simulate_ticks(loaded):
        reading = meter.read(tick.rows, tick.start.speed)
        yield reading, float(level_db(account.listen(tick.rows, tick.start.speed)))


@pytest.mark.parametrize("cam", ["poly345", "tm21"])
def test_the_meter_agrees_with_the_energy_account(make_loaded_scene, cam):
    """Without background, the meter's LZeq of a tick is the level of the sound energy.

    A tick is the interval between two cam states. The energy is computed directly from the force.
    The levels agree to 0.03 dB in contact, and to 0.15 dB with landings.
    """
    # The tolerance in contact is 0.03 dB, because arcs make the force jump between samples. The
    # pulse of a landing is added to the force and also excites the structure. The account ignores
    # both, which is 0.1 dB if landings make all the sound.
    loaded = make_loaded_scene(cams=[cam], speeds=[200, 400], turns=3, sample_rate=12_000)
    for reading, level in listen(loaded, background=-400.0):
        assert reading.equivalent == pytest.approx(level, abs=0.15 if level > 95.0 else 0.03)
        assert not reading.overload and not reading.under_range


def levels(loaded, *settings):
    """Return the level (dB) of each tick, with meter settings applied before tick 2.

    A tick is the interval between two cam states. A setting is a pair of weightings.
    """
    meter, readings = MeterSimulator.of(loaded), []
    for number, tick in enumerate(simulate_ticks(loaded)):
        for setting in settings if number == 2 else ():
            meter.weigh(*setting)
        readings.append(meter.read(tick.rows, tick.interval.mean_speed).level)
    return readings


def test_setting_the_present_weighting_continues_the_measurement(make_loaded_scene):
    """A change of the meter's weighting to its present value has no effect.

    Another weighting starts a new measurement. An unknown weighting is an error.
    """
    # Otherwise a recording of the measurement could not be reproduced.
    loaded = make_loaded_scene(cams=["poly345"], speeds=[300], turns=5)
    assert levels(loaded, ("Z", "F")) == levels(loaded)
    assert levels(loaded, ("A", "S"), ("Z", "F")) == levels(loaded), "changed back in between"
    other = levels(loaded, ("A", "F"))
    assert other[:2] == levels(loaded)[:2] and other[2:] != levels(loaded)[2:]
    meter = MeterSimulator.of(loaded)
    with pytest.raises(ConfigError, match="time_weighting is 'I'"):
        meter.weigh("A", "I")
    assert meter.quantity == "LZF"


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", range(40))
def test_encoder_count_finds_the_count_of_an_encoder(seed):
    """`encoder_count` finds the angle (rad) of one encoder count from the readings.

    It does so at any speed, at even and uneven times, and with missing counts.
    """
    random = np.random.default_rng(seed)
    number = int(random.choice([60, 360, 500, 1000, 1024, 4096, 10_000]))
    time = np.linspace(0.0, random.uniform(1.0, 12.0), int(random.choice([1000, 5000, 20_000])))
    if seed % 2:
        time = np.sort(random.uniform(0.0, time[-1], time.size))
    angle = random.uniform(3.0, 60.0) * time + 0.02 * np.sin(3.0 * time) * (seed % 3)
    step = TURN / number
    stepped = np.floor((angle + random.uniform(0.0, 40.0)) / step) * step
    assert TURN / encoder_count(stepped) == pytest.approx(number, rel=1e-6)


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(10))
def test_encoder_count_is_zero_for_an_exact_angle(seed):
    """`encoder_count` returns 0 for angles that are not multiples of an encoder count.

    The angles have a constant speed, ripple, or random steps.
    """
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, 3.0, 3000)
    speed = random.uniform(3.0, 60.0)
    assert encoder_count(speed * time) == 0.0
    assert encoder_count(speed * time + 0.2 * np.sin(7.0 * time)) == 0.0
    assert encoder_count(np.cumsum(random.uniform(0.0, 0.05, 6000))) == 0.0


def test_a_lower_speed_of_an_encoder_that_reports_each_count_is_not_a_gap():
    """An encoder that reports each count has longer time steps at a lower speed.

    They are not reported as a gap. Four lost counts among them are.
    """
    steps = np.repeat([1e-4, 8e-4], [3000, 1000])
    time = np.cumsum(steps * (1.0 + 0.02 * np.sin(np.arange(4000))))
    assert Signal(time, time).gaps().size == 0
    kept = np.delete(time, slice(3500, 3504))
    np.testing.assert_array_equal(Signal(kept, kept).gaps(), [[time[3499], time[3504]]])


def test_scattered_stamps_are_not_gaps():
    """Irregular time stamps, with steps of 0 to 2 times the mean, are not gaps.

    A network that delivers in bursts has such stamps.
    """
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.0, 2e-3, 5000))
    assert Signal(time, time).gaps().size == 0
    assert Signal(time[:3], time[:3]).gaps().size == 0

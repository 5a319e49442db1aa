"""The meter before a running scene reads what the energy account says."""

import dataclasses

import numpy as np
import pytest

from cam_rig.acoustics import SoundSource, level_db
from cam_rig.errors import ConfigError
from cam_rig.simulation.instruments import Signal, encoder_count
from cam_rig.simulation.meter import MeterSimulator
from cam_rig.simulation.simulate import MicrophoneSimulator, turned_ticks
from cam_rig.units import TURN


def listen(loaded, background, frequency="Z", time="F"):
    """Each tick's reading, and its level by the energy account, with a background in dB."""
    radiation = dataclasses.replace(loaded.radiation, background=background)
    rate = int(loaded.scene.sample_rate.si)
    account = MicrophoneSimulator(radiation, rate)
    meter = MeterSimulator(SoundSource(radiation, rate))
    meter.weigh(frequency, time)
    for tick in turned_ticks(loaded):
        reading = meter.read(tick.rows, tick.start.speed)
        yield reading, float(level_db(account.listen(tick.rows, tick.start.speed)))


@pytest.mark.parametrize("cam", ["poly345", "tm21"])
def test_the_meter_reads_the_account(make_loaded_scene, cam):
    """Without background LZeq of each tick is the account's level."""
    # To 0.03 dB in contact, since arcs make the force jump between samples. A landing's pulse
    # meets the force there is and what it does to the structure itself, which the account leaves
    # out: 0.1 dB where landings make all the sound.
    loaded = make_loaded_scene(cams=[cam], speeds=[200, 400], turns=3, sample_rate=12_000)
    for reading, level in listen(loaded, background=-400.0):
        assert reading.equivalent == pytest.approx(level, abs=0.15 if level > 95.0 else 0.03)
        assert not reading.overload and not reading.under_range


def levels(loaded, *settings):
    """Each tick's level; before tick 2 the meter is set to each of these, one after the other."""
    meter, found = MeterSimulator.of(loaded), []
    for number, tick in enumerate(turned_ticks(loaded)):
        for setting in settings if number == 2 else ():
            meter.weigh(*setting)
        found.append(meter.read(tick.rows, tick.interval.mean_speed).level)
    return found


def test_a_weighting_that_is_set_already_changes_nothing(make_loaded_scene):
    """The measurement goes on, else a recording of it could not be repeated."""
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
def test_the_count_is_found(seed):
    """Of any encoder, at any speed, read at even times or not; some counts may be passed over."""
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
def test_an_exact_angle_has_no_counts(seed):
    """Neither at a steady speed, whose steps are equal, nor with ripple, nor at random times."""
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, 3.0, 3000)
    speed = random.uniform(3.0, 60.0)
    assert encoder_count(speed * time) == 0.0
    assert encoder_count(speed * time + 0.2 * np.sin(7.0 * time)) == 0.0
    assert encoder_count(np.cumsum(random.uniform(0.0, 0.05, 6000))) == 0.0


def test_an_encoder_that_reports_each_count_has_no_gap_where_it_turns_slower():
    """Eight times slower, the steps are eight times as long; a lost stretch there is a gap."""
    steps = np.repeat([1e-4, 8e-4], [3000, 1000])
    time = np.cumsum(steps * (1.0 + 0.02 * np.sin(np.arange(4000))))
    assert Signal(time, time).gaps().size == 0
    kept = np.delete(time, slice(3500, 3504))
    np.testing.assert_array_equal(Signal(kept, kept).gaps(), [[time[3499], time[3504]]])


def test_stamps_that_scatter_are_no_gaps():
    """A network that delivers in bursts: steps from nothing to three times the usual."""
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.0, 2e-3, 5000))
    assert Signal(time, time).gaps().size == 0
    assert Signal(time[:3], time[:3]).gaps().size == 0

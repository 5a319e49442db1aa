"""The meter before a running scene reads what the energy account says."""

import dataclasses

import numpy as np
import pytest

from cam_rig.acoustics import SoundSource, level_db
from cam_rig.errors import ConfigError
from cam_rig.experiment.listening import MeterBench
from cam_rig.experiment.program import cam_states
from cam_rig.experiment.sweep import FollowerBench, MicrophoneBench


def listen(stage, background, frequency="Z", time="F"):
    """Each tick's reading, and its level by the energy account, with a background in dB."""
    radiation = dataclasses.replace(stage.radiation, background=background)
    rate = int(stage.scene.sample_rate.si)
    follower, account = FollowerBench.of(stage), MicrophoneBench(radiation, rate)
    meter = MeterBench(SoundSource(radiation, rate))
    meter.weigh(frequency, time)
    before = None
    for state in cam_states(stage.scene):
        turned = follower.turn_to(state)
        if turned is not None:
            rows = turned[1].rows
            reading = meter.read(rows, before.speed)
            yield reading, float(level_db(account.listen(rows, before.speed)))
        before = state


@pytest.mark.parametrize("cam", ["poly345", "tm21"])
def test_the_meter_reads_the_account(make_stage, cam):
    """Without background LZeq of each tick is the account's level.

    To 0.03 dB in contact, since arcs make the force jump between samples. A landing's pulse
    meets the force there is and what it does to the structure itself, which the account leaves
    out: 0.1 dB where landings make all the sound.
    """
    stage = make_stage(cams=[cam], speeds=[200, 400], turns=3, sample_rate=12_000)
    for reading, level in listen(stage, background=-400.0):
        assert reading.equivalent == pytest.approx(level, abs=0.15 if level > 95.0 else 0.03)
        assert not reading.overload
        assert not reading.under_range


def levels(stage, *settings):
    """Each tick's level; before tick 2 the meter is set to each of these, one after the other."""
    follower = FollowerBench.of(stage)
    meter = MeterBench.of(stage)
    blocks = (turned[1] for state in cam_states(stage.scene) if (turned := follower.turn_to(state)))
    found = []
    for number, block in enumerate(blocks):
        for setting in settings if number == 2 else ():
            meter.weigh(*setting)
        found.append(meter.read(block.rows, block.interval.mean_speed).level)
    return found


def test_a_weighting_that_is_set_already_changes_nothing(make_stage):
    """The measurement goes on, else a recording of it could not be repeated."""
    stage = make_stage(cams=["poly345"], speeds=[300], turns=5)
    assert levels(stage, ("Z", "F")) == levels(stage)
    assert levels(stage, ("A", "S"), ("Z", "F")) == levels(stage), "changed back in between"
    other = levels(stage, ("A", "F"))
    assert other[:2] == levels(stage)[:2] and other[2:] != levels(stage)[2:]


def test_background_adds_its_energy(make_stage):
    """With background too, on the mean over many ticks: it is noise, a tick is short."""
    stage = make_stage(cams=["tm21"], speeds=[200], turns=20)
    heard = np.array([(10 ** (r.equivalent / 10), 10 ** (a / 10)) for r, a in listen(stage, 73.0)])
    measured, account = 10.0 * np.log10(heard.mean(axis=0))
    assert measured == pytest.approx(account, abs=0.15)


def test_fast_level_settles_to_the_account(make_stage):
    """After ten turns (two seconds) the Fast level, averaged over a turn, is the level there."""
    stage = make_stage(cams=["poly345"], speeds=[300], turns=12, sample_rate=12_000)
    *_, (reading, level) = listen(stage, background=-400.0)
    assert reading.level == pytest.approx(level, abs=0.01)


def test_most_of_the_sound_is_below_hearing(make_stage):
    """The structure passes the cam's low harmonics, which A weighs down: LA is far below LZ."""
    stage = make_stage(cams=["poly345"], speeds=[300], turns=4)
    last = {}
    for weighting in "ACZ":
        *_, (reading, _) = listen(stage, -400.0, weighting)
        last[weighting] = reading.equivalent
    assert last["A"] < last["C"] - 5.0 < last["Z"] - 10.0


def test_weighting_begins_anew(make_stage):
    """A change of weighting begins a new measurement; an unknown one leaves the old."""
    bench = MeterBench.of(make_stage())
    before = bench.meter
    with pytest.raises(ConfigError, match="time_weighting is 'I'"):
        bench.weigh("A", "I")
    assert bench.meter is before
    bench.weigh("C", "S")
    assert bench.quantity == "LCS"

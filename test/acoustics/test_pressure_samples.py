"""Pressure samples: the energy of the account, pulses kept whole, noise that repeats."""

import dataclasses

import numpy as np
import pytest

from cam_rig.acoustics import SoundSource, level_db, rms_pressure, third_octaves
from cam_rig.acoustics.pressure import Background

RATE, SPEED = 12_000, 30.0
RNG = np.random.default_rng(17)


def rms_db(pressure):
    return float(level_db(np.sqrt(np.mean(pressure**2))))


def smooth_force(seconds, rate=RATE):
    """A force of some tens of N with harmonics up to 60 Hz."""
    t = np.arange(round(seconds * rate)) / rate
    return sum(30.0 / n * np.cos(2.0 * np.pi * 5.0 * n * t + n) for n in range(1, 13))


def test_samples_hold_the_energy_of_the_account(silent):
    """Without background, LZeq of the samples is the level of `rms_pressure`, to 1e-3 dB."""
    force, none = smooth_force(1.0), np.zeros(RATE)
    _, account = rms_pressure(silent, None, force, none, RATE, SPEED)
    pressure = SoundSource(silent, RATE).pressure(force, none, SPEED)
    assert rms_db(pressure) == pytest.approx(float(level_db(account)), abs=1e-3)


def test_pressure_is_at_the_listening_rate(silent):
    """The smallest whole multiple of the block's rate from 96 kHz on, and never less than it."""
    rates = {1000: 96_000, 12_000: 96_000, 44_100: 132_300, 96_000: 96_000, 200_000: 200_000}
    for block_rate, rate in rates.items():
        source = SoundSource(silent, block_rate)
        assert source.rate == rate
        block = np.zeros(10)
        assert source.pressure(block, block, SPEED).size == 10 * source.factor


def test_more_samples_between_change_nothing_at_the_old_ones(silent):
    """The force is straight between samples, so a higher rate only fills in."""
    force, none = smooth_force(0.1), np.zeros(RATE // 10)
    coarse = SoundSource(silent, RATE, least_rate=RATE).pressure(force, none, SPEED)
    source = SoundSource(silent, RATE)
    fine = source.pressure(force, none, SPEED)
    np.testing.assert_allclose(fine[source.factor - 1 :: source.factor], coarse, atol=1e-12)


@pytest.mark.parametrize("contact_time", [2e-4, 1e-3, 1e-6])
def test_a_landing_keeps_its_area(silent, contact_time):
    """∫p dt of a pulse is gain ω_c J at any contact time, shorter than a sample or longer."""
    radiation = dataclasses.replace(silent, contact_time=contact_time, corner=1e-6)
    impulse = np.zeros(200)
    impulse[[3, 60]] = 1.5, 0.5
    source = SoundSource(radiation, RATE)
    pressure = source.pressure(np.zeros(200), impulse, SPEED)
    area = float(pressure.sum()) / source.rate
    assert area == pytest.approx(radiation.gain * radiation.corner_rate * 2.0, rel=1e-6)


def test_a_landing_has_the_energy_of_the_account(silent):
    """∫p² of the sampled half sine is that of `landing_energy`, within 1 % (0.2 ms at 96 kHz)."""
    radiation = dataclasses.replace(silent, contact_time=2e-4, corner=1e-3)
    impulse = np.zeros(100)
    impulse[50] = 2.0
    source = SoundSource(radiation, RATE)
    pressure = source.pressure(np.zeros(100), impulse, SPEED)
    energy = float(pressure @ pressure) / source.rate
    assert energy == pytest.approx(float(radiation.landing_energy(impulse).sum()), rel=0.01)


@pytest.mark.parametrize("size", [1, 3, 250, 999])
def test_blocks_do_not_matter(radiation, size):
    """Cut anywhere, even within a landing's pulse, the samples are the same: state is carried."""
    force = smooth_force(1000 / RATE)
    impulse = np.where(RNG.random(1000) < 0.02, 0.4, 0.0)
    whole = SoundSource(radiation, RATE).pressure(force, impulse, SPEED)
    source, cuts = SoundSource(radiation, RATE), range(size, 1000, size)
    blocks = zip(np.split(force, cuts), np.split(impulse, cuts), strict=True)
    pieces = [source.pressure(f, j, SPEED) for f, j in blocks]
    np.testing.assert_allclose(np.concatenate(pieces), whole, rtol=1e-9, atol=1e-12)


def test_background_follows_the_speed(radiation):
    """At rest the background is heard, at the level of the speed, 3.2 dB higher an octave on."""
    source, still = SoundSource(radiation, RATE), np.full(3 * RATE, 100.0)
    for speed in (radiation.background_at, 2.0 * radiation.background_at):
        heard = rms_db(source.pressure(still, 0.0 * still, speed))
        wanted = float(level_db(np.sqrt(radiation.background_power(speed))))
        assert heard == pytest.approx(wanted, abs=0.2)


def test_background_is_seeded(radiation):
    """The same seed, the same noise; another seed, another."""
    still = np.zeros(100)
    one, same, other = (
        SoundSource(radiation, RATE, seed=seed).pressure(still, still, SPEED) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert not np.allclose(one, other)


@pytest.mark.parametrize("rate", [48_000, 96_000])
def test_background_spectrum(rate):
    """Unit variance at any rate, and 6 dB an octave less above the corner."""
    noise = Background(500.0, rate, seed=4).samples(10 * rate)
    assert float(np.var(noise)) == pytest.approx(1.0, rel=0.02)
    level = dict(zip((s := third_octaves(noise, rate)).names, s.level_db, strict=True))
    assert level["100"] - level["50"] == pytest.approx(3.0, abs=0.5)  # white: 3 dB an octave
    assert level["8k"] - level["4k"] == pytest.approx(-3.0, abs=0.5)  # 3 dB less 6


def test_empty_block_is_refused(radiation):
    """No samples, no sound."""
    with pytest.raises(ValueError, match="at least one sample"):
        SoundSource(radiation, RATE).pressure(np.zeros(0), np.zeros(0), SPEED)

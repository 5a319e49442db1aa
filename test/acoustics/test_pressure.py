"""Tests of the sound model, from contact force and impulses to sound pressure.

They cover the radiation model, the energy per block, the pressure as samples, and the exact sound
of a steady state.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import lfilter

from cam_rig import acoustics
from cam_rig.acoustics import MicrophoneState, SoundSource, level_db, pressure_pa, rms_pressure
from cam_rig.acoustics.pressure import BLOCK_SIZE, Background, first_order, mean_square_rate
from cam_rig.dynamics.linear.propagator import piece
from cam_rig.laws import bernstein
from cam_rig.units import RPM, TURN, rms

RATE, SPEED = 4000, 30.0


@pytest.fixture
def silent(radiation):
    """Radiation constants whose background level is negligible (−400 dB)."""
    return dataclasses.replace(radiation, background=-400.0)


@pytest.fixture
def random():
    """Random generator with a fixed seed."""
    return np.random.default_rng(11)


# -- levels in dB, and the constants of a rig file


def test_levels_have_their_reference_values():
    """20 µPa is 0 dB, and 94 dB, the level of a calibrator, is 1.0024 Pa.

    A tenfold pressure is 20 dB higher.
    """
    np.testing.assert_allclose(level_db(np.array([20e-6, 2e-4])), [0.0, 20.0], rtol=1e-14)
    assert pressure_pa(np.array([0.0, 94.0])) == pytest.approx([20e-6, 1.0024], abs=5e-5)
    levels = np.linspace(-50.0, 200.0, 60)
    assert level_db(pressure_pa(levels)) == pytest.approx(levels, abs=1e-12)


def test_constants_are_those_of_the_rig_file(rig, follower, radiation):
    """Radiation constants in SI equal those of the rig file, and scale as documented.

    The power of the background noise rises with speed by its slope per octave. The radiated energy
    of a landing is zero without an impulse, and four times as large for twice the impulse.
    """
    constants, base = (
        acoustics.RadiationParameters.from_rig(rig),
        radiation.background_reference_speed,
    )
    for key in ("gain", "corner_frequency", "background_reference_speed"):
        assert getattr(constants, key) == getattr(rig.radiation, key).si
    assert constants.contact_time == pytest.approx(follower.contact_time, rel=1e-15)
    low, high = (
        float(level_db(math.sqrt(radiation.background_power(speed)))) for speed in (base, 2 * base)
    )
    assert low == pytest.approx(radiation.background, abs=1e-12)
    assert high - low == pytest.approx(radiation.background_slope, abs=1e-12)
    energy = radiation.landing_energy(np.array([0.0, 1.0, 2.0]))
    assert energy[0] == 0.0
    assert energy[2] == pytest.approx(4.0 * energy[1], rel=1e-15)


@pytest.mark.parametrize("share", [1e-2, 1e-4])
def test_landing_energy_is_a_half_sine_through_the_structure(radiation, share):
    """The energy of a landing is that of a half-sine pulse filtered by the structure.

    The structure is a first-order low-pass filter. The tested formula is the limit for a short
    pulse. The energy of the closed-form response, integrated numerically, agrees with it within
    twice the ratio of contact time to filter time constant.
    """
    # During the pulse the energy tends to (gain ω_c J)² π²/(8 T_c) as ω_c T_c → 0. The structure
    # ends at ω_c J and then adds gain² ω_c³ J²/2, which the microphone receives through q.
    time, impulse = radiation.contact_time, 2.0
    rate, nu = share / time, math.pi / time
    low = dataclasses.replace(radiation, corner_frequency=rate / (2.0 * math.pi))
    peak = 0.5 * math.pi * impulse / time

    def structure(t):
        wave = rate * math.sin(nu * t) - nu * math.cos(nu * t) + nu * math.exp(-rate * t)
        return peak * rate / (rate**2 + nu**2) * wave

    def squared(t):
        return (low.gain * rate * (peak * math.sin(nu * t) - structure(t))) ** 2

    pulse, _ = quad(squared, 0.0, time, epsrel=1e-10)
    formula = float(low.landing_energy(np.array([impulse]))[0])
    assert pulse == pytest.approx(formula, rel=2.0 * share)
    assert structure(time) == pytest.approx(rate * impulse, rel=2.0 * share)


def test_the_low_pass_is_the_recursion():
    """The block-wise low-pass filter equals the sample-by-sample recursion to 1e-13.

    The result does not depend on how the samples are divided into calls. The tested decay rates run
    from no filter to a very fast one, and the lengths include an empty input and the block size ±
    1.
    """
    # The factor from the end of a block to the next one is rounded once per block, within the
    # memory of the low-pass filter.
    decays = (0.0, 1e-5, 0.01, 0.6, 30.0, 800.0)
    for count in (0, 1, 2, BLOCK_SIZE - 1, BLOCK_SIZE, BLOCK_SIZE + 1, 3000):
        drive = np.random.default_rng(count).normal(size=count)
        for decay in decays:
            keep = math.exp(-decay)
            expected = lfilter([1.0], [1.0, -keep], drive, zi=[keep * 1.3])[0]
            remembered = min(count, 1.0 / max(decay, 1e-9)) / BLOCK_SIZE
            limit = (1e-14 + 2.0**-53 * remembered) * np.abs(expected).max(initial=1.0)
            result = first_order(keep, drive, 1.3)
            np.testing.assert_allclose(result, expected, rtol=0.0, atol=limit)
    whole = first_order(0.99, drive, -0.5)
    first = first_order(0.99, drive[:333], -0.5)
    rest = first_order(0.99, drive[333:], float(first[-1]))
    np.testing.assert_allclose(np.concatenate([first, rest]), whole, rtol=0.0, atol=1e-13)


# -- r.m.s. pressure of each block, from its energy


def structure_after_force(radiation, ordinates, rate, seconds=0.5):
    """Return two states of the structure after a polynomial force: sampled and exact.

    The structure is the low-pass filter between contact force and sound pressure. The first state
    follows from the force at `rate` samples per second, the second from the closed form of the
    filter's response. `ordinates` are the Bernstein coefficients of the force over `seconds`.
    """
    force = bernstein.evaluate(ordinates, np.linspace(0.0, 1.0, int(seconds * rate) + 1))
    state, _ = rms_pressure(radiation, None, force, np.zeros_like(force), rate, SPEED)
    w = radiation.corner_rate
    exact = piece(np.array([[-w]]), w * ordinates[None, :], seconds).end(force[:1])
    return state.structure, float(exact[0])


def test_the_structure_is_exact_under_a_linear_force(silent, random):
    """The filter state after a force that is linear in time is exact to 1e-12.

    The filter is the structure between contact force and sound pressure. Under a curved force the
    method replaces the force by a straight line in each sample interval, so that its error falls to
    a quarter at twice the sample rate.
    """
    # The error of a chord is of second order in the sample interval.
    result, exact = structure_after_force(silent, np.array([3.0, -40.0]), RATE)
    assert result == pytest.approx(exact, rel=1e-12)
    curved = 100.0 * random.normal(size=6)
    coarse, fine = (
        abs(np.subtract(*structure_after_force(silent, curved, rate))) for rate in (RATE, 2 * RATE)
    )
    assert coarse < 1e-3  # of forces of 100 N
    assert coarse / fine == pytest.approx(4.0, rel=0.02)


def test_pressure_of_ramps_and_of_rest(radiation, silent, random):
    """A force that rises by 500 N/s gives the pressure 500·gain after the transient.

    A constant force gives the pressure of the background noise alone. Without background, twice the
    gain gives twice the pressure. The relative tolerance is 1e-12.
    """
    t, none = np.arange(2 * RATE) / RATE, np.zeros(RATE)
    state, _ = rms_pressure(silent, None, 500.0 * t[:RATE], none, RATE, SPEED)
    _, pressure = rms_pressure(silent, state, 500.0 * t[RATE:], none, RATE, SPEED)
    assert pressure == pytest.approx(silent.gain * 500.0, rel=1e-12)
    _, pressure = rms_pressure(radiation, None, np.full(RATE, 250.0), none, RATE, SPEED)
    assert pressure**2 == pytest.approx(radiation.background_power(SPEED), rel=1e-12)
    force, louder = np.cumsum(random.normal(size=RATE)), 2 * silent.gain
    _, once = rms_pressure(silent, None, force, none, RATE, SPEED)
    twice = rms_pressure(dataclasses.replace(silent, gain=louder), None, force, none, RATE, SPEED)[
        1
    ]
    assert twice == pytest.approx(2.0 * once, rel=1e-12)


def test_two_blocks_have_the_energy_of_one(radiation, random):
    """The sound energy of two consecutive blocks equals that of one joined block.

    Thus the length of a block has no effect on the sound.
    """
    force = np.cumsum(random.normal(size=1000))
    impulse = np.where(random.random(1000) < 0.01, 0.3, 0.0)
    whole_state, whole = rms_pressure(radiation, None, force, impulse, RATE, SPEED)
    for cut in (1, 300, 999):
        state, first = rms_pressure(radiation, None, force[:cut], impulse[:cut], RATE, SPEED)
        state, second = rms_pressure(radiation, state, force[cut:], impulse[cut:], RATE, SPEED)
        energy = first**2 * cut + second**2 * (1000 - cut)
        assert energy == pytest.approx(whole**2 * 1000, rel=1e-12)
        assert state.force == whole_state.force
        assert state.structure == pytest.approx(whole_state.structure, rel=1e-12)


def test_a_landing_radiates_pulse_and_decay(silent):
    """A landing radiates the energy of its pulse and of the decay after it.

    The decay is that of the structure, a low-pass filter with the corner ω_c. In the limit of a
    high sample rate it has the closed form gain² ω_c³ J²/2 for an impulse J.
    """
    impulse, none, w = np.zeros(RATE), np.zeros(RATE), silent.corner_rate
    impulse[10] = 1.5
    state, pressure = rms_pressure(silent, MicrophoneState(0.0, 0.0), none, impulse, RATE, SPEED)
    pulse = float(silent.landing_energy(np.array([1.5]))[0])
    tail = silent.gain**2 * (w * w * 1.5) ** 2 / RATE / -np.expm1(-2.0 * w / RATE)
    assert pressure**2 * RATE / RATE == pytest.approx(pulse + tail, rel=1e-9)
    # In the limit of a high sample rate the tail is gain² ω_c³ J²/2, with an error of ω_c/rate.
    assert tail == pytest.approx(silent.gain**2 * w**3 * 1.5**2 / 2, rel=2 * w / RATE)
    assert state.structure == pytest.approx(w * 1.5 * np.exp(-w * (RATE - 11) / RATE), rel=1e-9)


def test_empty_blocks_are_refused(radiation):
    """An empty block of samples raises an error."""
    none = np.zeros(0)
    with pytest.raises(ValueError, match="at least one sample"):
        rms_pressure(radiation, None, none, none, RATE, SPEED)
    with pytest.raises(ValueError, match="at least one sample"):
        SoundSource(radiation, RATE).pressure(none, none, SPEED)


# -- sound pressure as samples of a waveform

FAST = 12_000


def smooth_force(seconds):
    """Return samples of a force (N) of `seconds`, the sum of 12 harmonics of 5 Hz."""
    t = np.arange(round(seconds * FAST)) / FAST
    return sum(30.0 / n * np.cos(2.0 * np.pi * 5.0 * n * t + n) for n in range(1, 13))


def test_samples_have_the_energy_of_rms_pressure(silent):
    """The equivalent level of the pressure samples equals that of `rms_pressure`.

    The tolerance is 1e-3 dB, without background noise. The force is linear between its samples, so
    a sound with a higher sample rate only adds interpolated values.
    """
    # The samples of the higher rate that coincide in time are also equal.
    force, none = smooth_force(1.0), np.zeros(FAST)
    _, account = rms_pressure(silent, None, force, none, FAST, SPEED)
    source = SoundSource(silent, FAST)
    fine = source.pressure(force, none, SPEED)
    assert float(level_db(rms(fine))) == pytest.approx(float(level_db(account)), abs=1e-3)
    coarse = SoundSource(silent, FAST, least_rate=FAST).pressure(force, none, SPEED)
    np.testing.assert_allclose(fine[source.factor - 1 :: source.factor], coarse, atol=1e-12)


def test_the_rate_is_a_multiple_from_96_khz_on(silent):
    """The rate of the sound is the smallest multiple of the force's from 96 kHz."""
    rates = {1000: 96_000, 12_000: 96_000, 44_100: 132_300, 96_000: 96_000, 200_000: 200_000}
    for block_rate, rate in rates.items():
        source, block = SoundSource(silent, block_rate), np.zeros(10)
        assert source.rate == rate
        assert source.pressure(block, block, SPEED).size == 10 * source.factor


def test_a_landing_keeps_area_and_energy(silent):
    """The pressure pulse of a landing has the area gain·ω_c·J for an impulse J.

    ω_c is the corner of the low-pass filter. This applies even if the pulse is shorter than a
    sample. The energy of the sampled half sine agrees with `landing_energy` within 1 % if the pulse
    has at least 0.2 ms at 96 kHz.
    """
    # The pulse of 1 µs is shorter than a sample, so only its area is compared.
    impulse, none = np.zeros(200), np.zeros(200)
    impulse[[3, 60]] = 1.5, 0.5
    for contact_time in (2e-4, 1e-3, 1e-6):
        radiation = dataclasses.replace(silent, contact_time=contact_time, corner_frequency=1e-6)
        source = SoundSource(radiation, FAST)
        area = float(source.pressure(none, impulse, SPEED).sum()) / source.rate
        assert area == pytest.approx(radiation.gain * radiation.corner_rate * 2.0, rel=1e-6)
    radiation = dataclasses.replace(silent, contact_time=2e-4, corner_frequency=1e-3)
    pressure = SoundSource(radiation, FAST).pressure(none, impulse, SPEED)
    energy = float(pressure @ pressure) / source.rate
    assert energy == pytest.approx(float(radiation.landing_energy(impulse).sum()), rel=0.01)


@pytest.mark.parametrize("size", [1, 3, 250, 999])
def test_samples_do_not_depend_on_blocks(radiation, random, size):
    """The pressure samples do not depend on how the force is divided into blocks.

    A division may even fall within the pulse of a landing.
    """
    force = smooth_force(1000 / FAST)
    impulse = np.where(random.random(1000) < 0.02, 0.4, 0.0)
    whole = SoundSource(radiation, FAST).pressure(force, impulse, SPEED)
    source, cuts = SoundSource(radiation, FAST), range(size, 1000, size)
    blocks = zip(np.split(force, cuts), np.split(impulse, cuts), strict=True)
    pieces = [source.pressure(f, j, SPEED) for f, j in blocks]
    np.testing.assert_allclose(np.concatenate(pieces), whole, rtol=1e-9, atol=1e-12)


def test_the_background_has_its_level_and_seed(radiation):
    """Without a changing force the pressure has the background level of the cam speed.

    The random samples of the background differ with the seed.
    """
    source, still = SoundSource(radiation, FAST), np.full(2 * FAST, 100.0)
    for speed in (radiation.background_reference_speed, 2.0 * radiation.background_reference_speed):
        level = float(level_db(rms(source.pressure(still, 0.0 * still, speed))))
        expected = float(level_db(np.sqrt(radiation.background_power(speed))))
        assert level == pytest.approx(expected, abs=0.2)
    still = np.zeros(100)
    first, same, other = (
        SoundSource(radiation, FAST, seed=seed).pressure(still, still, SPEED) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, same)
    assert not np.allclose(first, other)


def test_background_spectrum():
    """The random samples of the background noise have unit variance.

    This is so at any sample rate. Above the corner frequency their spectrum falls by 6 dB per
    octave.
    """
    for rate in (48_000, 96_000):
        noise = Background(500.0, rate, seed=4).samples(5 * rate)
        assert float(np.var(noise)) == pytest.approx(1.0, rel=0.03)
        spectrum = acoustics.third_octaves(noise, rate)
        level = dict(zip(spectrum.names, spectrum.level_db, strict=True))
        assert level["100"] - level["50"] == pytest.approx(3.0, abs=0.7)  # white: +3 dB/octave
        assert level["8k"] - level["4k"] == pytest.approx(-3.0, abs=0.5)  # 3 dB − 6 dB


# -- exact steady sound, compared with the sum over the harmonics (Parseval's theorem)


def parseval(law, p, corner_rate, speed, points=2**17):
    """Return the mean square (N²/s²) of the filtered force rate, by harmonics.

    The filter is a low-pass of first order. The mean square is Σ |iω ω_c/(ω_c + iω) F(ω)|² over the
    harmonics F of the kinetostatic contact force. Parseval's theorem equates it to the mean over
    time.
    """
    s, ds, dds = (law(np.arange(points) * TURN / points, k) for k in range(3))
    force = p.mass * speed**2 * dds + p.damping * speed * ds + p.spring_stiffness * s
    omega = 1j * speed * np.arange(points // 2 + 1)
    harmonics = np.fft.rfft(force) / points * omega * corner_rate / (corner_rate + omega)
    return 2.0 * float(np.sum(np.abs(harmonics[:-1]) ** 2))


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", ["bezier15", "poly345", "poly4567", "cycloidal"])
@pytest.mark.parametrize("corner", [1.0, 20.0, 1000.0])
@pytest.mark.parametrize("rpm", [200.0, 400.0])
def test_mean_square_agrees_with_parseval(laws, follower, name, corner, rpm):
    """The closed-form mean square of the filtered force rate equals Parseval's sum.

    The sum is over the harmonics of the force. The relative tolerance is 1e-8.
    """
    # 1e-8: harmonics of a continuous force fall as n⁻², and behind the filter as n⁻⁴ or faster.
    rate, speed = 2.0 * np.pi * corner, rpm * RPM
    exact = mean_square_rate(laws[name], follower, rate, speed)
    assert exact == pytest.approx(parseval(laws[name], follower, rate, speed), rel=1e-8)

"""Contact force to sound pressure: radiation, energy, samples, and the exact steady sound."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.signal import lfilter

from cam_rig.acoustics import (
    MicrophoneState,
    RadiationParameters,
    SoundSource,
    level_db,
    pressure_pa,
    rms_pressure,
    steady_power,
    third_octaves,
)
from cam_rig.acoustics.pressure import Background, mean_square_rate
from cam_rig.acoustics.radiation import BLOCK, first_order
from cam_rig.dynamics.linear.propagator import piece
from cam_rig.laws import bernstein
from cam_rig.units import TURN


def test_from_rig(rig, follower):
    radiation = RadiationParameters.from_rig(rig)
    assert radiation.gain == rig.radiation.gain.si
    assert radiation.corner == rig.radiation.corner.si
    assert radiation.background_at == rig.radiation.background_at.si
    assert radiation.contact_time == pytest.approx(follower.contact_time, rel=1e-15)


def test_background_rises_by_its_slope(radiation):
    at = radiation.background_at
    levels = [
        float(level_db(math.sqrt(radiation.background_power(speed)))) for speed in (at, 2 * at)
    ]
    assert levels[0] == pytest.approx(radiation.background, abs=1e-12)
    assert levels[1] - levels[0] == pytest.approx(radiation.background_slope, abs=1e-12)


def test_landing_energy_is_a_half_sine_through_the_structure(radiation):
    """∫p² dt of a half-sine pulse of impulse J, from the structure's closed-form response.

    While the pulse lasts it tends to (gain ω_c J)² π²/(8 T_c) as ω_c T_c → 0; the structure, left
    at ω_c J, then adds gain² ω_c³ J²/2, which the microphone hears through q.
    """
    for share in [1e-2, 1e-3, 1e-4]:
        time, impulse = radiation.contact_time, 2.0
        rate = share / time
        low = dataclasses.replace(radiation, corner=rate / (2.0 * math.pi))
        nu = math.pi / time
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


def test_landing_energy_grows_as_the_square(radiation):
    energy = radiation.landing_energy(np.array([0.0, 1.0, 2.0]))
    assert energy[0] == 0.0
    assert energy[2] == pytest.approx(4.0 * energy[1], rel=1e-15)


def test_it_is_the_recursion():
    """One sample after the other, from what was before the first.

    The power that takes a block's end to the next one's is rounded once a block, as long as the
    low pass remembers.
    """
    for decay in [0.0, 1e-5, 0.01, 0.6, 30.0, 800.0]:
        for count in [0, 1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3000, 100_000]:
            keep, drive = math.exp(-decay), np.random.default_rng(count).normal(size=count)
            wanted = lfilter([1.0], [1.0, -keep], drive, zi=[keep * 1.3])[0]
            found = first_order(keep, drive, 1.3)
            remembered = min(count, 1.0 / max(decay, 1e-9)) / BLOCK
            limit = (1e-14 + 2.0**-53 * remembered) * np.abs(wanted).max(initial=1.0)
            np.testing.assert_allclose(found, wanted, rtol=0.0, atol=limit)


def test_cut_anywhere_it_is_the_same():
    drive = np.random.default_rng(1).normal(size=1000)
    whole = first_order(0.99, drive, -0.5)
    first = first_order(0.99, drive[:333], -0.5)
    rest = first_order(0.99, drive[333:], float(first[-1]))
    np.testing.assert_allclose(np.concatenate([first, rest]), whole, rtol=0.0, atol=1e-13)


@given(st.floats(-50.0, 200.0))
def test_inverse(level):
    assert float(level_db(pressure_pa(level))) == pytest.approx(level, abs=1e-12)


def test_reference_values():
    """20 µPa is 0 dB; 94 dB, the calibrator's level, is 1.0024 Pa; ten times more is 20 dB."""
    assert float(level_db(20e-6)) == 0.0
    assert float(pressure_pa(94.0)) == pytest.approx(1.0024, abs=5e-5)
    assert float(level_db(10.0) - level_db(1.0)) == pytest.approx(20.0, rel=1e-14)


def test_arrays():
    levels = np.array([0.0, 60.0, 94.0])
    one_by_one = [float(pressure_pa(level)) for level in levels]
    np.testing.assert_allclose(pressure_pa(levels), one_by_one, rtol=1e-15)


RATE, SPEED, SECONDS = 4000, 30.0, 0.5
RNG = np.random.default_rng(11)


def heard_structure(radiation, ordinates, rate):
    """Structure at the end of a polynomial force, and the exact one."""
    u = np.linspace(0.0, 1.0, int(SECONDS * rate) + 1)
    force = bernstein.evaluate(ordinates, u)
    state, _ = rms_pressure(radiation, None, force, np.zeros_like(force), rate, SPEED)
    w = radiation.corner_rate
    exact = piece(np.array([[-w]]), w * ordinates[None, :], SECONDS).end(force[:1])
    return state.structure, float(exact[0])


def test_straight_force_is_exact(silent):
    heard, exact = heard_structure(silent, np.array([3.0, -40.0]), RATE)
    assert heard == pytest.approx(exact, rel=1e-12)


def test_polynomial_force_converges_as_the_square(silent):
    """For a curved force the error is that of the chord: four times less at twice the rate."""
    ordinates = 100.0 * RNG.normal(size=6)
    errors = [
        abs(np.subtract(*heard_structure(silent, ordinates, rate))) for rate in (RATE, 2 * RATE)
    ]
    assert errors[0] < 1e-3  # of forces of 100 N
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)


def test_steady_ramp(silent):
    """Below the corner the pressure is gain · Ḟ: a ramp of 500 N/s, once settled."""
    t = np.arange(2 * RATE) / RATE
    force, none = 500.0 * t, np.zeros(RATE)
    state, _ = rms_pressure(silent, None, force[:RATE], none, RATE, SPEED)
    _, pressure = rms_pressure(silent, state, force[RATE:], none, RATE, SPEED)
    assert pressure == pytest.approx(silent.gain * 500.0, rel=1e-12)


def test_constant_force_is_silent(radiation):
    force = np.full(100, 250.0)
    _, pressure = rms_pressure(radiation, None, force, np.zeros(100), RATE, SPEED)
    assert pressure**2 == pytest.approx(radiation.background_power(SPEED), rel=1e-12)


def test_two_blocks_hold_the_energy_of_one(radiation):
    """Σ p² n over two blocks is p² n over both: nothing depends on the block's length."""
    for cut in [1, 300, 999]:
        force = np.cumsum(RNG.normal(size=1000))
        impulse = np.where(RNG.random(1000) < 0.01, 0.3, 0.0)
        whole_state, whole = rms_pressure(radiation, None, force, impulse, RATE, SPEED)
        state, first = rms_pressure(radiation, None, force[:cut], impulse[:cut], RATE, SPEED)
        state, second = rms_pressure(radiation, state, force[cut:], impulse[cut:], RATE, SPEED)
        energy = first**2 * cut + second**2 * (1000 - cut)
        assert energy == pytest.approx(whole**2 * 1000, rel=1e-12)
        assert state.force == whole_state.force
        assert state.structure == pytest.approx(whole_state.structure, rel=1e-12)


def test_one_landing(silent):
    """A landing alone: the pulse's energy, and the tail of the structure it leaves behind."""
    impulse = np.zeros(RATE)
    impulse[10] = 1.5
    state, pressure = rms_pressure(
        silent, MicrophoneState(0.0, 0.0), np.zeros(RATE), impulse, RATE, SPEED
    )
    w = silent.corner_rate
    pulse = float(silent.landing_energy(np.array([1.5]))[0])
    tail = silent.gain**2 * (w * w * 1.5) ** 2 / RATE / -np.expm1(-2.0 * w / RATE)
    assert pressure**2 * RATE / RATE == pytest.approx(pulse + tail, rel=1e-9)
    # in the limit of a high sample rate the tail is gain² ω_c³ J²/2, less by ω_c/rate
    assert tail == pytest.approx(silent.gain**2 * w**3 * 1.5**2 / 2, rel=2 * w / RATE)
    assert state.structure == pytest.approx(w * 1.5 * np.exp(-w * (RATE - 11) / RATE), rel=1e-9)


def test_gain_scales_the_sound_of_the_cam(silent):
    force = np.cumsum(RNG.normal(size=500))
    none = np.zeros(500)
    _, once = rms_pressure(silent, None, force, none, RATE, SPEED)
    _, twice = rms_pressure(
        dataclasses.replace(silent, gain=2 * silent.gain), None, force, none, RATE, SPEED
    )
    assert twice == pytest.approx(2.0 * once, rel=1e-12)


def test_empty_block_is_refused(radiation):
    with pytest.raises(ValueError, match="at least one sample"):
        rms_pressure(radiation, None, np.zeros(0), np.zeros(0), RATE, SPEED)


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
    force, none = smooth_force(0.1), np.zeros(RATE // 10)
    coarse = SoundSource(silent, RATE, least_rate=RATE).pressure(force, none, SPEED)
    source = SoundSource(silent, RATE)
    fine = source.pressure(force, none, SPEED)
    np.testing.assert_allclose(fine[source.factor - 1 :: source.factor], coarse, atol=1e-12)


def test_a_landing_keeps_its_area(silent):
    """∫p dt of a pulse is gain ω_c J at any contact time, shorter than a sample or longer."""
    for contact_time in [2e-4, 1e-3, 1e-6]:
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
    still = np.zeros(100)
    one, same, other = (
        SoundSource(radiation, RATE, seed=seed).pressure(still, still, SPEED) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert not np.allclose(one, other)


def test_background_spectrum():
    """Unit variance at any rate, and 6 dB an octave less above the corner."""
    for rate in [48_000, 96_000]:
        noise = Background(500.0, rate, seed=4).samples(10 * rate)
        assert float(np.var(noise)) == pytest.approx(1.0, rel=0.02)
        level = dict(zip((s := third_octaves(noise, rate)).names, s.level_db, strict=True))
        assert level["100"] - level["50"] == pytest.approx(3.0, abs=0.5)  # white: 3 dB an octave
        assert level["8k"] - level["4k"] == pytest.approx(-3.0, abs=0.5)  # 3 dB less 6


def test_empty_block_is_refused(radiation):
    with pytest.raises(ValueError, match="at least one sample"):
        SoundSource(radiation, RATE).pressure(np.zeros(0), np.zeros(0), SPEED)


def parseval(law, p, corner_rate, speed, points=2**17):
    """Σ |iω ω_c/(ω_c + iω) F(ω)|² over the harmonics of the force."""
    angle = np.arange(points) * TURN / points
    s, ds, dds = (law(angle, k) for k in range(3))
    force = p.mass * speed**2 * dds + p.damping * speed * ds + p.spring_stiffness * s
    omega = 1j * speed * np.arange(points // 2 + 1)
    harmonics = np.fft.rfft(force) / points * omega * corner_rate / (corner_rate + omega)
    return 2.0 * float(np.sum(np.abs(harmonics[:-1]) ** 2))


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", ["bezier15", "poly345", "poly4567", "cycloidal"])
@pytest.mark.parametrize("corner", [1.0, 20.0, 1000.0])
@pytest.mark.parametrize("rpm", [200.0, 400.0])
def test_against_parseval(laws, follower, name, corner, rpm):
    """Mean square of Ḟ behind the corner: time domain equals frequency domain.

    1e-8: harmonics of a force that is continuous fall as n⁻², with the filter's as n⁻⁴ and more.
    """
    rate, speed = 2.0 * np.pi * corner, rpm * np.pi / 30.0
    exact = mean_square_rate(laws[name], follower, rate, speed)
    assert exact == pytest.approx(parseval(laws[name], follower, rate, speed), rel=1e-8)


@pytest.mark.variants(8)
@pytest.mark.parametrize("rpm", [200, 300, 400])
def test_against_many_turns(law, follower, radiation, last_turn_power, rpm):
    """The last of eight simulated turns has the steady level within 1e-3 dB.

    An arc cam's force jumps; a jump drawn as a slope over one sample costs up to the square of
    the jump's pressure over that sample: 1e-2 dB at 48 kHz.
    """
    jumps = np.abs(law.jumps(2)).max() > 1e-6 * np.abs(law.derivative_ordinates(2)).max()
    simulated = last_turn_power(law, follower, radiation, rpm, turns=8, sample_rate=48_000)
    steady = steady_power(law, follower, radiation, rpm * np.pi / 30.0)
    assert 10.0 * np.log10(simulated / steady) == pytest.approx(0.0, abs=1e-2 if jumps else 1e-3)


def test_background_adds_in_energy(laws, follower, radiation):
    """Steady power is background plus gain² times the mean square rate."""
    speed, law = 30.0, laws["poly345"]
    rate = mean_square_rate(law, follower, radiation.corner_rate, speed)
    expected = radiation.background_power(speed) + radiation.gain**2 * rate
    assert steady_power(law, follower, radiation, speed) == pytest.approx(expected, rel=1e-14)
    loud = dataclasses.replace(radiation, gain=2.0 * radiation.gain)
    added = steady_power(law, follower, loud, speed) - radiation.background_power(speed)
    assert added == pytest.approx(4.0 * radiation.gain**2 * rate, rel=1e-12)

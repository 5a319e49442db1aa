"""The microphone: the structure solved exactly, and energy that adds up over blocks."""

import dataclasses

import numpy as np
import pytest

from cam_rig.acoustics import MicrophoneState, rms_pressure
from cam_rig.dynamics.linear.propagator import piece
from cam_rig.laws import bernstein

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
    """For a force straight in time the structure is the exact propagator's, to rounding."""
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
    """A force at rest makes no sound: only the background is heard."""
    force = np.full(100, 250.0)
    _, pressure = rms_pressure(radiation, None, force, np.zeros(100), RATE, SPEED)
    assert pressure**2 == pytest.approx(radiation.background_power(SPEED), rel=1e-12)


@pytest.mark.parametrize("cut", [1, 300, 999])
def test_two_blocks_hold_the_energy_of_one(radiation, cut):
    """Σ p² n over two blocks is p² n over both: nothing depends on the block's length."""
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
    """Twice the gain, twice the pressure."""
    force = np.cumsum(RNG.normal(size=500))
    none = np.zeros(500)
    _, once = rms_pressure(silent, None, force, none, RATE, SPEED)
    _, twice = rms_pressure(
        dataclasses.replace(silent, gain=2 * silent.gain), None, force, none, RATE, SPEED
    )
    assert twice == pytest.approx(2.0 * once, rel=1e-12)


def test_empty_block_is_refused(radiation):
    """No samples, no r.m.s."""
    with pytest.raises(ValueError, match="at least one sample"):
        rms_pressure(radiation, None, np.zeros(0), np.zeros(0), RATE, SPEED)

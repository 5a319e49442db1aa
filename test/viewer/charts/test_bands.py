"""Third-octave bars: Parseval, the structure's transfer, a landing's pulse."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.acoustics import MicrophoneState, RadiationParameters, rms_pressure
from cam_rig.schema import RigConfig
from cam_rig.viewer.level_chart import band_numbers, band_power, third_octaves

RATE = 12_000.0


@pytest.fixture(scope="module")
def radiation(rig: RigConfig) -> RadiationParameters:
    return RadiationParameters.from_rig(rig)


def test_a_tone_sounds_in_its_own_band(radiation: RadiationParameters) -> None:
    """1 N at 1 kHz is gain · ω_c · sin-ratio in band 30, and nothing elsewhere."""
    time = np.arange(12_000) / RATE
    power = band_power(radiation, np.cos(2e3 * np.pi * time), np.zeros_like(time), RATE)
    numbers = band_numbers(RATE)
    ratio = 1e3 / np.hypot(1e3, radiation.corner)
    expected = 0.5 * (radiation.gain * radiation.corner_rate * ratio) ** 2
    np.testing.assert_allclose(power[numbers == 30.0], expected, rtol=1e-9)
    assert power[numbers != 30.0].max() < 1e-20 * expected


def test_the_bands_sum_to_what_the_microphone_hears(radiation: RadiationParameters) -> None:
    """A turn of smooth force, repeated until the structure is periodic, without background."""
    turn = 2000
    phase = 2.0 * np.pi * np.arange(turn) / turn
    force = 100.0 + 60.0 * np.cos(phase) + 20.0 * np.sin(5.0 * phase)
    state: MicrophoneState | None = None
    for _ in range(40):
        state, pressure = rms_pressure(radiation, state, force, np.zeros(turn), RATE, 30.0)
    contact = pressure**2 - radiation.background_power(30.0)
    power = band_power(radiation, force, np.zeros(turn), RATE)
    np.testing.assert_allclose(power.sum(), contact, rtol=1e-4)


def test_a_landing_is_its_radiated_energy(radiation: RadiationParameters) -> None:
    """One impulse in a turn radiates what the energy law says, all of it within 20 kHz."""
    rate, turn = 96_000.0, 19_200
    impulse = np.zeros(turn)
    impulse[77] = 0.01
    power = band_power(radiation, np.zeros(turn), impulse, rate).sum()
    energy = float(radiation.landing_energy(np.array([0.01]))[0])
    np.testing.assert_allclose(power * turn / rate, energy, rtol=0.03)


def test_silence_is_no_bar(radiation: RadiationParameters) -> None:
    """A constant force does not sound: 0 dB, not minus infinity."""
    levels = third_octaves(radiation, np.full(501, 80.0), np.zeros(501), RATE)
    np.testing.assert_allclose(levels, 0.0, atol=1e-12)
    assert levels.size == band_numbers(RATE).size

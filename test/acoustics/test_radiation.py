"""Background, and the sound of a landing."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

from cam_rig.acoustics import RadiationParameters, level_db


def test_from_rig(rig, follower):
    """Numbers come in SI from the rig file, the contact time from mass and stem."""
    radiation = RadiationParameters.from_rig(rig)
    assert radiation.gain == rig.radiation.gain.si
    assert radiation.corner == rig.radiation.corner.si
    assert radiation.background_at == rig.radiation.background_at.si
    assert radiation.contact_time == pytest.approx(follower.contact_time, rel=1e-15)


def test_background_rises_by_its_slope(radiation):
    """The level is the given one at its speed, and one slope higher an octave on."""
    at = radiation.background_at
    levels = [
        float(level_db(math.sqrt(radiation.background_power(speed)))) for speed in (at, 2 * at)
    ]
    assert levels[0] == pytest.approx(radiation.background, abs=1e-12)
    assert levels[1] - levels[0] == pytest.approx(radiation.background_slope, abs=1e-12)


@pytest.mark.parametrize("share", [1e-2, 1e-3, 1e-4])
def test_landing_energy_is_a_half_sine_through_the_structure(radiation, share):
    """∫p² dt of a half-sine pulse of impulse J, from the structure's closed-form response.

    While the pulse lasts it tends to (gain ω_c J)² π²/(8 T_c) as ω_c T_c → 0; the structure, left
    at ω_c J, then adds gain² ω_c³ J²/2, which the microphone hears through q.
    """
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
    """Twice the impulse, four times the energy; no impulse, none."""
    energy = radiation.landing_energy(np.array([0.0, 1.0, 2.0]))
    assert energy[0] == 0.0
    assert energy[2] == pytest.approx(4.0 * energy[1], rel=1e-15)

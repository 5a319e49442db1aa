"""The exact steady sound: against Parseval's theorem, and against simulation."""

import dataclasses

import numpy as np
import pytest

from cam_rig.acoustics import steady_power
from cam_rig.acoustics.pressure import mean_square_rate
from cam_rig.units import TURN


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

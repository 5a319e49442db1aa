"""The follower in the air: free motion against the matrix exponential in 50 digits."""

import dataclasses

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics.one_mass import lifted_off
from cam_rig.laws import bernstein

#: mass 1.3 kg, spring 4030 N/m: critical damping 2√(km) = 144.8 N·s/m
DAMPINGS = {"none": 0.0, "paper": 8.642, "near critical": 144.76, "over": 2e3, "heavy": 2e4}
TIMES = [0.0, 1e-6, 1e-3, 0.01, 0.1, 1.0]


@pytest.fixture(params=DAMPINGS.values(), ids=DAMPINGS.keys())
def flight(request, follower):
    """A follower thrown up at 1.7 m/s from a lift of 31 mm."""
    return Thrown(dataclasses.replace(follower, damping=request.param))


class Thrown:
    """Parameters and the flight from 31 mm at 1.7 m/s."""

    def __init__(self, parameters):
        self.parameters = parameters
        self.flight = lifted_off(parameters, 0.031, 1.7)


def exact(p, time):
    """y and v from exp(A t) of the homogeneous system about its rest."""
    with mp.workdps(50):
        m, k, c = (mp.mpf(x) for x in (p.mass, p.spring_stiffness, p.damping))
        rest = -mp.mpf(p.preload) / k
        flow = mp.expm(mp.matrix([[0, 1], [-k / m, -c / m]]) * mp.mpf(time))
        y, v = flow * mp.matrix([mp.mpf(0.031) - rest, mp.mpf(1.7)])
        return float(y + rest), float(v)


@pytest.mark.variants(8)
@pytest.mark.parametrize("time", TIMES)
def test_state_against_fifty_digits(flight, time):
    """Displacement and velocity to 1e-12 of their first values, however strong the damper."""
    y, v = flight.flight.state(np.array([time]))
    expected_y, expected_v = exact(flight.parameters, time)
    assert float(y[0]) == pytest.approx(expected_y, abs=1e-12 * 0.031)
    assert float(v[0]) == pytest.approx(expected_v, abs=1e-12 * 1.7)


@pytest.mark.parametrize("stiffness", [1.0, 1e-3, 1e-6])
def test_weight_without_a_spring(follower, stiffness):
    """A follower held by its weight, its spring next to nothing, falls as exactly as any other."""
    soft = dataclasses.replace(follower, spring_stiffness=stiffness)
    y, v = lifted_off(soft, 0.031, 1.7).state(np.array([0.1]))
    expected_y, expected_v = exact(soft, 0.1)
    assert float(y[0]) == pytest.approx(expected_y, abs=1e-12 * 0.031)
    assert float(v[0]) == pytest.approx(expected_v, abs=1e-12 * 1.7)


def test_acceleration_obeys_newton(flight):
    """m ÿ + c ẏ + k y + preload = 0, and ÿ is the rate of ẏ."""
    p, flight = flight.parameters, flight.flight
    t = np.linspace(1e-3, 0.02, 40)
    y, v, a = flight.motion(t)
    balance = p.mass * a + p.damping * v + p.spring_stiffness * y + p.preload
    np.testing.assert_allclose(balance, 0.0, atol=1e-12 * (1.0 + p.mass * np.abs(a).max()))
    h = 1e-4 * flight.system.window
    difference = (flight.state(t + h)[1] - flight.state(t - h)[1]) / (2 * h)
    scale = np.abs(a).max() + 1.7 / flight.system.window
    np.testing.assert_allclose(a, difference, rtol=0, atol=1e-6 * scale)


@pytest.mark.parametrize("begin", [0.0, 0.004])
def test_ordinates_are_the_acceleration(flight, begin):
    """Within its window the series is the motion's, to rounding."""
    flight, u = flight.flight, np.linspace(0.0, 1.0, 21)
    window = flight.system.window
    series = bernstein.evaluate(flight.accelerations(begin, begin + window), u)
    _, _, wanted = flight.motion(begin + u * window)
    first = np.abs(flight.motion(np.zeros(1))[2]).max()
    np.testing.assert_allclose(series, wanted, rtol=0, atol=4e-15 * first)


def test_no_acceleration_exceeds_the_bound(flight):
    """Energy does not grow, so neither does what it could turn into."""
    flight, times = flight.flight, np.linspace(0.0, 0.3, 3001)
    for begin in (0.0, 0.01, 0.1):
        later = times[times >= begin]
        assert np.abs(flight.motion(later)[2]).max() <= flight.largest_acceleration(begin)

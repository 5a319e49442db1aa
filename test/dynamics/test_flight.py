"""The follower in the air: free motion against the matrix exponential in 50 digits."""

import dataclasses

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics.flight import Flight
from cam_rig.laws import bernstein

#: mass 1.3 kg, spring 4030 N/m: critical damping 2√(km) = 144.8 N·s/m
DAMPINGS = {"none": 0.0, "paper": 8.642, "near critical": 144.76, "over": 2e3, "heavy": 2e4}
TIMES = [0.0, 1e-6, 1e-3, 0.01, 0.1, 1.0]


@pytest.fixture(params=DAMPINGS.values(), ids=DAMPINGS.keys())
def flight(request, follower):
    """A follower thrown up at 1.7 m/s from a lift of 31 mm."""
    return Flight(dataclasses.replace(follower, damping=request.param), 0.031, 1.7)


def exact(flight, time):
    """y and v from exp(A t) of the homogeneous system about its rest."""
    p = flight.parameters
    with mp.workdps(50):
        m, k, c = (mp.mpf(x) for x in (p.mass, p.spring_stiffness, p.damping))
        rest = -mp.mpf(p.preload) / k
        flow = mp.expm(mp.matrix([[0, 1], [-k / m, -c / m]]) * mp.mpf(time))
        y, v = flow * mp.matrix([mp.mpf(flight.start) - rest, mp.mpf(flight.velocity)])
        return float(y + rest), float(v)


@pytest.mark.parametrize("time", TIMES)
def test_state_against_fifty_digits(flight, time):
    """Displacement and velocity to 1e-12 of their first values, however strong the damper."""
    y, v = flight.state(np.array([time]))
    expected_y, expected_v = exact(flight, time)
    assert float(y[0]) == pytest.approx(expected_y, abs=1e-12 * 0.031)
    assert float(v[0]) == pytest.approx(expected_v, abs=1e-12 * 1.7)


@pytest.mark.parametrize("stiffness", [1.0, 1e-3, 1e-6])
def test_weight_without_a_spring(follower, stiffness):
    """A follower held by its weight, its spring next to nothing, falls as exactly as any other."""
    soft = dataclasses.replace(follower, spring_stiffness=stiffness)
    thrown = Flight(soft, 0.031, 1.7)
    y, v = thrown.state(np.array([0.1]))
    expected_y, expected_v = exact(thrown, 0.1)
    assert float(y[0]) == pytest.approx(expected_y, abs=1e-12 * 0.031)
    assert float(v[0]) == pytest.approx(expected_v, abs=1e-12 * 1.7)


def test_acceleration_obeys_newton(flight):
    """m ÿ + c ẏ + k y + preload = 0, and ÿ is the rate of ẏ."""
    p = flight.parameters
    t = np.linspace(1e-3, 0.02, 40)
    y, v, a = flight.motion(t)
    balance = p.mass * a + p.damping * v + p.spring_stiffness * y + p.preload
    np.testing.assert_allclose(balance, 0.0, atol=1e-12 * (1.0 + p.mass * np.abs(a).max()))
    h = 1e-3 * flight.window
    difference = (flight.state(t + h)[1] - flight.state(t - h)[1]) / (2 * h)
    scale = np.abs(a).max() + 1.7 / flight.window
    np.testing.assert_allclose(a, difference, rtol=0, atol=1e-6 * scale)


@pytest.mark.parametrize("begin", [0.0, 0.004])
def test_ordinates_are_the_motion(flight, begin):
    """Within its window the series is the motion, to rounding."""
    u = np.linspace(0.0, 1.0, 21)
    end = begin + flight.window
    series = bernstein.evaluate(flight.ordinates(begin, end), u)
    motion, _ = flight.state(begin + u * flight.window)
    np.testing.assert_allclose(series, motion, rtol=0, atol=2e-15)

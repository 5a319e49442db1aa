"""Torsional vibration against other integrators, 40-digit arithmetic and closed forms."""

import dataclasses
import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BPoly

from cam_rig.dynamics.linear.propagator import piece
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN

SPEED = 400.0 * np.pi / 30.0


@pytest.fixture(scope="module")
def shaft(follower):
    """A soft shaft, lightly damped."""
    return TorsionalParameters(follower, 0.02, 5e3, 0.05)


def acceleration(p, s, twist, twist_rate, speed):
    """θ̈_c of eq. 10 from s, s', s''."""
    f = p.follower
    force = f.mass * s[2] * speed**2 + f.damping * s[1] * speed
    force += f.spring_stiffness * s[0] + f.preload
    torque = p.shaft_damping * twist_rate + p.shaft_stiffness * twist + force * s[1]
    return -torque / (p.cam_inertia + f.mass * s[1] ** 2)


def integrate(law, p, state, duration, times, method="DOP853", rtol=2.3e-14):
    """The same by scipy, joint by joint (cam turning forwards), with BPoly for the law."""
    lift = BPoly(law.ordinates, law.breaks)
    laws = [lift, lift.derivative(), lift.derivative(2)]
    k, c, steady = p.flywheel_acceleration
    y = np.array(dataclasses.astuple(state)[:4])
    out, time = np.empty((4, times.size)), 0.0
    while time < duration:
        angle = y[0] + y[2] + 1e-9
        turn = math.floor(angle / TURN) * TURN
        i = int(np.searchsorted(law.breaks, angle - turn, side="right")) - 1
        low, joint = law.breaks[i] + turn, law.breaks[i + 1] + turn

        series = [local(poly, law.breaks[i]) for poly in laws]

        def slopes(_, y, low=low, series=series):
            x = y[0] + y[2] - low
            s = [sum(a * x**j for j, a in enumerate(row)) for row in series]
            flywheel = k * y[0] + c * y[1] + steady
            return [y[1], acceleration(p, s, y[0], y[1], y[1] + y[3]) - flywheel, y[3], flywheel]

        def crossing(_, y, joint=joint):
            return y[0] + y[2] - joint

        crossing.terminal, crossing.direction = True, 1.0
        run = solve_ivp(
            slopes, (time, duration), y, method, rtol=rtol, atol=1e-17,
            events=crossing, dense_output=True,
        )  # fmt: skip
        here = (times >= time) & (times <= run.t[-1])
        if here.any():
            out[:, here] = run.sol(times[here])
        time, y = run.t[-1], run.y[:, -1]
    return out


def local(poly, at):
    """Power series of a piece about its beginning."""
    i = int(np.flatnonzero(poly.x == at)[0])
    ordinates, span = poly.c[:, i], poly.x[i + 1] - poly.x[i]
    series = []
    for j in range(ordinates.size):
        row = ordinates
        for _ in range(j):
            row = bernstein.derivative(row)
        series.append(row[0] / math.factorial(j) / span**j)
    return series


@pytest.mark.parametrize("name", ["poly345", "tm21"])
@pytest.mark.parametrize("inertia", [None, 0.05])
def test_against_dop853(laws, shaft, name, inertia):
    """Two turns, all joints crossed (tm21: with steps of s''): within the peer's own error."""
    duration = 2.0 * TURN / SPEED
    times = np.linspace(0.0, duration, 301)
    state = TorsionalState(1e-4, 0.02, 0.1, SPEED)
    shaft = dataclasses.replace(
        shaft, flywheel_inertia=inertia, motor_torque=0.3 if inertia else 0.0
    )
    motion = solve(laws[name], shaft, state, 0.0, duration)
    got = motion.at(times)
    twist, rate, angle, speed = integrate(laws[name], shaft, state, duration, times)
    lead = np.stack([angle - 0.1 - SPEED * times, speed - SPEED])
    np.testing.assert_allclose(motion.lead(times), lead, rtol=0, atol=2e-11)
    peak = np.abs(twist).max()
    np.testing.assert_allclose(got[0], twist, rtol=0, atol=1e-11 * peak)
    np.testing.assert_allclose(got[1], rate, rtol=0, atol=1e-11 * np.abs(rate).max())
    np.testing.assert_allclose(got[2], twist + angle, rtol=0, atol=1e-12)
    np.testing.assert_allclose(got[3], rate + speed, rtol=1e-11)


def test_against_radau(laws, shaft):
    """An implicit method of another family agrees as far as it goes."""
    state, duration = TorsionalState(0.0, 0.0, 0.5, SPEED), 0.02
    times = np.linspace(0.0, duration, 50)
    got = solve(laws["poly345"], shaft, state, 0.0, duration).at(times)
    peer = integrate(laws["poly345"], shaft, state, duration, times, "Radau", 1e-11)
    np.testing.assert_allclose(got[0], peer[0], rtol=0, atol=1e-8 * np.abs(peer[0]).max())


def test_against_forty_digits(laws, shaft, many_digits):
    """5 ms inside the rise, from a twist and a rate, against Taylor's series in 40 digits."""
    p = shaft
    law, state, duration = laws["poly345"], TorsionalState(1e-3, 0.3, 1.2, SPEED), 0.005
    got = solve(law, p, state, 0.0, duration).at([duration])[:, 0]
    f = p.follower
    numbers = (p.cam_inertia, p.shaft_stiffness, p.shaft_damping)
    inputs = (law.breaks, law.ordinates, dataclasses.astuple(state)[:4], duration, numbers)
    follower = (f.mass, f.spring_stiffness, f.damping, f.preload)
    twist, rate, angle, speed = many_digits(
        lambda: by_taylor(law, p, state, duration), (*inputs, follower)
    )
    assert got[0] == pytest.approx(twist, abs=1e-13 * 3e-3)
    assert got[1] == pytest.approx(rate, abs=1e-13 * 1.5)
    assert got[2] == pytest.approx(angle, abs=1e-15)
    assert got[3] == pytest.approx(speed, abs=1e-13 * SPEED)


def by_taylor(law, p, state, duration):
    """Twist, its rate, the cam's angle and its speed."""
    with mp.workdps(40):
        end = taylor(law, p, state, duration)
        return [float(x) for x in (end[0], end[1], end[0] + end[2], end[1] + end[3])]


def taylor(law, p, state, duration):
    """mpmath's integrator; the law by de Casteljau on exact ordinates."""
    i = int(np.searchsorted(law.breaks, state.flywheel_angle)) - 1
    rows, span = [[mp.mpf(b) for b in law.ordinates[:, i]]], mp.mpf(law.spans[i])
    for _ in range(2):
        last = rows[-1]
        rows.append([(len(last) - 1) * (b - a) / span for a, b in itertools.pairwise(last)])

    def casteljau(row, u):
        while len(row) > 1:
            row = [a + (b - a) * u for a, b in itertools.pairwise(row)]
        return row[0]

    def slopes(_, y):
        u = (y[0] + y[2] - mp.mpf(law.breaks[i])) / span
        s = [casteljau(row, u) for row in rows]
        return [y[1], acceleration(p, s, y[0], y[1], y[1] + y[3]), y[3], mp.mpf(0)]

    return mp.odefun(slopes, 0, [mp.mpf(x) for x in dataclasses.astuple(state)[:4]])(
        mp.mpf(duration)
    )


def test_linear_limit(laws, shaft):
    """A cam of a nanometre is a torque on a linear oscillator: the exact propagator's answer."""
    base = laws["poly4567"]
    law = Law("tiny", base.breaks, 1e-8 * base.ordinates)
    a = np.array([[0.0, 1.0], [-shaft.shaft_stiffness, -shaft.shaft_damping]])
    a[1] /= shaft.cam_inertia
    state, times, expected = np.array([1e-11, 1e-9]), [], []
    for i, span in enumerate(law.spans):
        torque = shaft.follower.preload * law.motion[1, :, i]
        forcing = np.stack([np.zeros_like(torque), -torque / shaft.cam_inertia])
        part = piece(a, forcing, span / SPEED)
        inside = np.linspace(0.0, 0.99, 20) * span / SPEED
        times.append(law.breaks[i] / SPEED + inside)
        expected.append(part.at(state, inside))
        state = part.end(state)
    times, expected = np.concatenate(times), np.concatenate(expected, axis=1)
    motion = solve(law, shaft, TorsionalState(1e-11, 1e-9, 0.0, SPEED), 0.0, TURN / SPEED)
    got = motion.at(times)[:2]
    for row, exact in zip(got, expected, strict=True):
        # the follower's spring and the twisted angle enter at 1e-9 of the torque
        np.testing.assert_allclose(row, exact, rtol=0, atol=3e-8 * np.abs(exact).max())


def test_heavy_cam_does_not_twist(laws, shaft):
    """I → ∞: the shaft keeps the rate it had."""
    p = dataclasses.replace(shaft, cam_inertia=1e12)
    motion = solve(laws["poly345"], p, TorsionalState(0.0, 0.0, 0.0, SPEED), 0.0, TURN / SPEED)
    assert np.abs(motion.sample(0.0, 1e-3, 150)[0]).max() < 1e-12

"""Residual vibration on the stem: exact at any time, at any rate, in any piece of time."""

import itertools

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.elastic_stem import motion, outputs, response
from cam_rig.dynamics.linear.response import LinearResponse
from cam_rig.dynamics.linear.sampling import sample
from cam_rig.errors import DynamicsError
from cam_rig.units import TURN

SPEED = 300.0 * np.pi / 30.0


def by_mpmath(law, parameters, times):
    """Position and velocity from rest on the cam, piece by piece with 50 digits."""
    p = parameters
    with mp.workdps(50):
        m, c, k = mp.mpf(p.mass), mp.mpf(p.damping), mp.mpf(p.spring_stiffness)
        stem, speed = mp.mpf(p.stem_stiffness), mp.mpf(SPEED)
        kappa = (k + stem) / m
        decay = c / m / 2
        w = mp.sqrt(kappa - decay**2)
        x, v = stem * mp.mpf(float(law(0.0))) / (k + stem), mp.mpf(0)
        out, todo, begin = [], list(times), mp.mpf(0)
        turn = 0
        while todo:
            for i in range(law.spans.size):
                low, high = mp.mpf(law.breaks[i]), mp.mpf(law.breaks[i + 1])
                length = (high - low) / speed
                force = [stem / m * a for a in taylor_of(law.ordinates[:, i], length)]
                poly = particular(force, kappa, 2 * decay)
                dx, dv = x - poly[0], v - (poly[1] if len(poly) > 1 else 0)

                def at(t, dx=dx, dv=dv, poly=poly):
                    e = mp.e ** (-decay * t)
                    s, co = mp.sin(w * t) / w, mp.cos(w * t)
                    free = e * (dx * co + (dv + decay * dx) * s)
                    rate = e * (dv * co - (kappa * dx + decay * dv) * s)
                    forced = sum(a * t**j for j, a in enumerate(poly))
                    slope = sum(j * a * t ** (j - 1) for j, a in enumerate(poly) if j)
                    return free + forced, rate + slope

                while todo and mp.mpf(todo[0]) < begin + length:
                    out.append([float(mp.re(z)) for z in at(mp.mpf(todo.pop(0)) - begin)])
                x, v = at(length)
                begin += length
                if not todo:
                    break
            turn += 1
    return np.array(out).T


def taylor_of(ordinates, length):
    """Power series in time of Bernstein ordinates over a piece."""
    p = len(ordinates) - 1
    b = [mp.mpf(float(x)) for x in ordinates]
    series = []
    for r in range(p + 1):
        series.append(mp.binomial(p, r) * b[0] / length**r)
        b = [y - x for x, y in itertools.pairwise(b)]
    return series


def particular(force, kappa, damping):
    """Polynomial solution of ẍ + 2δ ẋ + κ x = f, from the highest power down."""
    n = len(force)
    x = [mp.mpf(0)] * (n + 2)
    for j in reversed(range(n)):
        x[j] = (force[j] - damping * (j + 1) * x[j + 1] - (j + 1) * (j + 2) * x[j + 2]) / kappa
    return x[:n]


@pytest.mark.variants(3)
@pytest.mark.parametrize("stem", [1e5, 3.3e8, 1e10])
@pytest.mark.parametrize("cam", ["poly345", "bezier15", "cycloidal"])
def test_states_against_fifty_digits(laws, cam, stem):
    """Position to 1e-13 of the lift and velocity to 5e-12 of its peak after two turns.

    The phase of 30 000 rad of ringing is known to some of its last digits (2e-13 to 2e-12, by how
    the processor rounds). Stiffness costs nothing: the stiffest stem is as exact as the soft one.
    """
    parameters = FollowerParameters(1.3, 4030.0, 8.642, 0.0, stem)
    law = laws[cam]
    times = np.sort(np.random.default_rng(4).uniform(0.0, 2.0 * TURN / SPEED, 25))
    expected = by_mpmath(law, parameters, times)
    got = motion(law, parameters, SPEED, 0.0, np.zeros(2), times)
    assert np.abs(got[0] - expected[0]).max() < 1e-13 * 0.05
    assert np.abs(got[1] - expected[1]).max() < 5e-12 * np.abs(expected[1]).max()


@pytest.mark.parametrize("damping", [3e4, 1e6, 1e7, 1e8, 1e9])
def test_overdamped_states_against_fifty_digits(laws, damping):
    """Position to 1e-14 of the lift and velocity to 1e-12: rates 1e9 apart keep their digits."""
    parameters = FollowerParameters(1.3, 4030.0, damping, 0.0, 3.3e8)
    times = np.sort(np.random.default_rng(4).uniform(0.0, 2.0 * TURN / SPEED, 12))
    expected = by_mpmath(laws["poly345"], parameters, times)
    got = motion(laws["poly345"], parameters, SPEED, 0.0, np.zeros(2), times)
    assert np.abs(got[0] - expected[0]).max() < 1e-14 * 0.05
    assert np.abs(got[1] - expected[1]).max() < 1e-12 * np.abs(expected[1]).max()


@pytest.mark.variants(3)
def test_uniform_samples_are_the_states(law, follower):
    """The matrix products give what the closed form gives, acceleration and force too."""
    model, start = response(law, follower, SPEED), np.array([1e-7, -1e-4])
    step, count = 1.0 / 96_000, 40_000
    got = sample(model, start, 1.0, 1e-3, step, count, outputs(follower))
    some = np.arange(0, count, 997)
    expected = motion(law, follower, SPEED, 1.0, start, 1e-3 + some * step)
    size = np.abs(got).max(axis=1, keepdims=True)
    assert (np.abs(got[:, some] - expected) / size < 1e-11).all()


@pytest.mark.variants(3)
def test_the_equation_of_motion_holds(law, follower):
    """m ẍ + c ẋ + (k + k_stem) x = k_stem s with the sampled rows, to rounding of k_stem · lift."""
    times = np.linspace(0.01, 0.3, 500)
    x, v, a, force = motion(law, follower, SPEED, 0.0, np.array([1e-7, 0.0]), times)
    p, s = follower, law(SPEED * times)
    left = p.mass * a + p.damping * v + (p.spring_stiffness + p.stem_stiffness) * x
    assert np.abs(left - p.stem_stiffness * s).max() < 1e-15 * p.stem_stiffness
    assert np.abs(force - p.preload - p.stem_stiffness * (s - x)).max() < 1e-15 * p.stem_stiffness


def test_the_periodic_state_is_what_many_turns_tend_to(laws, follower):
    """With damping the start is forgotten: the steady state needs one linear solve, no turns."""
    parameters = FollowerParameters(1.3, 4030.0, 800.0, 0.0, 1e5)
    model = response(laws["poly345"], parameters, SPEED)
    begin = model.periodic()
    again = model.end(begin, 0.0, TURN / SPEED)
    many = model.end(np.array([0.01, -1.0]), 0.0, 200.0 * TURN / SPEED)
    np.testing.assert_allclose(again, begin, rtol=0, atol=1e-12 * np.abs(begin).max())
    np.testing.assert_allclose(many, begin, rtol=0, atol=1e-11 * np.abs(begin).max())


def resonant(law, harmonic):
    matrix = np.array([[0.0, 1.0], [-((harmonic * SPEED) ** 2), 0.0]])
    drive = np.array([[0.0, 0.0, 0.0], [(harmonic * SPEED) ** 2, 0.0, 0.0]])
    return LinearResponse(law, SPEED, matrix, drive, np.zeros(2))


def test_resonance_grows_by_the_same_amount_each_turn(laws):
    """An undamped mode at a harmonic grows linearly without end, and that is exact too."""
    model, turn = resonant(laws["poly345"], 9), TURN / SPEED
    states = [model.end(np.zeros(2), 0.0, n * turn) for n in (1, 2, 3, 50)]
    assert np.abs(states[0]).max() > 1e-4  # the even harmonics of this cam are zero
    size = np.abs(states[0]).max()
    np.testing.assert_allclose(states[1] / 2, states[0], rtol=0, atol=1e-10 * size)
    np.testing.assert_allclose(states[3] / 50, states[0], rtol=0, atol=1e-10 * size)


def test_resonance_has_no_steady_state(laws):
    """A steady state is refused where there is none, with the speed."""
    with pytest.raises(DynamicsError, match="no steady state"):
        resonant(laws["poly345"], 9).periodic()

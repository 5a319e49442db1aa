"""Residual vibration of one mass on an elastic stem, exact at any time."""

import numpy as np
import pytest

from benchmark.speed import exact
from benchmark.speed.models import Case, Oscillator
from benchmark.speed.study import stem_motion as motion
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.elastic_stem import outputs, response
from cam_rig.dynamics.kinetostatic import loss_intervals
from cam_rig.dynamics.linear.response import sample
from cam_rig.units import TURN

SPEED = 300.0 * np.pi / 30.0


@pytest.mark.parametrize("damping", [3e4, 1e6, 1e7, 1e8, 1e9])
def test_overdamped_states_against_fifty_digits(laws, damping):
    """An overdamped stem with very different decay rates is exact over two turns.

    The rates differ by 1e9. Compared with 50 digits, positions are exact to 1e-14 of the lift, and
    velocities to 1e-12 of their peak.
    """
    law, stem = laws["poly345"], 3.3e8
    follower = FollowerParameters(1.3, 4030.0, damping, 0.0, stem)
    times = np.sort(np.random.default_rng(4).uniform(0.0, 2.0 * TURN / SPEED, 12))
    model = Oscillator(1.3, damping, 4030.0, stem)
    expected = exact.solve(Case("stem", "stem", law, model, SPEED, 2, 2, times))
    x, v, *_ = motion(law, follower, SPEED, 0.0, np.zeros(2), times)
    assert np.abs(x - expected.displacement[0]).max() < 1e-14 * law.lift
    assert np.abs(v - expected.velocity[0]).max() < 1e-12 * np.abs(expected.velocity).max()


@pytest.mark.variants(3)
def test_uniform_samples_equal_single_states(law, follower):
    """Uniform samples of a stem's motion equal states computed one by one.

    The samples are computed by matrix products, the states by the closed form. The tolerance is
    1e-11 of the largest value.
    """
    model, start = response(law, follower, SPEED), np.array([1e-7, -1e-4])
    step, count = 1.0 / 96_000, 40_000
    got = sample(model, start, 1.0, 1e-3, step, count, outputs(follower))
    some = np.arange(0, count, 997)
    expected = motion(law, follower, SPEED, 1.0, start, 1e-3 + some * step)
    size = np.abs(got).max(axis=1, keepdims=True)
    assert (np.abs(got[:, some] - expected) / size < 1e-11).all()


@pytest.mark.variants(3)
def test_samples_satisfy_the_equation_of_motion(law, follower):
    """The samples satisfy m ẍ + c ẋ + (k + k_stem) x = k_stem s to rounding."""
    times = np.linspace(0.01, 0.3, 500)
    x, v, a, force = motion(law, follower, SPEED, 0.0, np.array([1e-7, 0.0]), times)
    p, s = follower, law(SPEED * times)
    left = p.mass * a + p.damping * v + (p.spring_stiffness + p.stem_stiffness) * x
    assert np.abs(left - p.stem_stiffness * s).max() < 1e-15 * p.stem_stiffness
    assert np.abs(force - p.preload - p.stem_stiffness * (s - x)).max() < 1e-15 * p.stem_stiffness


# -- a follower that cannot leave the cam: angles at which its force would be negative


@pytest.mark.variants(3)
def test_the_force_is_negative_only_in_loss_intervals(law, follower):
    """`loss_intervals` returns the angles at which the contact force is negative.

    Samples within 1e-9 rad of an end are not compared.
    """
    angle = np.linspace(0.0, TURN, 5001)[1:-1]
    for rpm in (100.0, 400.0, 700.0):
        speed = rpm * np.pi / 30.0
        s, ds, dds = (law(angle, k) for k in range(3))
        p = follower
        force = p.mass * speed**2 * dds + p.damping * speed * ds + p.spring_stiffness * s
        force += p.preload
        lost = np.zeros(angle.size, dtype=bool)
        near = np.zeros(angle.size, dtype=bool)
        for start, stop in loss_intervals(law, p, speed):
            lost |= (angle > start) & (angle < stop)
            near |= np.minimum(np.abs(angle - start), np.abs(angle - stop)) < 1e-9
        np.testing.assert_array_equal(lost[~near], force[~near] < 0.0)

"""The torsional model along ramps: θ_v = θ₀ + ω t + α t²/2, the law at the twisted angle."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from benchmark.speed import exact as exact_twist
from benchmark.speed.models import Case, Twist
from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.errors import DynamicsError
from cam_rig.units import NS

FOLLOWER = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8)
#: Without a damper in the shaft, as the reference has it.
SHAFT = TorsionalParameters(FOLLOWER, 0.02, 5e3)
TWIST = Twist(0.02, 5e3, 1.3, 8.642, 4030.0, 12.753)
MS = NS // 1000


def reference(law, speed, ramp, times, turns):
    """Twist and rate from an untwisted shaft at angle 0, by Taylor's series of 45 digits."""
    case = Case("ramp", "", law, TWIST, speed, turns, turns, times)
    found = exact_twist.solve_twist(case, ramp)
    return found.displacement[0], found.velocity[0]


@pytest.mark.parametrize("name", ["poly345", "tm21"])
@pytest.mark.parametrize(
    ("speed", "ramp", "duration"), [(0.0, 60.0, 0.5), (20.0, 100.0, 0.3), (45.0, -120.0, 0.37)]
)
def test_against_forty_digits(laws, many_digits, name, speed, ramp, duration):
    """From rest, up and almost to rest, over a turn: to 1e-12 of the largest twist."""
    times = np.linspace(0.0, duration, 24)[1:]
    law = laws[name]
    inputs = (law.breaks, law.ordinates, speed, ramp, times, list(vars(TWIST).values()))
    twist, rate = many_digits(lambda: reference(law, speed, ramp, times, 2), inputs)
    start = TorsionalState(0.0, 0.0, 0.0, speed)
    got = solve(laws[name], SHAFT, start, 0.0, duration, ramp).at(times)
    assert np.abs(got[0] - twist).max() < 1e-12 * np.abs(twist).max()
    assert np.abs(got[1] - rate).max() < 1e-12 * np.abs(rate).max()
    flywheel = speed * times + 0.5 * ramp * times**2
    np.testing.assert_allclose(got[2], flywheel + twist, rtol=0, atol=1e-13)
    np.testing.assert_allclose(got[3], speed + ramp * times + rate, rtol=0, atol=1e-12)


def test_every_row_belongs_to_one_motion(laws):
    """Rate, speed and acceleration are the slopes of twist and angle, the ramp among them."""
    motion = solve(laws["poly345"], SHAFT, TorsionalState(1e-4, 0.0, 1.0, 5.0), 0.0, 0.2, 80.0)
    t, h = np.linspace(0.01, 0.19, 50), 1e-6
    before, here, after = (motion.at(t + k * h) for k in (-1, 0, 1))
    slope = (after - before) / (2.0 * h)
    for value, rate in ((0, 1), (2, 3), (3, 4)):
        size = np.abs(here[rate]).max()
        np.testing.assert_allclose(slope[value], here[rate], rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(here[3] - here[1], 5.0 + 80.0 * t, rtol=1e-13)
    end = motion.end
    assert end.flywheel_speed == pytest.approx(21.0, rel=1e-14)
    assert end.flywheel_angle == pytest.approx(1.0 + 1.0 + 1.6, rel=1e-14)


def test_a_disc_lags_by_the_torque_that_turns_it(make_cam):
    """On a dwell of a whole turn the cam hangs back by ψ = −I α/k_s and swings about that."""
    from cam_rig.laws import build_law

    disc = build_law(make_cam({"law": "dwell", "span": 360}))
    p = SHAFT
    rest = -50.0 / (p.mobility * p.shaft_stiffness)
    times = np.linspace(0.0, 0.7, 60)
    got = solve(disc, p, TorsionalState(0.0, 0.0, 0.0, 0.0), 0.0, 0.7, 50.0).at(times)
    rate = math.sqrt(p.mobility * p.shaft_stiffness)
    exact = rest * (1.0 - np.cos(rate * times))
    np.testing.assert_allclose(got[0], exact, rtol=0, atol=1e-12 * abs(rest))
    held = solve(disc, p, TorsionalState(rest, 0.0, 0.0, 0.0), 0.0, 0.7, 50.0).at(times)
    np.testing.assert_allclose(held[0], rest, rtol=1e-12)


def blocks(law, p, speed, ramp, cuts):
    whole = Interval(0, cuts[-1], 0.0, speed, ramp)
    state, rows = None, []
    for a, b in itertools.pairwise(cuts):
        at = a / NS
        part = Interval(a, b, whole.angle_at(at), whole.speed_at(at), ramp)
        state, block = MODELS["torsional"].advance(law, p, state, part, 24_000)
        rows.append(block.rows)
    return np.hstack(rows), state


@pytest.mark.parametrize(("speed", "ramp"), [(0.0, 80.0), (32.0, -80.0)])
def test_the_length_of_a_tick_does_not_enter(laws, speed, ramp):
    """1 ms against 200 ms, from rest and down to rest: 1e-10 of the largest value of each row."""
    p = dataclasses.replace(SHAFT, shaft_damping=0.1)
    law, total = laws["poly345"], 400 * MS
    rows, state = blocks(law, p, speed, ramp, range(0, total + 1, MS))
    coarse, end = blocks(law, p, speed, ramp, range(0, total + 1, 200 * MS))
    size = np.abs(coarse).max(axis=1)
    assert (np.abs(rows - coarse).max(axis=1)[:5] < 1e-10 * size[:5]).all()
    assert state.inner == pytest.approx(end.inner, rel=1e-10, abs=1e-14)


def test_a_ramp_is_not_run_at_its_first_speed(laws):
    """A block of an interval with an acceleration is that of the flywheel which has it."""
    interval = Interval(0, 300 * MS, 0.0, 10.0, 60.0)
    stiff = TorsionalParameters(FOLLOWER, 0.02, 1e9, 1e3)
    block = MODELS["torsional"].advance(laws["poly345"], stiff, None, interval, 10_000)[1]
    other = MODELS["kinetostatic"].advance(laws["poly345"], FOLLOWER, None, interval, 10_000)[1]
    np.testing.assert_allclose(block.rows[1], other.rows[1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(block.rows[4], other.rows[4], rtol=0, atol=1e-2)


def test_a_ramp_is_a_number(laws):
    """One that is none is refused by name."""
    with pytest.raises(DynamicsError, match="ramp is nan; allowed: finite"):
        solve(laws["poly345"], SHAFT, TorsionalState(0.0, 0.0, 0.0, 1.0), 0.0, 1.0, math.nan)

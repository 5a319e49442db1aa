"""Tests of the torsional model: equation of motion, periodic states, limit cases.

References have 40 digits.
"""

import dataclasses
import math

import numpy as np
import pytest

from benchmark.speed import exact as exact_twist
from benchmark.speed.models import Case, Twist
from cam_rig.dynamics import MODELS, Interval
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.motion import solve, steady_state
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import TURN

from ..helpers import MS
from ..helpers import ONE as FOLLOWER

SLOW = 350.0 * np.pi / 30.0


# -- joints, samples and the periodic state

REST = TorsionalState(0.0, 0.0, 0.0, SLOW)


@pytest.fixture(scope="module")
def damped(follower):
    """Parameters of a soft, damped shaft behind a flywheel at constant speed."""
    return TorsionalParameters(follower, 0.02, 8e3, 0.4)


def test_windows_end_at_joints(laws, damped):
    """The pieces of a torsional solution end when the twisted cam is at a joint.

    A joint is an angle at which two polynomial pieces meet. There the acceleration jumps by (I + m
    s'²) Δθ̈_c = −m Δs'' θ̇_c² s'. All other quantities are continuous.
    """
    law, f = laws["tm21"], damped.follower
    motion = solve(law, damped, REST, 0.0, TURN / SLOW)
    inner = motion.path.edges[1:-1]
    at_joint = motion.at(inner)
    distance = np.abs(at_joint[2][:, None] - law.breaks).min(axis=1)
    is_joint = distance < 1e-9
    assert distance[is_joint].max() < 4e-15
    assert is_joint.sum() >= law.spans.size - 1
    before, after = motion.at(inner - 1e-10), at_joint
    s1 = law(at_joint[2], 1)
    step = law(at_joint[2] + 1e-9, 2) - law(at_joint[2] - 1e-9, 2)
    expected = -f.mass * step * at_joint[3] ** 2 * s1 / (damped.cam_inertia + f.mass * s1**2)
    np.testing.assert_allclose(after[4] - before[4], expected, rtol=0, atol=1e-4)
    assert np.abs(expected).max() > 5.0


@pytest.mark.variants(6)
@pytest.mark.parametrize(("ramp", "inertia"), [(0.0, None), (80.0, None), (0.0, 0.05)])
def test_rows_satisfy_the_equation(law, damped, ramp, inertia):
    """The samples of a torsional motion satisfy eq. 10 of the paper, also on a ramp.

    Twist rate and cam speed are derivatives of the angles (central differences, 1e-7), and the
    cam's acceleration balances the torques to 1e-10 N·m.
    """
    damped = dataclasses.replace(damped, flywheel_inertia=inertia)
    motion = solve(law, damped, REST, 2.0, 0.2, ramp)
    times, h = np.linspace(2.001, 2.199, 333), 1e-6
    twist, rate, angle, speed, acceleration = motion.at(times)
    slope = (motion.at(times + h) - motion.at(times - h)) / (2.0 * h)
    np.testing.assert_allclose(slope[0], rate, rtol=0, atol=1e-7)
    np.testing.assert_allclose(slope[2], speed, rtol=0, atol=1e-7)
    torque = damped.shaft_stiffness * twist + damped.shaft_damping * rate
    torque += motion.contact_force(times) * law(angle, 1)
    np.testing.assert_allclose(damped.cam_inertia * acceleration, -torque, rtol=0, atol=1e-10)
    if inertia is not None:
        return
    np.testing.assert_allclose(speed - rate, SLOW + ramp * (times - 2.0), rtol=1e-13)
    assert motion.end.flywheel_speed == pytest.approx(SLOW + 0.2 * ramp, rel=1e-14)
    assert motion.end.flywheel_angle == pytest.approx(0.2 * SLOW + 0.02 * ramp, rel=1e-14)


def test_times_in_any_order(laws, damped):
    """The torsional motion has the same values for single times and in any order."""
    motion = solve(laws["tm21"], damped, REST, 5.0, 0.3)
    times, order = 5.0 + 1e-4 * np.arange(3000), np.random.default_rng(1).permutation(3000)
    rows = motion.at(times)
    np.testing.assert_array_equal(motion.at(times[order]), rows[:, order])
    np.testing.assert_allclose(motion.at(times[17])[:, 0], rows[:, 17], rtol=1e-13)
    assert motion.at(np.array([])).shape == (5, 0)
    assert motion.stop_time == pytest.approx(5.3)


@pytest.mark.variants(3)
@pytest.mark.parametrize("speed", [SLOW, -SLOW, 3.0])
def test_periodic_state_returns(law, damped, speed):
    """The periodic state of the torsional model returns after a turn, to 1e-11.

    The tolerance is relative to the peak twist.
    """
    _, state = steady_state(law, damped, speed)
    motion = solve(law, damped, state, 0.0, TURN / abs(speed))
    peak = np.abs(motion.at(1e-3 * motion.stop_time * np.arange(1000))[0]).max()
    assert motion.end.twist == pytest.approx(state.twist, abs=1e-11 * peak)
    assert motion.end.twist_rate == pytest.approx(state.twist_rate, abs=1e-11 * peak * 632.0)
    assert motion.end.flywheel_angle == pytest.approx(math.copysign(TURN, speed), abs=1e-13)


def test_resonance_has_no_periodic_state(laws, follower):
    """A whole number of undamped shaft periods per turn raises an error.

    Such a shaft has no periodic state. A speed of 0 is an error, too.
    """
    base = laws["poly345"]
    undamped = dataclasses.replace(follower, damping=0.0)
    p = TorsionalParameters(undamped, 0.02, 0.02 * (5 * SLOW) ** 2)
    law = Law("flat", base.breaks, 1e-9 * base.ordinates)
    with pytest.raises(DynamicsError, match=r"no periodic state at .* Resonance needs damping"):
        steady_state(law, p, SLOW)
    with pytest.raises(DynamicsError, match=r"speed is 0.0; allowed"):
        steady_state(law, p, 0.0)


@pytest.mark.parametrize("ramp", [0.0, 60.0])
def test_a_stiff_shaft_equals_the_kinetostatic_model(laws, ramp):
    """With an almost rigid shaft the follower moves as in the kinetostatic model.

    The tolerances are 1e-8 m and 0.01 N.
    """
    stiff = TorsionalParameters(FOLLOWER, 0.02, 1e9, 1e3)
    interval = Interval(0, 200 * MS, 0.0, 10.0 if ramp else SLOW, ramp)
    law = laws["poly345"]
    rows = MODELS["torsional"].advance(law, stiff, None, interval, 10_000)[1].rows
    rigid = MODELS["kinetostatic"].advance(law, FOLLOWER, None, interval, 10_000)[1].rows
    np.testing.assert_allclose(rows[1], rigid[1], atol=1e-8)
    np.testing.assert_allclose(rows[4], rigid[4], atol=1e-2)


# -- ramps θ_v = θ₀ + ω t + α t²/2 of the flywheel, with the law at the twisted angle

#: Parameters of a shaft without damping, the same as in the reference model `TWIST`.
SHAFT = TorsionalParameters(FOLLOWER, 0.02, 5e3)
TWIST = Twist(0.02, 5e3, 1.3, 8.642, 4030.0, 12.753)


@pytest.mark.variants(3)
@pytest.mark.parametrize("name", ["poly345", "tm21"])
@pytest.mark.parametrize(
    ("speed", "ramp", "duration"), [(0.0, 60.0, 0.5), (20.0, 100.0, 0.3), (45.0, -120.0, 0.37)]
)
def test_a_ramp_against_forty_digits(laws, many_digits, name, speed, ramp, duration):
    """The twist on a speed ramp agrees with 40-digit arithmetic, to 1e-12 of its peak."""
    times = np.linspace(0.0, duration, 24)[1:]
    law = laws[name]
    inputs = (law.breaks, law.ordinates, speed, ramp, times, list(vars(TWIST).values()))
    case = Case("ramp", "", law, TWIST, speed, 2, 2, times)

    def by_series():
        solution = exact_twist.solve_twist(case, ramp)
        return solution.displacement[0], solution.velocity[0]

    twist, rate = many_digits(by_series, inputs)
    start = TorsionalState(0.0, 0.0, 0.0, speed)
    got = solve(laws[name], SHAFT, start, 0.0, duration, ramp).at(times)
    assert np.abs(got[0] - twist).max() < 1e-12 * np.abs(twist).max()
    assert np.abs(got[1] - rate).max() < 1e-12 * np.abs(rate).max()
    flywheel = speed * times + 0.5 * ramp * times**2
    np.testing.assert_allclose(got[2], flywheel + twist, rtol=0, atol=1e-13)
    np.testing.assert_allclose(got[3], speed + ramp * times + rate, rtol=0, atol=1e-12)

"""Torsional vibration: joints, restarts, samples, the periodic state, and what is refused."""

import dataclasses
import math

import numpy as np
import pytest

from cam_rig.dynamics.torsional.motion import ROWS, periodic_state, solve
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import TURN

SPEED = 350.0 * np.pi / 30.0
REST = TorsionalState(0.0, 0.0, 0.0, SPEED)


@pytest.fixture(scope="module")
def shaft(follower):
    """A soft shaft, damped."""
    return TorsionalParameters(follower, 0.02, 8e3, 0.4)


def test_joints_are_met(laws, shaft):
    """Windows end where the cam itself, not the flywheel, is at a joint; there s'' and θ̈_c step.

    (I + m s'²) Δθ̈_c = −m Δs'' θ̇_c² s': all else is continuous.
    """
    law, f = laws["tm21"], shaft.follower
    motion = solve(law, shaft, REST, 0.0, TURN / SPEED)
    inner = motion.path.edges[1:-1]
    at_joint = motion.at(inner)
    distance = np.abs(at_joint[2][:, None] - law.breaks).min(axis=1)
    met = distance < 1e-9
    assert distance[met].max() < 4e-15
    assert met.sum() >= law.spans.size - 1
    before, after = motion.at(inner - 1e-10), at_joint
    s1 = law(at_joint[2], 1)
    step = law(at_joint[2] + 1e-9, 2) - law(at_joint[2] - 1e-9, 2)
    expected = -f.mass * step * at_joint[3] ** 2 * s1 / (shaft.cam_inertia + f.mass * s1**2)
    np.testing.assert_allclose(after[4] - before[4], expected, rtol=0, atol=1e-4)
    assert np.abs(expected).max() > 5.0


@pytest.mark.variants(8)
def test_rows_obey_the_equation(law, shaft):
    """Rates are those of the values, and θ̈_c closes eq. 10 with the contact force."""
    motion = solve(law, shaft, REST, 2.0, 0.2)
    times = np.linspace(2.001, 2.199, 333)
    twist, rate, angle, speed, acceleration = motion.at(times)
    assert len(ROWS) == 5
    h = 1e-6
    slope = (motion.at(times + h) - motion.at(times - h)) / (2.0 * h)
    np.testing.assert_allclose(slope[0], rate, rtol=0, atol=1e-7)
    np.testing.assert_allclose(slope[2], speed, rtol=0, atol=1e-7)
    torque = shaft.shaft_stiffness * twist + shaft.shaft_damping * rate
    torque += motion.contact_force(times) * law(angle, 1)
    np.testing.assert_allclose(shaft.cam_inertia * acceleration, -torque, rtol=0, atol=1e-10)


def test_restart_leaves_no_trace(laws, shaft):
    """Going on from the end of a motion is the same motion."""
    p = shaft
    law, start = laws["poly345"], 1.25
    whole = solve(law, p, REST, start, 0.5)
    first = solve(law, p, REST, start, 0.2345)
    second = solve(law, p, first.end, first.stop_time, 0.5 - 0.2345)
    times = np.linspace(first.stop_time, start + 0.4999, 500)
    one, other = whole.at(times), second.at(times)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=2e-12 * np.abs(a).max())


def test_times_in_any_order(laws, shaft):
    """Shuffled times, single times and uniform samples give the same numbers."""
    motion = solve(laws["tm21"], shaft, REST, 5.0, 0.3)
    rows = motion.sample(5.0, 1e-4, 3000)
    order = np.random.default_rng(1).permutation(3000)
    times = 5.0 + 1e-4 * np.arange(3000)
    np.testing.assert_array_equal(motion.at(times[order]), rows[:, order])
    np.testing.assert_allclose(motion.at(times[17])[:, 0], rows[:, 17], rtol=1e-13)
    assert motion.at(np.array([])).shape == (5, 0)
    assert motion.stop_time == pytest.approx(5.3)


@pytest.mark.parametrize("times", [4.9, 5.31, math.nan])
def test_times_outside(laws, shaft, times):
    """No extrapolation."""
    motion = solve(laws["tm21"], shaft, REST, 5.0, 0.3)
    with pytest.raises(DynamicsError, match=r"allowed: 0 to 0.3 s, so solve for longer"):
        motion.at(times)


@pytest.mark.variants(8)
@pytest.mark.parametrize("speed", [SPEED, -SPEED, 3.0])
def test_periodic_state_returns(law, shaft, speed):
    """After one turn it is back, to 1e-11 of the peak twist, and where it is on the turn."""
    state = periodic_state(law, shaft, speed, 0.4)
    motion = solve(law, shaft, state, 0.0, TURN / abs(speed))
    peak = np.abs(motion.sample(0.0, 1e-3 * motion.stop_time, 1000)[0]).max()
    assert motion.end.twist == pytest.approx(state.twist, abs=1e-11 * peak)
    assert motion.end.twist_rate == pytest.approx(state.twist_rate, abs=1e-11 * peak * 632.0)
    assert motion.end.flywheel_angle == pytest.approx(0.4 + math.copysign(TURN, speed), abs=1e-13)


def test_periodic_state_is_what_remains(laws, shaft):
    """From rest the damped shaft comes to the periodic state."""
    motion = solve(laws["poly345"], shaft, REST, 0.0, 20.0 * TURN / SPEED)
    state = periodic_state(laws["poly345"], shaft, SPEED)
    assert motion.end.twist == pytest.approx(state.twist, abs=1e-13)
    assert motion.end.twist_rate == pytest.approx(state.twist_rate, abs=1e-10)


def test_resonance_has_no_periodic_state(laws, follower):
    """Undamped, with a whole number of periods in the turn, and a cam too flat to detune it."""
    base = laws["poly345"]
    p = TorsionalParameters(
        dataclasses.replace(follower, damping=0.0), 0.02, 0.02 * (5 * SPEED) ** 2
    )
    law = Law("flat", base.breaks, 1e-9 * base.ordinates)
    with pytest.raises(DynamicsError, match=r"no periodic state at .* Resonance needs damping"):
        periodic_state(law, p, SPEED)


def test_periodic_state_needs_a_fixed_speed(laws, shaft):
    """A standing flywheel makes no turn."""
    with pytest.raises(DynamicsError, match=r"speed is 0.0; allowed"):
        periodic_state(laws["poly345"], shaft, 0.0)


@pytest.mark.parametrize(
    ("name", "value", "limit"),
    [
        *[(n, v, "> 0") for n in ("cam_inertia", "shaft_stiffness") for v in (0.0, -1.0, math.nan)],
        ("shaft_damping", -1e-9, "≥ 0"),
    ],
)
def test_bad_parameter(shaft, name, value, limit):
    """The error has the name, the value and the limit."""
    with pytest.raises(DynamicsError, match=rf"{name} is {value!r}; allowed: finite and {limit}"):
        dataclasses.replace(shaft, **{name: value})


@pytest.mark.parametrize(
    ("state", "duration", "message"),
    [
        (REST, 0.0, "duration is 0.0; allowed: finite and > 0"),
        (REST, math.inf, "duration is inf"),
        (dataclasses.replace(REST, twist=math.nan), 1.0, "twist is nan; allowed: finite"),
        (dataclasses.replace(REST, twist_rate=1e14), 1.0, "diverges after 40 tries; check"),
    ],
)
def test_bad_run(laws, shaft, state, duration, message):
    """Impossible numbers are refused, and a hopeless run ends with a reason."""
    with pytest.raises(DynamicsError, match=message):
        solve(laws["poly345"], shaft, state, 0.0, duration)


def test_a_cam_with_an_edge(shaft):
    """A step of s' would need an impulse."""
    breaks = np.array([0.0, 2.0, 4.0, TURN])
    law = Law("edge", breaks, np.array([[0.0, 0.0, 0.01], [0.0, 0.01, 0.0]]))
    told = (
        r"law 'edge': velocity jumps by -0.00938 m/rad at 229°.*elastic_stem, one_mass and two_mass"
    )
    with pytest.raises(DynamicsError, match=told):
        solve(law, shaft, REST, 0.0, 1.0)

"""The promise of the Python interface: bad input is an error with the value and the limit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, FollowerState, Interval
from cam_rig.dynamics.elastic_stem import motion
from cam_rig.dynamics.two_mass.masses import TwoMassParameters
from cam_rig.dynamics.two_mass.model import states
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.errors import DynamicsError
from cam_rig.units import NS

NAN, INF = math.nan, math.inf
FOLLOWER = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8)
TWO = TwoMassParameters(0.3, 1.0, 3.3e8, 4030.0, 5.0, 8.642, 12.753)
REST = np.zeros(2)
pytestmark = pytest.mark.usefixtures("at_once")
BAD_TIMES = [
    ([0.2, 0.1], r"times: 0.1 s comes after 0.2 s; allowed: ascending"),
    ([-0.1, 0.1], r"times are -0.1 to 0.1 s; allowed: 0 to"),
    ([0.0, NAN], r"times: has .*nan.*; allowed: a row of finite numbers"),
    ([0.0, INF], r"times: has .*inf.*; allowed: a row of finite numbers"),
    (0.1, r"times: has .*0.1.*; allowed: a row"),
    (None, r"times.*; allowed: a row"),
    ("soon", r"times is 'soon'; allowed: a row"),
]


@pytest.mark.parametrize(("times", "told"), BAD_TIMES)
def test_times(laws, times, told):
    """Times ascend from the start, for a vibration and for a course that lifts off."""
    with pytest.raises(DynamicsError, match=told):
        motion(laws["poly345"], FOLLOWER, 30.0, 0.0, REST, times)
    course = Separation(laws["poly345"], TWO, 30.0)
    course.run(0.3)
    with pytest.raises(DynamicsError, match=told):
        states(course, times)


def test_a_list_of_times_is_a_row(laws):
    """A list is taken as an array is."""
    one = motion(laws["poly345"], FOLLOWER, 30.0, 0.0, [0.0, 0.0], [0.0, 0.1])
    two = motion(laws["poly345"], FOLLOWER, 30.0, 0.0, REST, np.array([0.0, 0.1]))
    assert np.array_equal(one, two)


def test_times_past_the_end_of_a_course(laws):
    """What was not run is not known."""
    course = Separation(laws["poly345"], TWO, 30.0)
    with pytest.raises(DynamicsError, match=r"allowed: 0 to 0 s"):
        states(course, np.array([0.1]))
    course.run(0.3)
    assert np.isfinite(states(course, np.array([0.0, 0.3]))).all()
    with pytest.raises(DynamicsError, match=r"times are 0.1 to 0.31 s; allowed: 0 to 0.3 s"):
        states(course, np.array([0.1, 0.31]))


@pytest.mark.parametrize(
    ("speed", "angle", "start", "told"),
    [
        (1e300, 0.0, REST, r"speed is 1e\+300 rad/s; allowed: .*1e\+09 rad/s"),
        (1e-300, 0.0, REST, r"speed is 1e-300 rad/s; allowed"),
        ("fast", 0.0, REST, r"speed is 'fast' rad/s; allowed"),
        (30.0, NAN, REST, r"angle is nan; allowed: finite"),
        (30.0, 1e15, REST, r"angle is 10+\.0; allowed: .* 1e\+12 rad.*the phase is lost"),
        (30.0, 0.0, [NAN, 0.0], r"state: has .*nan.*; allowed: a row of finite numbers"),
        (30.0, 0.0, [0.0], r"state: has 1 numbers; allowed: 2"),
        (30.0, 0.0, None, r"state.*; allowed: a row of finite numbers"),
    ],
)
def test_start_of_a_vibration(laws, speed, angle, start, told):
    """Speed, angle and state by name."""
    with pytest.raises(DynamicsError, match=told):
        motion(laws["poly345"], FOLLOWER, speed, angle, start, np.array([0.0, 0.1]))


@pytest.mark.parametrize("duration", [NAN, INF, 0.0, -1.0, None, 1e14])
def test_duration_of_a_course(laws, duration):
    """A course has a length, and ends where the phase is still known."""
    with pytest.raises(DynamicsError, match=r"(duration|angle at the end) is .*; allowed"):
        Separation(laws["poly345"], TWO, 30.0).run(duration)


@pytest.mark.parametrize(("state", "contact"), [([NAN, 0.0], True), ([0.0, 0.0], False)])
def test_state_of_a_course(laws, state, contact):
    """Two finite numbers on the cam, four in flight."""
    with pytest.raises(DynamicsError, match=r"state: has .*; allowed"):
        Separation(laws["poly345"], TWO, 30.0).run(0.1, np.array(state), contact)


@pytest.mark.parametrize("name", ["elastic_stem", "two_mass"])
def test_a_state_of_another_model(laws, name):
    """What one model remembers is no state of another."""
    model = MODELS[name]
    parameters = FOLLOWER if name == "elastic_stem" else TWO
    state = FollowerState(0.0, 0.0, 1.0, True, inner=(0.0, 0.0, 0.0))
    with pytest.raises(DynamicsError, match=r"state: has 3 numbers; allowed: 2"):
        model.advance(laws["poly345"], parameters, state, Interval(0, NS, 0.0, 30.0), 1000)


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ((0, NAN, 0.0, 1.0), r"stop_ns is nan; allowed: a whole number of ns"),
        ((0, INF, 0.0, 1.0), r"stop_ns is inf; allowed: a whole number of ns"),
        ((None, NS, 0.0, 1.0), r"start_ns is None; allowed"),
        ((0, NS, 1.1e15, 1.0), r"angle is 1100000000000000.0; allowed: .*the phase is lost"),
        ((0, NS, 0.0, 1e13), r"last angle is .*; allowed: .*the phase is lost"),
        ((0, NS, 0.0, None), r"speed is None; allowed: finite"),
    ],
)
def test_interval(numbers, told):
    """Stamps are whole, and an angle has a phase."""
    with pytest.raises(DynamicsError, match=told):
        Interval(*numbers)


@pytest.mark.parametrize("rate", [0, -1000, NAN, 1000.0, None, 10**10])
def test_sample_rate(rate):
    """All models sample on the interval's grid, which has a whole rate."""
    with pytest.raises(DynamicsError, match=r"sample_rate is .*; allowed: a whole number of Hz, 1"):
        Interval(0, NS, 0.0, 30.0).grid(rate)


@pytest.mark.parametrize("parameters", [FOLLOWER, TWO], ids=["one mass", "two masses"])
@pytest.mark.parametrize(
    ("name", "value"),
    [("damping", 1e300), ("spring_stiffness", 1e-300), ("preload", None), ("preload", "heavy")],
)
def test_parameters(parameters, name, value):
    """Numbers whose products overflow, and what is no number, by name and limit."""
    with pytest.raises(DynamicsError, match=rf"{name} is {value!r}".replace("+", r"\+") + "; all"):
        replace(parameters, **{name: value})

"""Invalid inputs raise an error at once, with name, value and limit."""

import itertools
import math
import re
from dataclasses import fields, replace

import numpy as np
import pytest

from benchmark.speed.study import stem_motion as motion
from cam_rig.dynamics import MODELS, FollowerState, Interval, TwoMassParameters
from cam_rig.dynamics.elastic_stem import response
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.dynamics.two_mass import Separation, states
from cam_rig.errors import CamRigError, ConfigError, DynamicsError
from cam_rig.laws import Law
from cam_rig.units import NS, TURN

from .helpers import ONE as FOLLOWER

NAN, INF = math.nan, math.inf
TWO = TwoMassParameters(0.3, 1.0, 3.3e8, 4030.0, 5.0, 8.642, 12.753)
SHAFT = TorsionalParameters(FOLLOWER, 0.02, 8e3, 0.4, 0.2)
REST, TWIST = np.zeros(2), TorsionalState(0.0, 0.0, 0.0, 36.0)
pytestmark = pytest.mark.usefixtures("at_once")

#: Invalid values of a number that must be positive.
POSITIVE = (0.0, -1.3, NAN, INF, 1e-300)
#: Invalid values of a number that must not be negative.
NOT_NEGATIVE = (-1e-9, NAN, INF, 1e300)
#: Cases: parameter record, names of its numbers, invalid values, and the limit in the error
#: message.
LIMITS = [
    (FOLLOWER, ("mass", "spring_stiffness", "stem_stiffness"), POSITIVE, "finite and > 0"),
    (FOLLOWER, ("damping", "preload"), (*NOT_NEGATIVE, "heavy", None), "finite and ≥ 0"),
    (FOLLOWER, ("restitution",), (1.0, 1.5, -0.1, NAN), "finite and in [0, 1)"),
    (TWO, ("roller_mass", "end_mass", "spring_stiffness"), POSITIVE, "finite and > 0"),
    (TWO, ("stem_damping", "damping", "preload"), (*NOT_NEGATIVE, None), "finite and ≥ 0"),
    (TWO, ("restitution",), (1.0, 1.5, -0.1, NAN), "finite and in [0, 1)"),
    (SHAFT, ("cam_inertia", "shaft_stiffness", "flywheel_inertia"), POSITIVE, "finite and > 0"),
    (SHAFT, ("shaft_damping",), NOT_NEGATIVE, "finite and ≥ 0"),
]


@pytest.mark.parametrize(("record", "names", "values", "limit"), LIMITS)
def test_parameters(record, names, values, limit):
    """Each parameter of a follower or shaft is checked against its limit.

    The error contains name, value and limit.
    """
    for name, value in itertools.product(names, values):
        message = re.escape(f"{name} is {value!r}; allowed: {limit}")
        with pytest.raises(DynamicsError, match=message):
            replace(record, **{name: value})


def test_parameters_of_a_rig(rig, follower, paper_rig):
    """The parameters of a follower model are the numbers of the rig file in SI units.

    If the rig lacks a section that the model needs, this is an error.
    """
    for name in (field.name for field in fields(follower)):
        assert getattr(follower, name) == getattr(rig.follower, name).si
    with pytest.raises(ConfigError, match="shaft: is missing; needed by the model torsional"):
        MODELS["torsional"].parameters(rig)
    with pytest.raises(DynamicsError, match=r"motor_torque is 1.0; allowed: 0 where the flywheel"):
        replace(MODELS["torsional"].parameters(paper_rig), motor_torque=1.0)


def test_the_largest_damping_ratio_is_ten(paper_rig):
    """A damping ratio above 10 raises an error that suggests another model.

    A flight with such a damping would take an hour to compute.
    """
    p, shaft = MODELS["two_mass"].parameters(paper_rig), paper_rig.shaft
    limit = 20.0 * math.sqrt((p.stem_stiffness + p.spring_stiffness) * p.end_mass)
    stiff = 20.0 * math.sqrt(shaft.stiffness.si * shaft.cam_inertia.si)

    def damped(model, factor):
        rig = paper_rig.with_follower(damping=0.4 * limit, stem_damping=(factor - 0.4) * limit)
        if model == "torsional":
            shaft_data = shaft.model_dump() | {"damping": f"{factor * stiff} N*m*s/rad"}
            rig = paper_rig.replace(shaft=shaft_data)
        return MODELS[model].parameters(rig)

    assert damped("two_mass", 0.99999).damping_ratio == pytest.approx(10.0, rel=1e-4)
    assert damped("torsional", 0.99999).shaft_damping == pytest.approx(stiff, rel=1e-4)
    for model, other in (("two_mass", "one_mass"), ("torsional", "another model")):
        message = rf"10\.1 times .* critical .* 10 times, .* {other}"
        with pytest.raises(DynamicsError, match=message):
            damped(model, 1.01)


def test_contact_time_is_half_a_period(follower):
    """The contact time of a landing is half a natural period of mass and stem.

    It is the first zero of sin(√(k/m) T).
    """
    rate = math.sqrt(follower.stem_stiffness / follower.mass)
    assert rate * follower.contact_time == pytest.approx(math.pi, rel=1e-15)


@pytest.mark.parametrize("name", MODELS)
def test_speed_and_angle(laws, paper_rig, name):
    """Speeds must be positive and finite, and angles must be finite."""
    parameters = MODELS[name].parameters(paper_rig)
    speeds = [("speed", value) for value in (0.0, -10.0, NAN, INF)]
    for key, value in [*speeds, ("angle", NAN), ("angle", INF)]:
        numbers = {"angle": 0.0, "speed": 10.0, key: value}
        with pytest.raises(CamRigError, match=rf"{key} is {value!r}.*allowed: finite"):
            interval = Interval(0, NS // 10, **numbers)
            MODELS[name].advance(laws["poly345"], parameters, None, interval, 1000)


def test_a_law_or_a_state_that_is_not_finite():
    """A law or a state with numbers that are not finite cannot be created."""
    for value in (NAN, INF, -INF):
        ordinates = np.zeros((6, 1))
        ordinates[3] = value
        with pytest.raises(CamRigError, match=r"law 'broken': .* must be finite"):
            Law("broken", np.array([0.0, TURN]), ordinates)
    for numbers, inner in (((NAN, 0, 0), ()), ((0, INF, 0), ()), ((0, 0, 0), (NAN,))):
        message = r"a follower whose \w+ is (nan|inf); allowed: finite"
        with pytest.raises(CamRigError, match=message):
            FollowerState(*numbers, True, inner=inner)


BAD_TIMES = [
    ([0.2, 0.1], r"times: 0.1 s comes after 0.2 s; allowed: ascending"),
    ([-0.1, 0.1], r"times are -0.1 to 0.1 s; allowed: 0 to"),
    ([0.0, NAN], r"times: has .*nan.*; allowed: a row of finite numbers"),
    (0.1, r"times: has .*0.1.*; allowed: a row"),
    (None, r"times.*; allowed: a row"),
    ("soon", r"times is 'soon'; allowed: a row"),
]


def test_times(laws):
    """Times of a vibration or a trajectory must ascend and lie within the run."""
    trajectory = Separation(laws["poly345"], TWO, 30.0)
    with pytest.raises(DynamicsError, match=r"allowed: 0 to 0 s"):
        states(trajectory, np.array([0.1]))
    trajectory.run(0.3)
    for times, message in BAD_TIMES:
        with pytest.raises(DynamicsError, match=message):
            motion(laws["poly345"], FOLLOWER, 30.0, 0.0, REST, times)
        with pytest.raises(DynamicsError, match=message):
            states(trajectory, times)
    assert np.isfinite(states(trajectory, np.array([0.0, 0.3]))).all()
    with pytest.raises(DynamicsError, match=r"times are 0.1 to 0.31 s; allowed: 0 to 0.3 s"):
        states(trajectory, np.array([0.1, 0.31]))
    of_list = motion(laws["poly345"], FOLLOWER, 30.0, 0.0, [0.0, 0.0], [0.0, 0.1])
    of_array = motion(laws["poly345"], FOLLOWER, 30.0, 0.0, REST, np.array([0.0, 0.1]))
    assert np.array_equal(of_list, of_array)


STARTS = [
    (1e300, 0.0, REST, r"speed is 1e\+300 rad/s; allowed: .*1e\+09 rad/s"),
    (0.0, 0.0, REST, r"speed is 0"),
    ("fast", 0.0, REST, r"speed is 'fast' rad/s; allowed"),
    (30.0, NAN, REST, r"angle is nan; allowed: finite"),
    (30.0, 1e15, REST, r"angle is 10+\.0; allowed: .* 1e\+12 rad.*the phase is lost"),
    (30.0, 0.0, [NAN, 0.0], r"state: has .*nan.*; allowed: a row of finite numbers"),
    (30.0, 0.0, [0.0], r"state: has 1 numbers; allowed: 2"),
    (30.0, 0.0, None, r"state.*; allowed: a row of finite numbers"),
]


def test_start_of_a_vibration(laws):
    """An invalid speed, angle or state at the start of a vibration is an error."""
    for speed, angle, start, message in STARTS:
        with pytest.raises(DynamicsError, match=message):
            motion(laws["poly345"], FOLLOWER, speed, angle, start, np.array([0.0, 0.1]))
    with pytest.raises(DynamicsError, match="speed is 0"):
        response(laws["poly345"], FOLLOWER, 0.0)


def test_arguments_of_a_trajectory(laws):
    """A trajectory checks its duration, its end angle and the size of its state."""
    law = laws["poly345"]
    for duration in (NAN, INF, 0.0, -1.0, None, 1e14):
        with pytest.raises(DynamicsError, match=r"(duration|angle at the end) is .*; allowed"):
            Separation(law, TWO, 30.0).run(duration)
    for state, contact in (([NAN, 0.0], True), ([0.0, 0.0], False)):
        with pytest.raises(DynamicsError, match=r"state: has .*; allowed"):
            Separation(law, TWO, 30.0).run(0.1, np.array(state), contact)
    with pytest.raises(DynamicsError, match="speed is nan"):
        Separation(law, TWO, NAN)


@pytest.mark.parametrize(("name", "parameters"), [("elastic_stem", FOLLOWER), ("two_mass", TWO)])
def test_a_state_of_another_model(laws, name, parameters):
    """A state with the size of another follower model's state raises an error.

    The error has both sizes.
    """
    state = FollowerState(0.0, 0.0, 1.0, True, inner=(0.0, 0.0, 0.0))
    with pytest.raises(DynamicsError, match=r"state: has 3 numbers; allowed: 2"):
        advance = MODELS[name].advance
        advance(laws["poly345"], parameters, state, Interval(0, NS, 0.0, 30.0), 1000)


INTERVALS = [
    ((0, NAN, 0.0, 1.0), r"stop_ns is nan; allowed: a whole number of ns"),
    ((None, NS, 0.0, 1.0), r"start_ns is None; allowed"),
    ((0, NS, 1.1e15, 1.0), r"angle is 1100000000000000.0; allowed: .*the phase is lost"),
    ((0, NS, 0.0, 1e13), r"last angle is .*; allowed: .*the phase is lost"),
    ((0, NS, 0.0, None), r"speed is None; allowed: finite"),
    ((0, NS, 0.0, INF), r"an interval whose speed is inf; allowed: finite"),
    ((0, NS, 0.0, 5.0, -6.0), r"a ramp from 5 to -1 rad/s; allowed: from rest or forwards"),
    ((0, NS, 0.0, 1.0, NAN), r"an interval whose acceleration is nan; allowed: finite"),
]


def test_interval():
    """An interval checks its stamps, angles, speeds and the sample rate."""
    for numbers, message in INTERVALS:
        with pytest.raises(DynamicsError, match=message):
            Interval(*numbers)
    for rate in (0, -1000, NAN, 1000.0, None, 10**10):
        with pytest.raises(DynamicsError, match=r"sample_rate is .*; allowed: a whole number of"):
            Interval(0, NS, 0.0, 30.0).grid(rate)


TWISTS = [
    (TWIST, (0.0, 0.0), "duration is 0.0; allowed: finite and > 0"),
    (TWIST, (1.0, NAN), "ramp is nan; allowed: finite"),
    (replace(TWIST, twist=NAN), (1.0, 0.0), "twist is nan; allowed: finite"),
    (replace(TWIST, twist_rate=1e14), (1.0, 0.0), "diverges after 40 tries; check"),
]


def test_a_twist(laws):
    """Invalid numbers of a torsional motion, and a diverging solution, are errors."""
    constant_speed = replace(SHAFT, flywheel_inertia=None)
    for state, (duration, ramp), message in TWISTS:
        with pytest.raises(DynamicsError, match=message):
            solve(laws["poly345"], constant_speed, state, 0.0, duration, ramp)
    result = solve(laws["tm21"], constant_speed, TWIST, 5.0, 0.3)
    for time in (4.9, 5.31, NAN):
        with pytest.raises(DynamicsError, match=r"allowed: 0 to 0.3 s, so solve for longer"):
            result.at(time)


def test_a_law_whose_velocity_jumps(edge, paper_rig):
    """Models without impacts reject a velocity jump of the cam.

    The error states its angle and the models that allow it.
    """
    message = r"law 'edge': velocity jumps by 0.0318 m/rad at 60°, an infinite force in this model"
    intervals = Interval(0, NS, 0.0, 6.0), Interval(0, NS, 0.0, 0.0, 6.0)
    for name, interval in itertools.product(("kinetostatic", "torsional"), intervals):
        parameters = MODELS[name].parameters(paper_rig)
        with pytest.raises(DynamicsError, match=message + ".*elastic_stem, one_mass and two_mass"):
            MODELS[name].advance(edge, parameters, None, interval, 1000)

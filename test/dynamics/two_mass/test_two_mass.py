"""The two-mass follower: contact, lift-off, flight and landing, exact and in balance."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.two_mass.model import _phase_states
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.errors import DynamicsError
from cam_rig.schema import load_rig
from cam_rig.units import NS, TURN

SOFT = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6)
STEM = TwoMassParameters(0.52, 0.78, 3.3e8, 4030.0, 8.642, 8.642, 12.753)


def course(law, parameters, rpm, turns=1.0):
    speed = rpm * np.pi / 30.0
    found = Separation(law, parameters, speed)
    found.run(turns * TURN / speed)
    return found


def test_jump_speed_is_the_identified_one(laws, config_dir):
    """3-4-5 leaves the cam between 412 and 415 rpm with the numbers identified from Table 2."""
    rig = load_rig(config_dir / "rigs" / "paper_table2.yaml")
    p = TwoMassParameters.from_rig(rig)
    assert course(laws["poly345"], p, 412.0, 2.0).events == []
    assert course(laws["poly345"], p, 415.0, 2.0).events != []


def test_lift_off_is_where_the_force_is_zero_and_landing_where_the_gap_is(laws):
    """Force before a lift-off and gap before a landing are positive, and zero at the event."""
    found = course(laws["poly345"], SOFT, 450.0)
    lift_off, landing = found.events[:2]
    before, flight = found.phases[:2]
    forces = _phase_states(found, before, np.array([before.begin, lift_off.time]))[4]
    assert forces[0] > 1.0
    assert abs(forces[1]) < 1e-7  # N: eps · k₁ · lift is 1e-11, and its slope 1e5 N/s
    times = np.linspace(flight.begin, flight.end, 200)
    gap = _phase_states(found, flight, times)[0] - found.cam(times)[0]
    assert (gap[1:-1] > 0.0).all()
    assert abs(gap[-1]) < 1e-12 * 0.05  # what counts as below the cam is 64 rounding errors
    assert landing.impulse > 0.0


def test_against_a_tight_integrator(laws):
    """Lift-off and the flight after it, against DOP853 at 1e-13 in the equations of motion."""
    p, law = SOFT, laws["poly345"]
    found = course(law, p, 450.0)
    speed, flight = found.speed, found.phases[1]

    def contact(t, x):
        s, v, _ = found.cam(np.array([t]))[:, 0]
        push = p.stem_damping * v + p.stem_stiffness * s - p.preload
        damping, stiffness = p.stem_damping + p.damping, p.stem_stiffness + p.spring_stiffness
        return [x[1], (push - damping * x[1] - stiffness * x[0]) / p.end_mass]

    state = p.static_place(found.cam(np.zeros(1))[:, 0])
    edges = [b / speed for b in law.breaks if b / speed < flight.begin] + [flight.begin]
    for a, b in itertools.pairwise(edges):
        state = solve_ivp(contact, (a, b), state, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    begin = found.fly(flight.flight, np.zeros(1))[:, 0]
    np.testing.assert_allclose(begin[2:], state, rtol=1e-9, atol=1e-11)

    def free(_, x):
        return p.flight_matrix @ x + p.flight_load

    span = (0.0, flight.end - flight.begin)
    landed = solve_ivp(free, span, begin, "DOP853", rtol=1e-13, atol=1e-15)
    end = found.fly(flight.flight, np.array([flight.end - flight.begin]))[:, 0]
    np.testing.assert_allclose(end, landed.y[:, -1], rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("milliseconds", [1, 200])
def test_the_length_of_an_interval_does_not_enter(laws, milliseconds):
    """Ticks of 1 ms or 200 ms give the events and samples of one call to 1e-10."""
    law, total, speed = laws["poly345"], 400_000_000, 450.0 * np.pi / 30.0
    advance = MODELS["two_mass"].advance
    _, whole = advance(law, SOFT, None, Interval(0, total, 0.0, speed), 48_000)
    state, rows, events = None, [], []
    for a in range(0, total, milliseconds * 1_000_000):
        interval = Interval(a, a + milliseconds * 1_000_000, speed * a / NS, speed)
        state, block = advance(law, SOFT, state, interval, 48_000)
        rows.append(block.rows)
        events += block.events
    assert len(events) == len(whole.events) > 2
    for one, other in zip(events, whole.events, strict=True):
        assert one.time == pytest.approx(other.time, rel=1e-10)
    difference = np.abs(np.hstack(rows) - whole.rows)[:5].max(axis=1)
    assert (difference < 1e-10 * np.abs(whole.rows[:5]).max(axis=1)).all()


def test_a_stiff_stem_tends_to_one_mass(laws, follower):
    """With ever stiffer and lighter roller side the lift-off is that of the rigid follower."""
    law, speed = laws["poly345"], 450.0 * np.pi / 30.0
    one = MODELS["one_mass"].advance(
        law, follower, None, Interval(0, 120_000_000, 0.0, speed), 1000
    )[1]
    stiff = TwoMassParameters(0.013, 1.287, 3.3e10, 4030.0, 50.0, 8.642, follower.preload)
    found = course(law, stiff, 450.0)
    assert found.events[0].time == pytest.approx(one.events[0].time, abs=2e-4)


@pytest.mark.parametrize(
    ("key", "value"),
    [("roller_mass", 0.0), ("end_mass", -1.0), ("restitution", 1.0), ("preload", float("nan"))],
)
def test_bad_numbers_are_named(key, value):
    """The message has the name, the value and the limit."""
    with pytest.raises(DynamicsError, match=f"{key} is .*allowed"):
        replace(SOFT, **{key: value})

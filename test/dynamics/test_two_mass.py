"""The two-mass follower: contact, lift-off, flight and landing, exact and in balance."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.two_mass.trajectory import Separation, phase_states
from cam_rig.units import TURN

from .helpers import flight_load, flight_matrix

SOFT = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6)
STEM = TwoMassParameters(0.52, 0.78, 3.3e8, 4030.0, 8.642, 8.642, 12.753)


def course(law, parameters, rpm, turns=1.0):
    speed = rpm * np.pi / 30.0
    found = Separation(law, parameters, speed)
    found.run(turns * TURN / speed)
    return found


def test_jump_speed_is_the_identified_one(laws, two_mass):
    """3-4-5 leaves the cam between 412 and 415 rpm with the numbers identified from Table 2."""
    assert course(laws["poly345"], two_mass, 412.0, 2.0).events == []
    assert course(laws["poly345"], two_mass, 415.0, 2.0).events != []


def test_lift_off_is_where_the_force_is_zero_and_landing_where_the_gap_is(laws):
    """Force before a lift-off and gap before a landing are positive, and zero at the event."""
    found = course(laws["poly345"], SOFT, 450.0)
    lift_off, landing = found.events[:2]
    before, flight = found.phases[:2]
    forces = phase_states(found, before, np.array([before.begin, lift_off.time]))[4]
    assert forces[0] > 1.0
    assert abs(forces[1]) < 1e-7  # N: eps · k₁ · lift is 1e-11, and its slope 1e5 N/s
    times = np.linspace(flight.begin, flight.end, 200)
    gap = phase_states(found, flight, times)[0] - found.cam(times)[0]
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
        return flight_matrix(p) @ x + flight_load(p)

    span = (0.0, flight.end - flight.begin)
    landed = solve_ivp(free, span, begin, "DOP853", rtol=1e-13, atol=1e-15)
    end = found.fly(flight.flight, np.array([flight.end - flight.begin]))[:, 0]
    np.testing.assert_allclose(end, landed.y[:, -1], rtol=1e-8, atol=1e-12)


def test_a_stiff_stem_tends_to_one_mass(laws, follower):
    """With ever stiffer and lighter roller side the lift-off is that of the rigid follower."""
    law, speed = laws["poly345"], 450.0 * np.pi / 30.0
    one = MODELS["one_mass"].advance(
        law, follower, None, Interval(0, 120_000_000, 0.0, speed), 1000
    )[1]
    stiff = TwoMassParameters(0.013, 1.287, 3.3e10, 4030.0, 50.0, 8.642, follower.preload)
    found = course(law, stiff, 450.0)
    assert found.events[0].time == pytest.approx(one.events[0].time, abs=2e-4)

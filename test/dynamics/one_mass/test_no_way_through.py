"""A roller is never below the cam, however it came there and however time is cut."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.dynamics.two_mass.masses import free_masses, to_inner
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.laws import Law
from cam_rig.units import NS

from ..one_flight import land

MS = NS // 1000
PAPER = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6, 0.5)
MASS = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8, 0.0)


def lowest_gap(law, p, speed, acceleration, milliseconds, total=400, model="two_mass"):
    """The lowest gap (m) and the number of events of a ramp from ``speed`` (rad/s) on."""
    whole = Interval(0, total * MS, 0.0, speed, acceleration)
    state, gaps, events = None, [], 0
    for a in range(0, total, milliseconds):
        b = min(a + milliseconds, total) * MS
        at = a / 1000.0
        part = Interval(a * MS, b, whole.angle_at(at), whole.speed_at(at), acceleration)
        state, block = MODELS[model].advance(law, p, state, part, 8000)
        angle = whole.speed * block.rows[0] + 0.5 * acceleration * block.rows[0] ** 2
        gaps.append((block.rows[1] - law(angle)).min())
        events += len(block.events)
    return min(gaps), events


RAMPS = list(itertools.product(("poly345", "tm21"), (0.0, 0.5), (2.0, 30.0), (1, 7)))
#: The others of 1 ms take a second each.
QUICK = (("poly345", 0.5, 30.0, 1), ("tm21", 0.0, 2.0, 1))


@pytest.mark.parametrize(
    ("cam", "restitution", "acceleration", "milliseconds"),
    [
        pytest.param(*ramp, marks=[] if ramp[-1] > 1 or ramp in QUICK else pytest.mark.long)
        for ramp in RAMPS
    ],
)
def test_no_tick_of_a_ramp_loses_a_landing(laws, cam, restitution, acceleration, milliseconds):
    """A ramp's law covers one tick alone, so a short one in a dwell is all zero: what is rounded
    in a gap is not of that size, but of the roller's and the spring's."""
    p = replace(PAPER, restitution=restitution)
    lowest, events = lowest_gap(laws[cam], p, 52.0, acceleration, milliseconds)
    assert lowest > -1e-12
    assert events > 0


def ramp_of_one_slope():
    """A dwell, a rise of 40 mm at constant velocity, a dwell, a 3-4-5 fall, a dwell."""
    high, rise = np.full(6, 0.04), np.linspace(0.0, 0.04, 6)
    fall = np.array([0.04, 0.04, 0.04, 0.0, 0.0, 0.0])
    breaks = np.radians([0.0, 50.0, 160.0, 220.0, 320.0, 360.0])
    return Law("slope", breaks, np.column_stack([0.0 * high, rise, high, fall, 0.0 * high]))


@pytest.mark.parametrize("milliseconds", [20, 3, 1])
def test_one_mass_lands_on_the_slope_where_a_tick_ends(milliseconds):
    """A ramp's law ends with the tick, on a slope: a quick look at the gap must see the cam go on,
    and not a plateau under which the follower sinks (20 µm) until the tick is over."""
    law, p = ramp_of_one_slope(), replace(MASS, restitution=0.7)
    lowest, events = lowest_gap(law, p, 0.0, 150.0 * np.pi / 30.0, milliseconds, model="one_mass")
    assert lowest > -1e-12
    assert events == 33  # as in one tick of 400 ms


@pytest.mark.parametrize("spring", [4030.0, 1.0, 0.1])
def test_a_weak_spring_with_a_large_preload(laws, spring):
    """It would rest far below the cam, a kilometre for 0.1 N/m, and lands all the same: samples are
    known to 1e-9 of that way."""
    p = replace(PAPER, spring_stiffness=spring, preload=100.0)
    lowest, events = lowest_gap(laws["poly345"], p, 62.0, 0.0, 200)
    assert lowest > -1e-9 * p.preload / spring
    assert events > 10


def test_a_roller_below_the_cam_meets_it_at_once(laws):
    """Whatever put it there; it does not go on falling."""
    law, state = laws["poly345"], np.array([-0.01, -1.0, -0.01, -1.0])
    flight = Flight(free_masses(PAPER), to_inner(PAPER, state))
    found = land(flight, law, 0.0, 50.0, 0.1)
    assert (found.landed, found.time) == (True, 0.0)
    course = Separation(law, PAPER, 50.0)
    course.run(0.1, state, contact=False)
    assert course.events[0].kind == "landing"
    assert course.events[0].time == 0.0

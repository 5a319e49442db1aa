"""No landing and no lift-off is missed, however fine the law's detail: against a fine scan."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.kinetostatic import state_at
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.two_mass.masses import free_masses, to_inner
from cam_rig.dynamics.two_mass.trajectory import Separation, phase_states
from cam_rig.laws import Law, bernstein
from cam_rig.units import RPM, TURN

from .helpers import MS, every, land, ticked, with_joints

TWO = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6)
ONE = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8)


def noisy(law, pieces, amplitude, seed):
    """The law through noisy points, one a piece: cubics of Hermite's kind, C¹."""
    breaks = np.linspace(0.0, TURN, pieces + 1)
    breaks[-1] = TURN
    points = law(breaks[:-1]) + amplitude * np.random.default_rng(seed).standard_normal(pieces)
    third = (np.roll(points, -1) - np.roll(points, 1)) / 6.0
    following = np.roll(points, -1)
    return Law(
        "noisy",
        breaks,
        np.stack([points, points + third, following - np.roll(third, -1), following]),
    )


def bumped(law, middle, width, height):
    """The law with a bump h (1 − x²)³ of two pieces, rad and m."""
    low, high, degree = middle - 0.5 * width, middle + 0.5 * width, max(6, law.degree)
    law, u = with_joints(law, low, middle, high), np.linspace(0.0, 1.0, degree + 1)
    ordinates = np.array(bernstein.elevate(law.ordinates, degree))
    for i, (a, b) in enumerate(itertools.pairwise(law.breaks)):
        if low <= a < b <= high:
            x = (a + (b - a) * u - middle) / (0.5 * width)
            bump = height * (1.0 - x**2) ** 3
            ordinates[:, i] += np.linalg.solve(bernstein.basis(degree, u), bump)
    ordinates[-1] = np.roll(ordinates[0], -1)
    return Law("bumped", law.breaks, ordinates)


def two_masses(law, p, rpm, turns, samples):
    """Number of events, lowest gap (m), and lowest force in contact (N), by a fine scan."""
    speed = rpm * RPM
    course = Separation(law, p, speed)
    course.run(turns * TURN / speed)
    gap, force = 0.0, np.inf
    for phase in course.phases:
        count = 50 + int((phase.end - phase.begin) * speed / TURN * samples)
        times = np.linspace(phase.begin, phase.end, count)
        states = phase_states(course, phase, times)
        gap = min(gap, float((states[0] - law(speed * times)).min()))
        if phase.flight is None and phase.end > phase.begin:
            force = min(force, float(states[4][1:-1].min()))
    return len(course.events), gap, force


def one_mass(law, p, rpm, turns, samples):
    """The same of one mass."""
    speed = rpm * RPM
    course = OneMassTrajectory(law, p, Interval(0, round(turns * TURN / speed * 1e9), 0.0, speed))
    course.run(None)
    gap, force = 0.0, np.inf
    for phase in course.phases:
        count = 50 + int((phase.end - phase.begin) * speed / TURN * samples)
        times = np.linspace(phase.begin, phase.end, count)
        if phase.flight is not None:
            place = phase.flight.motion(times - phase.begin)[0]
            gap = min(gap, float((place - law(speed * times)).min()))
        elif phase.end > phase.begin:
            states = (state_at(law, p, speed * t, speed) for t in times[1:-1:10])
            force = min([force, *(state.contact_force for state in states)])
    return len(course.events), gap, force


MORE_NOISE = [
    pytest.param(run, replace(p, restitution=e), amplitude, seed, 2, marks=pytest.mark.long)
    for (run, p), e in itertools.product(((two_masses, TWO), (one_mass, ONE)), (0.0, 0.5))
    for amplitude, seed in itertools.product((5e-6, 2e-7), range(6))
]


@pytest.mark.parametrize(
    ("run", "p", "amplitude", "seed", "turns"),
    [(two_masses, TWO, 5e-6, 0, 1), (one_mass, ONE, 5e-6, 1, 1), *MORE_NOISE],
)
def test_a_measured_law_with_noise(laws, run, p, amplitude, seed, turns):
    """1440 pieces and 5 µm of noise: the follower is never in the cam, nor is it pulled at."""
    law = noisy(laws["poly345"], 1440, amplitude, seed)
    events, gap, force = run(law, p, 450.0, turns, 20_000)
    assert events > 50 or amplitude < 1e-6
    assert gap > -1e-14
    assert force > -1e-6


@pytest.mark.parametrize("apart", [24.0, pytest.param(0.75, marks=pytest.mark.long)])
@pytest.mark.parametrize(("run", "p"), [(two_masses, TWO), (one_mass, ONE)])
def test_a_narrow_bump_is_not_passed_through(laws, run, p, apart):
    """0.3° wide and 1 mm high, under a flying follower or a riding one: it is met."""
    for degrees in np.arange(0.7, 359.8, apart):
        law = bumped(laws["poly345"], np.radians(degrees), np.radians(0.3), 1e-3)
        events, gap, force = run(law, p, 480.0, 1, 20_000)
        assert events > 1
        assert gap > -1e-14, degrees
        assert force > -1e-6, degrees


# A roller is never below the cam, however it came there and however time is cut.

PAPER = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6, 0.5)
MASS = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8, 0.0)


def lowest_gap(law, p, speed, acceleration, milliseconds, total=400, model="two_mass"):
    """The lowest gap (m) and the number of events of a ramp from ``speed`` (rad/s) on."""
    whole = Interval(0, total * MS, 0.0, speed, acceleration)
    rows, events, _ = ticked(law, model, p, whole, every(milliseconds * MS, total * MS))
    angle = speed * rows[0] + 0.5 * acceleration * rows[0] ** 2
    return (rows[1] - law(angle)).min(), len(events)


RAMPS = list(itertools.product(("poly345", "tm21"), (0.0, 0.5), (2.0, 30.0), (1, 7)))
#: One of 1 ms, which take a second each, and three of 7 ms.
QUICK = [("poly345", 0.5, 30.0, 1), ("tm21", 0.0, 2.0, 7), ("tm21", 0.5, 30.0, 7)]
QUICK += [("poly345", 0.0, 2.0, 7)]


@pytest.mark.parametrize(
    ("cam", "restitution", "acceleration", "milliseconds"),
    [*QUICK, *(pytest.param(*ramp, marks=pytest.mark.long) for ramp in RAMPS if ramp not in QUICK)],
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


@pytest.mark.parametrize("milliseconds", [20, 3])
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

"""No landing and no lift-off is missed, however fine the law's detail: against a fine scan."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.two_mass.model import _phase_states
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.laws import Law, bernstein
from cam_rig.units import RPM, TURN

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
    low, high = middle - 0.5 * width, middle + 0.5 * width
    breaks, degree = sorted({*law.breaks.tolist(), low, middle, high}), max(6, law.degree)
    columns = []
    for a, b in itertools.pairwise(breaks):
        i = int(np.searchsorted(law.breaks, 0.5 * (a + b), side="right")) - 1
        ends = (np.array([a, b]) - law.breaks[i]) / law.spans[i]
        column = bernstein.restrict(law.ordinates[:, i], *np.clip(ends, 0.0, 1.0))
        column = bernstein.elevate(column, degree)
        if low <= a < b <= high:
            u = np.linspace(0.0, 1.0, degree + 1)
            x = (a + (b - a) * u - middle) / (0.5 * width)
            bump = height * (1.0 - x**2) ** 3
            column = column + np.linalg.solve(bernstein.basis(degree, u), bump)
        columns.append(column)
    ordinates = np.array(columns).T
    ordinates[-1] = np.roll(ordinates[0], -1)
    return Law("bumped", np.array(breaks), ordinates)


def two_masses(law, p, rpm, turns, samples):
    """Number of events, lowest gap (m), and lowest force in contact (N), by a fine scan."""
    speed = rpm * RPM
    course = Separation(law, p, speed)
    course.run(turns * TURN / speed)
    gap, force = 0.0, np.inf
    for phase in course.phases:
        count = 50 + int((phase.end - phase.begin) * speed / TURN * samples)
        times = np.linspace(phase.begin, phase.end, count)
        states = _phase_states(course, phase, times)
        gap = min(gap, float((states[0] - law(speed * times)).min()))
        if phase.contact and phase.end > phase.begin:
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
            gap = min(
                gap, float((phase.flight.state(times - phase.begin)[0] - law(speed * times)).min())
            )
        elif phase.end > phase.begin:
            force = min([force, *(course.on_cam(t).contact_force for t in times[1:-1:10])])
    return len(course.events), gap, force


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("run", "p"), [(two_masses, TWO), (one_mass, ONE)])
def test_a_measured_law_with_noise(laws, run, p, seed):
    """1440 pieces and 5 µm of noise: the follower is never in the cam, nor is it pulled at."""
    events, gap, force = run(noisy(laws["poly345"], 1440, 5e-6, seed), p, 450.0, 1, 20_000)
    assert events > 50
    assert gap > -1e-14
    assert force > -1e-6


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize(("run", "p"), [(two_masses, TWO), (one_mass, ONE)])
def test_more_noise(laws, run, p, seed, restitution):
    """The same for more of it, two turns, with and without restitution."""
    p = replace(p, restitution=restitution)
    for amplitude in (5e-6, 2e-7):
        law = noisy(laws["poly345"], 1440, amplitude, seed)
        _, gap, force = run(law, p, 450.0, 2, 100_000)
        assert gap > -1e-14
        assert force > -1e-6


def through_bumps(law, run, p, places):
    for degrees in places:
        events, gap, force = run(
            bumped(law, np.radians(degrees), np.radians(0.3), 1e-3), p, 480.0, 1, 20_000
        )
        assert events > 1
        assert gap > -1e-14, degrees
        assert force > -1e-6, degrees


@pytest.mark.parametrize(("run", "p"), [(two_masses, TWO), (one_mass, ONE)])
def test_a_narrow_bump_is_not_passed_through(laws, run, p):
    """0.3° wide and 1 mm high, under a flying follower or a riding one: it is met."""
    through_bumps(laws["poly345"], run, p, np.arange(0.7, 360.0, 15.0))


@pytest.mark.long
@pytest.mark.parametrize(("run", "p"), [(two_masses, TWO), (one_mass, ONE)])
def test_no_narrow_bump_is_passed_through(laws, run, p):
    """The same at 480 places."""
    through_bumps(laws["poly345"], run, p, np.arange(0.7, 360.0, 0.75))

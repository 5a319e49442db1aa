"""After a landing the stiff stem throws the roller up again and again, at 25 kHz."""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.speed import study as rig
from benchmark.speed import study as stored
from benchmark.speed.cases import CASES
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.units import TURN

STEM = TwoMassParameters(0.52, 0.78, 3.3e8, 4030.0, 8.642, 8.642, 12.753)
SPEED = 450.0 * np.pi / 30.0


@pytest.mark.parametrize("name", ["two_mass_soft", "two_mass_stem", "one_mass_arc"])
def test_events_are_those_of_fifty_digits(name):
    """All of them, in order, each to 1e-13 s; the motion between to 2e-12 of its largest.

    Not one of the bounces is lost or invented, though each begins where the last left off, and
    each hands on its error: sixty of them on the stem enlarge a rounding a hundred times, so that
    the last digit of its stiffness, or of the speed, is worth 1e-13 s. Where that weighs more, five
    times its weight is the limit: the processor chooses how sums are rounded.
    """
    case = CASES[name]()
    wanted, got = stored.read(case), rig.solve(case)
    assert [kind for kind, _ in got.events] == [kind for kind, _ in wanted.events]
    event_s, motion = last_digit(case, got)
    assert got.event_error(wanted) < max(1e-13, 5.0 * event_s)
    assert got.error(wanted) < max(2e-12, 5.0 * motion)


def last_digit(case, got):
    """What one in the last digit of a number does to event times (s) and to the motion."""
    name = "stem_stiffness" if hasattr(case.model, "stem_stiffness") else "stiffness"
    found = []
    for last in (-1e-15, 1e-15):
        model = replace(case.model, **{name: getattr(case.model, name) * (1.0 + last)})
        for nudged in (replace(case, model=model), replace(case, speed=case.speed * (1.0 + last))):
            other = rig.solve(nudged)
            found.append((other.event_error(got), other.error(got)))
    return np.max(found, axis=0)


@pytest.fixture(scope="module")
def course(laws):
    found = Separation(laws["poly345"], STEM, SPEED)
    found.run(TURN / SPEED)
    return found


def test_it_chatters(course):
    """Flights shorter than a period of the roller on its stem follow the first landing closely.

    √(k₁/m₁) gives 0.25 ms a period.
    """
    period = TURN / np.sqrt(STEM.stem_stiffness / STEM.roller_mass)
    flights = np.array([p.end - p.begin for p in course.phases if not p.contact])
    assert (flights < period).sum() > 8
    assert flights.max() > 4.0 * period
    kinds = [event.kind for event in course.events]
    assert kinds[::2] == ["lift-off"] * len(kinds[::2])
    assert kinds[1::2] == ["landing"] * len(kinds[1::2])


def test_it_dies_out(course):
    """Each landing burns energy, plastic as it is, and at the end of the turn the roller sits."""
    landings = [event for event in course.events if event.kind == "landing"]
    assert all(event.energy_lost > 0.0 for event in landings)
    assert all(event.impulse > 0.0 for event in landings)
    assert course.ends_in_contact
    assert course.phases[-1].end - course.phases[-1].begin > 0.05 * TURN / SPEED


def test_the_force_stays_positive_between(course):
    """In contact the cam pushes, in each of the phases, however short."""
    for phase in course.phases:
        if phase.contact and phase.end > phase.begin:
            inside = np.linspace(phase.begin, phase.end, 40)[1:-1]
            response = course._response
            angle = course.angle + course.speed * phase.begin
            state = response.states(phase.vibration, angle, inside - phase.begin)
            assert course.force(state, inside).min() > -1e-6  # N; 1e-15 m on this stem


def test_without_damping_it_ends_too(laws):
    """Nothing but plastic landings takes energy away, and they are finitely many."""
    undamped = replace(STEM, stem_damping=0.0, damping=0.0)
    found = Separation(laws["poly345"], undamped, SPEED)
    found.run(TURN / SPEED)
    assert 10 < len(found.events) < 5000
    assert found.phases[-1].end == TURN / SPEED

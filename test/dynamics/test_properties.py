"""Random laws and parameters against closed forms in 60 digits.

A law is a piecewise polynomial with continuous slope (sometimes also curvature) that starts at rest
at zero lift. The parameters cover the range of real rigs.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

from benchmark.speed import exact
from benchmark.speed import study as rig
from benchmark.speed.models import (
    CONTACT,
    LANDING,
    LIFT_OFF,
    Case,
    OneMass,
    Oscillator,
    Twist,
    TwoMasses,
)
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.laws import Law
from cam_rig.units import RPM, TURN

from .helpers import turned

FEW, FEWER = (settings.default.max_examples // n for n in (7, 13))
EXAMPLES = settings(
    max_examples=FEW,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)


def between(low, high):
    """Return a strategy of numbers from `low` to `high`, uniform in the logarithm."""
    return st.floats(np.log10(low), np.log10(high)).map(lambda x: float(10.0**x))


maybe = st.one_of(st.just(0.0), between(0.1, 100.0))


LIFTS, DEGREES = between(1e-3, 0.05), st.integers(4, 9)


@st.composite
def laws(draw, lifts=LIFTS, degrees=DEGREES):
    """Draw a periodic law of two to four Bézier segments, at rest at its ends."""
    count, degree, lift = draw(st.integers(2, 4)), draw(degrees), draw(lifts)
    unit = st.floats(0.0, 1.0)
    spans = np.array([draw(st.floats(0.5, 2.0)) for _ in range(count)])
    breaks = np.concatenate([[0.0], np.cumsum(spans)]) * (TURN / spans.sum())
    breaks[-1] = TURN
    levels = [0.0, *(draw(unit) for _ in range(count - 1)), 0.0]
    slopes = [0.0, *(2.0 * draw(unit) - 1.0 for _ in range(count - 1)), 0.0]
    curved = draw(st.booleans()) and degree > 4
    columns = []
    for i, span in enumerate(np.diff(breaks)):
        column = np.array([draw(unit) for _ in range(degree + 1)])
        column[0], column[-1] = levels[i], levels[i + 1]
        column[1] = levels[i] + slopes[i] * span / degree
        column[-2] = levels[i + 1] - slopes[i + 1] * span / degree
        if curved:  # C²: no curvature at the joints
            column[2] = 2.0 * column[1] - column[0]
            column[-3] = 2.0 * column[-2] - column[-1]
        columns.append(lift * column)
    law = Law("random", breaks, np.stack(columns, axis=1))
    assume(law.lift > 1e-4)
    return law


def case(law, model, speed, last=1.0, count=23):
    """Return a benchmark case with `count` output times.

    They cover a fraction `last` of one turn. `speed` is in rad/s.
    """
    times = (np.arange(count) + 0.5) / count * last * TURN / speed
    return Case("random", "random", law, model, speed, 1, 1, times)


@EXAMPLES
@given(
    law=laws(),
    speed=between(0.3, 300.0),
    mass=between(0.1, 10.0),
    damping=maybe,
    spring=between(1e2, 1e4),
    stem=between(1e4, 1e9),
)
def test_residual(law, speed, mass, damping, spring, stem):
    """The vibration of one mass on a stem with random parameters is exact to 1e-12.

    The phase of the vibration is 1 to 1e6 rad per turn.
    """
    problem = case(law, Oscillator(mass, damping, spring, stem), speed)
    assert rig.solve(problem).error(exact.solve(problem)) < 1e-12


def assert_same_events(problem, result, expected, tolerance, max_distance):
    """Assert that two solutions have the same lift-offs and landings.

    Each expected event has an event of its kind within `tolerance` (s). Further events, such as
    tiny bounces, are allowed within `max_distance` (s) of an expected event.
    """
    # An event at the end of the run may belong to the next turn and is not compared.
    end = problem.duration - max_distance
    all_times = np.array([t for _, t in expected.events])
    for kind in (LIFT_OFF, LANDING):
        expected_times = np.array([t for k, t in expected.events if k == kind and t < end])
        times = np.array([t for k, t in result.events if k == kind and t < end])
        if expected_times.size == 0:
            assert times.size == 0
            continue
        differences = np.abs(expected_times[:, None] - times[None, :])
        assert differences.min(axis=1).max() < tolerance
        assert np.abs(times[:, None] - all_times).min(axis=1).max() < max_distance


@EXAMPLES
@given(
    law=laws(),
    speed=between(3.0, 100.0),
    mass=between(0.1, 10.0),
    damping=maybe,
    spring=between(1e2, 1e4),
    preload=between(1.0, 300.0),
    restitution=st.sampled_from([0.0, 0.0, 0.3, 0.8]),
)
def test_one_mass(law, speed, mass, damping, spring, preload, restitution):
    """The motion of one mass with random parameters is exact to 1e-11 of its size.

    Its lift-offs and landings are exact to 1e-11 of a turn. With rebounds the limits are 1e-9 and
    1e-6.
    """
    # A series of bounces ends with bounces of 1e-12 of the lift, whose times are exact only to
    # 1e-6.
    model = OneMass(mass, damping, spring, preload, restitution, 1e-12 * law.lift)
    problem = case(law, model, speed)
    result, expected = rig.solve(problem), exact.solve(problem)
    assert result.error(expected) < (1e-11 if restitution == 0.0 else 1e-9)
    tolerance = (1e-11 if restitution == 0.0 else 1e-6) * TURN / speed
    assert_same_events(problem, result, expected, tolerance, tolerance)


@EXAMPLES
@given(
    law=laws(),
    speed=between(20.0, 100.0),
    mass=between(0.3, 5.0),
    share=st.floats(0.1, 0.9),
    stem=between(1e4, 1e6),
    spring=between(1e3, 1e4),
    dampings=st.tuples(maybe, maybe),
    preload=between(1.0, 300.0),
)
def test_two_masses(law, speed, mass, share, stem, spring, dampings, preload):
    """The motion of two masses with random parameters is exact to 1e-10 of its size.

    Its lift-offs and landings are exact to 1e-8 s.
    """
    # A landing at 1e-6 m/s has a time error of 1e-14 m, the rounding of the gap, divided by this
    # speed.
    model = TwoMasses(mass * share, mass * (1.0 - share), stem, spring, *dampings, preload)
    problem = case(law, model, speed)
    result, expected = rig.solve(problem), exact.solve(problem)
    assert result.error(expected) < 1e-10
    assert_same_events(problem, result, expected, 1e-8, 1e-8)


@settings(EXAMPLES, max_examples=FEWER)
@given(
    law=laws(between(1e-3, 1e-2), st.integers(4, 6)),
    speed=between(15.0, 40.0),
    inertia=between(0.02, 0.1),
    shaft=between(3e3, 2e4),
    mass=between(0.3, 3.0),
    damping=maybe,
    preload=between(1.0, 100.0),
)
def test_torsional(law, speed, inertia, shaft, mass, damping, preload):
    """The twist of the torsional model is exact to 1e-11 of its peak.

    The parameters are random.
    """
    problem = case(law, Twist(inertia, shaft, mass, damping, 4030.0, preload), speed, last=0.4)
    expected = exact.solve_twist(problem)
    assume(1e-9 < np.abs(expected.displacement).max() < 0.05)
    assert rig.solve(problem).error(expected) < 1e-11


# -- every model from 0.01 rpm to 1e5 rpm, against 50 digits

SPEEDS = [0.01, 1.0, 400.0, 1e4, 1e5]
MASS, SPRING, DAMPING, PRELOAD = 1.3, 4030.0, 8.642, 30.6


@pytest.fixture
def digits(monkeypatch):
    """Use 140 digits in the reference, because powers of time lose 60 in a fast turn."""
    monkeypatch.setattr(exact, "DIGITS", 140)


@dataclass(frozen=True)
class Riding(TwoMasses):
    """Reference model of two masses that cannot leave the cam.

    It is used at low speeds, at which no contact is lost, to save the search for events.
    """

    def phases(self):
        return {CONTACT: replace(super().phases()[CONTACT], guard=None, on_cam=False)}


@pytest.mark.usefixtures("digits")
@pytest.mark.variants(5)  # each speed with one cam
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
@pytest.mark.parametrize("rpm", SPEEDS)
def test_a_stem_at_any_speed(laws, cam, rpm):
    """The motion of one mass on a stem is exact to 1e-12 of the lift at any cam speed.

    The speeds are 0.01 to 1e5 rpm.
    """
    # The slowest turn has 1e7 periods of the stem, and the fastest turn a hundredth of a period.
    problem = case(laws[cam], Oscillator(MASS, DAMPING, SPRING, 1.26e6), rpm * RPM)
    result, expected, lift = rig.solve(problem), exact.solve(problem), problem.law.lift
    assert np.abs(result.displacement - expected.displacement).max() < 1e-12 * lift
    peak = max(problem.speed * lift, np.abs(expected.velocity).max())
    assert np.abs(result.velocity - expected.velocity).max() < 1e-12 * peak


@pytest.mark.usefixtures("digits")
@pytest.mark.variants(10)
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
@pytest.mark.parametrize("rpm", SPEEDS)
@pytest.mark.parametrize(("masses", "limit"), [(1, 1e-12), (2, 1e-11)])
def test_masses_at_any_speed(laws, cam, rpm, masses, limit):
    """One and two masses are exact to 1e-12 at speeds from 0.01 to 1e5 rpm.

    From 1e4 rpm on there are lift-offs and landings, exact to 1e-12 (one mass) or 1e-11 (two
    masses) of a turn.
    """
    model = judge = OneMass(MASS, DAMPING, SPRING, PRELOAD, 0.0, 1e-12 * laws[cam].lift)
    if masses == 2:
        numbers = 0.4 * MASS, 0.6 * MASS, 1e5, SPRING, DAMPING, DAMPING, PRELOAD
        model, judge = TwoMasses(*numbers), (Riding if rpm <= 1.0 else TwoMasses)(*numbers)
    problem, judged = (case(laws[cam], each, rpm * RPM) for each in (model, judge))
    result, expected = rig.solve(problem), exact.solve(judged)
    assert result.error(expected) < 1e-12
    assert [kind for kind, _ in result.events] == [kind for kind, _ in expected.events]
    if rpm >= 1e4:
        assert result.events
        assert result.event_error(expected) < limit * 60.0 / rpm


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("rpm", SPEEDS)
def test_a_shaft_at_any_speed(laws, many_digits, rpm, monkeypatch):
    """The twist of an elastic shaft is exact to 1e-11 of its peak at any cam speed.

    The speeds are 0.01 to 1e5 rpm.
    """
    # At low speeds the run has a few periods of the shaft, otherwise one turn. The lift decreases
    # with the speed, because no shaft can move 50 mm at 1e5 rpm. The steps of the reference are at
    # most 1/200 turn, because its series does not converge for longer steps.
    period = TURN / np.sqrt(1e4 / 0.02)
    monkeypatch.setattr(exact, "STEPS", max(5, int(200 * period * rpm / 60.0)))
    law = turned(laws["poly345"], np.radians(90.0), min(1.0, 400.0 / rpm))
    problem = case(law, Twist(0.02, 1e4, MASS, DAMPING, SPRING, PRELOAD), rpm * RPM)
    times = problem.times
    last = min(float(times[-1]), 0.05)
    times = times / times[-1] * last
    follower = FollowerParameters(MASS, SPRING, DAMPING, PRELOAD, 3.3e8)
    start = TorsionalState(0.0, 0.0, 0.0, problem.speed)
    motion = solve(law, TorsionalParameters(follower, 0.02, 1e4), start, 0.0, last)
    expected = many_digits.solution(replace(problem, times=times), exact.solve_twist)
    rows = expected.displacement[0], expected.velocity[0]
    for row, exact_row in zip(motion.at(times)[:2], rows, strict=True):
        np.testing.assert_allclose(row, exact_row, rtol=0, atol=1e-11 * np.abs(exact_row).max())

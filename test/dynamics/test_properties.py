"""Random laws and random numbers against closed forms in 60 digits.

A law is any piecewise polynomial that joins with one slope (sometimes with one curvature) and
begins at rest at zero; its numbers span what a rig can be built with.
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
    """Numbers spread evenly over the orders from ``low`` to ``high``."""
    return st.floats(np.log10(low), np.log10(high)).map(lambda x: float(10.0**x))


maybe = st.one_of(st.just(0.0), between(0.1, 100.0))


LIFTS, DEGREES = between(1e-3, 0.05), st.integers(4, 9)


@st.composite
def laws(draw, lifts=LIFTS, degrees=DEGREES):
    """A periodic law of two to four Bézier pieces that begins and ends at rest at zero."""
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
        if curved:  # no curvature at the joints: C²
            column[2] = 2.0 * column[1] - column[0]
            column[-3] = 2.0 * column[-2] - column[-1]
        columns.append(lift * column)
    law = Law("random", breaks, np.stack(columns, axis=1))
    assume(law.lift > 1e-4)
    return law


def case(law, model, speed, last=1.0, count=23):
    """Output times on a part ``last`` of one turn."""
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
    """One linear equation, from 1 to 1e6 rad of free vibration a turn: to 1e-12."""
    problem = case(law, Oscillator(mass, damping, spring, stem), speed)
    assert rig.solve(problem).error(exact.solve(problem)) < 1e-12


def events_agree(problem, got, wanted, tolerance, least):
    """Each true event is found; what is found besides stands beside a true one."""
    # One at the very end of the run may as well be the next turn's first, and does not count.
    end = problem.duration - least
    every = np.array([t for _, t in wanted.events])
    for kind in (LIFT_OFF, LANDING):
        true = np.array([t for k, t in wanted.events if k == kind and t < end])
        found = np.array([t for k, t in got.events if k == kind and t < end])
        if true.size == 0:
            assert found.size == 0
            continue
        apart = np.abs(true[:, None] - found[None, :])
        assert apart.min(axis=1).max() < tolerance
        assert np.abs(found[:, None] - every).min(axis=1).max() < least


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
    """Rides, leaves, flies and lands: motion to 1e-11, plastic events to 1e-11 of a turn."""
    # A series of bounces ends in jumps of 1e-12 of the lift, whose times are known to 1e-6 of it.
    model = OneMass(mass, damping, spring, preload, restitution, 1e-12 * law.lift)
    problem = case(law, model, speed)
    got, wanted = rig.solve(problem), exact.solve(problem)
    assert got.error(wanted) < (1e-11 if restitution == 0.0 else 1e-9)
    tolerance = (1e-11 if restitution == 0.0 else 1e-6) * TURN / speed
    events_agree(problem, got, wanted, tolerance, tolerance)


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
    """Contact, flight and plastic landings of the roller: motion to 1e-10, events to 1e-8 s."""
    # A landing at 1e-6 m/s is known to 1e-14 m of the gap over that.
    model = TwoMasses(mass * share, mass * (1.0 - share), stem, spring, *dampings, preload)
    problem = case(law, model, speed)
    got, wanted = rig.solve(problem), exact.solve(problem)
    assert got.error(wanted) < 1e-10
    events_agree(problem, got, wanted, 1e-8, 1e-8)


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
    """Nonlinear in the twist, and solved to 1e-11 of its peak while that is small."""
    problem = case(law, Twist(inertia, shaft, mass, damping, 4030.0, preload), speed, last=0.4)
    wanted = exact.solve_twist(problem)
    assume(1e-9 < np.abs(wanted.displacement).max() < 0.05)
    assert rig.solve(problem).error(wanted) < 1e-11


# From 0.01 rpm to 1e5 rpm: ten million to one in speed, every model against 50 digits.

SPEEDS = [0.01, 1.0, 400.0, 1e4, 1e5]
MASS, SPRING, DAMPING, PRELOAD = 1.3, 4030.0, 8.642, 30.6


@pytest.fixture
def digits(monkeypatch):
    """The reference goes by powers of time; over a fast turn of degree 25 that costs 60 digits."""
    monkeypatch.setattr(exact, "DIGITS", 140)


@dataclass(frozen=True)
class Riding(TwoMasses):
    """Two masses that cannot leave the cam: at a crawl they do not, and nobody has to look."""

    def phases(self):
        return {CONTACT: replace(super().phases()[CONTACT], guard=None, on_cam=False)}


@pytest.mark.usefixtures("digits")
@pytest.mark.variants(5)  # each speed with one of both cams
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
@pytest.mark.parametrize("rpm", SPEEDS)
def test_a_stem_at_any_speed(laws, cam, rpm):
    """Quasi-static at one end, a follower that hardly moves at the other: 1e-12 of the lift."""
    # The slowest turn holds 1e7 periods of the stem, the fastest a hundredth of one.
    problem = case(laws[cam], Oscillator(MASS, DAMPING, SPRING, 1.26e6), rpm * RPM)
    got, wanted, lift = rig.solve(problem), exact.solve(problem), problem.law.lift
    assert np.abs(got.displacement - wanted.displacement).max() < 1e-12 * lift
    peak = max(problem.speed * lift, np.abs(wanted.velocity).max())
    assert np.abs(got.velocity - wanted.velocity).max() < 1e-12 * peak


@pytest.mark.usefixtures("digits")
@pytest.mark.variants(10)
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
@pytest.mark.parametrize("rpm", SPEEDS)
@pytest.mark.parametrize(("masses", "limit"), [(1, 1e-12), (2, 1e-11)])
def test_masses_at_any_speed(laws, cam, rpm, masses, limit):
    """Motion to 1e-12 of the largest; at 1e4 rpm and more, events to 1e-11 of a turn or less."""
    model = judge = OneMass(MASS, DAMPING, SPRING, PRELOAD, 0.0, 1e-12 * laws[cam].lift)
    if masses == 2:
        numbers = 0.4 * MASS, 0.6 * MASS, 1e5, SPRING, DAMPING, DAMPING, PRELOAD
        model, judge = TwoMasses(*numbers), (Riding if rpm <= 1.0 else TwoMasses)(*numbers)
    problem, judged = (case(laws[cam], one, rpm * RPM) for one in (model, judge))
    got, wanted = rig.solve(problem), exact.solve(judged)
    assert got.error(wanted) < 1e-12
    assert [kind for kind, _ in got.events] == [kind for kind, _ in wanted.events]
    if rpm >= 1e4:
        assert got.events
        assert got.event_error(wanted) < limit * 60.0 / rpm


@pytest.mark.usefixtures("digits")
@pytest.mark.parametrize("rpm", SPEEDS)
def test_a_shaft_at_any_speed(laws, many_digits, rpm, monkeypatch):
    """The cam is started in the middle of its rise, so that the shaft swings at any speed."""
    # At a crawl over a few periods of the shaft, else over a turn; 1e-11 of the peak twist. The
    # lift shrinks with the speed: no shaft carries 50 mm at 1e5 rpm. The reference's steps are
    # 1/200 turn at most, or its series does not end.
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
    wanted = many_digits.solution(replace(problem, times=times), exact.solve_twist)
    rows = wanted.displacement[0], wanted.velocity[0]
    for row, exact_row in zip(motion.at(times)[:2], rows, strict=True):
        np.testing.assert_allclose(row, exact_row, rtol=0, atol=1e-11 * np.abs(exact_row).max())

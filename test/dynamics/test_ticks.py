"""Where a run is cut into intervals, and how many turns came before, leaves no trace in it."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cam_rig.dynamics import (
    MODELS,
    FollowerParameters,
    FollowerState,
    Interval,
    TwoMassParameters,
    wrap,
)
from cam_rig.dynamics.two_mass import Separation
from cam_rig.errors import DynamicsError
from cam_rig.units import NS, RPM, TURN

from .helpers import MS, run_in_ticks, tick_borders

#: A prime rate: no sample falls on an event, where rounding would choose its side.
TOTAL, RATE = 400 * MS, 12_007
CAMS = ("poly345", "tm21")
CASES = {
    "kinetostatic": ("kinetostatic", 400.0, {}),
    "elastic_stem": ("elastic_stem", 400.0, {}),
    "elastic_stem, undamped": ("elastic_stem", 400.0, {"damping": 0.0, "stem_stiffness": 1e10}),
    "torsional": ("torsional", 350.0, {}),
    "torsional, free flywheel": ("torsional", 350.0, {"flywheel_inertia": 0.05}),
    "one mass, flying": ("one_mass", 600.0, {}),
    "one mass, bouncing": ("one_mass", 600.0, {"restitution": 0.5}),
    "two_mass": ("two_mass", 450.0, {}),
    "two_mass, bouncing": ("two_mass", 450.0, {"restitution": 0.3}),
    "two_mass, chattering": ("two_mass", 450.0, {"stem_stiffness": 3.3e8, "preload": 12.753}),
}
#: Bounces down to 1e-12 of the lift: the last landings of a series are as exact as a gap can be.
LIMITS = {"one mass, bouncing": 1e-9}
#: Here 1e-16 of the preload decides whether there are 49 or 73 events: no two runs can agree.
CHAOTIC = {("tm21", "two_mass, chattering")}
#: Each case on one of both cams; the other pairs are `long`.
PAIRS = [
    pytest.param(cam, name, marks=[] if i % 2 == on else pytest.mark.long)
    for i, name in enumerate(CASES)
    for on, cam in enumerate(CAMS)
    if (cam, name) not in CHAOTIC
]


def sensitivity(law, model, parameters, interval, whole):
    """What the last digit of a number does to each row at most: no tick can be better than that."""
    follower = getattr(parameters, "follower", parameters)
    largest = np.zeros(whole.shape[0])
    for name, last in itertools.product(("preload", "stem_stiffness"), (-1e-15, 1e-15)):
        nudged = replace(follower, **{name: getattr(follower, name) * (1.0 + last)})
        if follower is not parameters:
            nudged = replace(parameters, follower=nudged)
        rows = run_in_ticks(law, model, nudged, interval, [0, TOTAL], RATE)[0]
        largest = np.maximum(largest, np.abs(rows - whole).max(axis=1))
    return largest


def felt(events):
    """Landings of a thousandth of the heaviest and more: the last of a series are rounding."""
    heaviest = max((event.impulse for event in events), default=0.0)
    return [event for event in events if event.impulse > 1e-3 * heaviest]


@pytest.mark.parametrize(("cam", "name"), PAIRS)
def test_the_tick_does_not_enter(laws, paper_rig, cam, name):
    """Ticks of 1 and 200 ms: rows to 1e-10 of each row's size, the same landings at the same times.

    Bounces on a stiff stem hand on and enlarge what is rounded, by a thousand times and more, and
    the processor chooses how sums are rounded: where the last digit of the preload or of the
    stem weighs more than 1e-10, ten times its weight is the limit.
    """
    model, rpm, changes = CASES[name]
    law, parameters = laws[cam], replace(MODELS[model].parameters(paper_rig), **changes)
    interval = Interval(0, TOTAL, 0.0, rpm * RPM)
    whole, events, last = run_in_ticks(law, model, parameters, interval, [0, TOTAL], RATE)
    limit = LIMITS.get(name, 1e-10) * np.abs(whole).max(axis=1)
    limit += 10.0 * sensitivity(law, model, parameters, interval, whole)
    for tick in (MS, 200 * MS):
        cuts = tick_borders(tick, TOTAL)
        rows, found, state = run_in_ticks(law, model, parameters, interval, cuts, RATE)
        assert (np.abs(rows - whole).max(axis=1)[:5] <= limit[:5]).all()
        for one, other in zip(felt(found), felt(events), strict=True):
            assert one.time == pytest.approx(other.time, abs=1e-10)
            assert one.impulse == pytest.approx(other.impulse, rel=1e-5)
        assert state.in_contact == last.in_contact
        assert abs(state.displacement - last.displacement) <= limit[1]


# Flights of seeded rigs of every damping.


def test_critical_damping_is_nothing_special(laws):
    """An end mass on a closing spring damped critically flies as one damped by a hair more or less.

    Its matrix has one shape for two modes, and a weak spring would rest far away.
    """
    for spring in (4030.0, 4.0, 1.0, 0.04):
        critical, times = 2.0 * np.sqrt(spring * 1.3), []
        for part in (0.9999, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.0001):
            p = TwoMassParameters(0.39, 0.91, 1.26e6, spring, 8.642, part * critical, 30.0, 0.5)
            found = Separation(laws["poly345"], p, 400.0 * RPM)
            found.run(TURN / found.speed * 1.5)
            times.append([event.time for event in found.events])
        assert len({len(events) for events in times}) == 1
        assert len(times[0]) > 4
        for events in (times[1], times[3]):
            assert events == pytest.approx(times[2], abs=1e-6)


def test_a_force_that_begins_within_rounding(laws):
    """A soft stem whose force is zero to rounding where a phase begins: it is a root, or none."""
    mass, share, stem, spring = 1.3, 0.3, 37085.62382270041, 0.039389330736387895
    for critical in (spring * mass, spring * mass * 0.7, (stem + spring) * mass * 0.7):
        damping, preload = 2.0 * np.sqrt(critical), 0.2726594001662999
        masses = mass * share, mass * (1.0 - share)
        p = TwoMassParameters(*masses, stem, spring, 8.642, damping, preload, 0.5)
        found = Separation(laws["poly345"], p, 158.68626222807606 * RPM)
        found.run(2.0)
        times = [event.time for event in found.events]
        assert times == sorted(times)
        assert len(times) < 200


# The samples and events of one mass that jumps.

RPM_JUMPING = 600.0
TURN_NS = 60 * NS // 600
END = 4 * TURN_NS


def jumping(laws, p, cuts, rate=8000):
    """A run of the 3-4-5 cam between instants (ns)."""
    interval = Interval(0, cuts[-1], 0.0, RPM_JUMPING * RPM)
    return run_in_ticks(laws["poly345"], "one_mass", p, interval, cuts, rate)


@pytest.fixture(scope="module")
def whole(laws, follower):
    """Four turns of the jumping 3-4-5 cam in one interval."""
    return jumping(laws, follower, [0, END])


def test_intervals_shorter_than_a_sample(laws, follower, whole):
    """Intervals of 40 µs at 125 µs a sample: most have no sample, and nothing is lost."""
    first = whole.events[1].time + 0.01
    cuts = [0, *range(20 * MS, round(first * NS), 40_000)]
    cut = jumping(laws, follower, cuts)
    sizes = np.abs(whole.rows).max(axis=1, keepdims=True)
    assert len(cut.events) >= 2
    assert np.all(np.abs(cut.rows - whole.rows[:, : cut.rows.shape[1]]) <= 1e-9 * sizes)


@settings(max_examples=settings.default.max_examples // 4)
@given(
    inner=st.lists(st.integers(1, 2 * TURN_NS - 1), unique=True, max_size=12),
    restitution=st.sampled_from([0.0, 0.5]),
)
def test_each_impulse_shows_once(laws, follower, inner, restitution):
    """All impulses of the events stand in the blocks, or wait for the next block."""
    p, cuts = replace(follower, restitution=restitution), [0, *sorted(inner)]
    result = jumping(laws, p, [*cuts, 2 * TURN_NS], 1000)
    total = sum(event.impulse for event in result.events)
    assert total > 1.0
    shown = result.rows[5].sum() + result.state.pending_impulse
    assert shown == pytest.approx(total, rel=1e-12)


def test_events_and_impulses_are_in_order(whole):
    """Lift-off and landing take turns; each landing stands at the first sample at or after it."""
    kinds = [event.kind for event in whole.events]
    assert kinds[0] == "lift-off"
    assert all(a != b for a, b in itertools.pairwise(kinds))
    assert all(a.time <= b.time for a, b in itertools.pairwise(whole.events))
    expected = np.zeros(whole.rows.shape[1])
    for event in whole.events:
        expected[int(np.ceil(event.time * 8000))] += event.impulse
    np.testing.assert_allclose(whole.rows[5], expected, rtol=1e-14)


# The cam's whole turns are counted apart: late turns are like the first, to the last digit.

#: 480 rpm: a turn is 125 ms, a thousand turns are whole seconds, so the grid of samples is one.
PERIOD, SPEED = NS // 8, 480.0 * RPM
LATE = {
    "kinetostatic": ("kinetostatic", {}),
    "elastic_stem": ("elastic_stem", {}),
    "torsional": ("torsional", {}),
    "one_mass": ("one_mass", {"preload": 12.753}),
    "one_mass, bouncing": ("one_mass", {"preload": 12.753, "restitution": 0.4}),
    "two_mass": ("two_mass", {}),
    "two_mass, bouncing": ("two_mass", {"restitution": 0.3}),
}


def begun_late(law, model, p, total, tick, turns=0, acceleration=0.0):
    """Rows, events since the start, and last state, begun ``turns`` turns late."""
    start = turns * PERIOD
    late = Interval(start, start + total, 0.0, SPEED, acceleration, turns)
    rows, events, state = run_in_ticks(law, model, p, late, tick_borders(tick, total), RATE)
    rows[0] -= start / NS
    return rows, [(e.kind, e.time - start / NS, e.angle - turns * TURN, e) for e in events], state


def same(found, wanted, turns):
    """Events and samples to 1e-10 of each row's size; a late clock has few digits after its dot."""
    rows, events, state = found
    size, clock = np.abs(wanted[0]).max(axis=1), 1e-12 + np.spacing(turns * PERIOD / NS)
    assert (np.abs(rows - wanted[0])[1:].max(axis=1) <= 1e-10 * size[1:]).all()
    assert np.abs(rows[0] - wanted[0][0]).max() <= clock
    assert [kind for kind, *_ in events] == [kind for kind, *_ in wanted[1]]
    for one, other in zip(events, wanted[1], strict=True):
        assert one[1] == pytest.approx(other[1], abs=clock)
        assert one[2] == pytest.approx(other[2], abs=1e-10 + 2.0 * np.spacing(turns * TURN))
        impulse = 1e-10 * max(e.impulse for *_, e in wanted[1])
        assert one[3].impulse == pytest.approx(other[3].impulse, abs=impulse)
    assert state.in_contact == wanted[2].in_contact


def late(rig, name):
    model, changes = LATE[name]
    return model, replace(MODELS[model].parameters(rig), **changes)


@pytest.mark.parametrize("name", LATE)
def test_late_turns_are_like_the_first(laws, paper_rig, name):
    """Every model, ticks of 1, 7 and 50 ms and of a turn, begun after up to 1e7 turns; or on ramps.

    1e7 turns in one number leave 7e-9 rad of phase.
    """
    (model, p), total = late(paper_rig, name), 250 * MS
    acceleration = 40.0 * (name.endswith("bouncing") or name == "elastic_stem")
    wanted = begun_late(laws["poly345"], model, p, total, PERIOD, 0, acceleration)
    if model in ("one_mass", "two_mass"):
        assert len(wanted[1]) > 3
    for tick, turns in ((MS, 10_000_000), (50 * MS, 100_000), (PERIOD, 1_000)):
        found = begun_late(laws["poly345"], model, p, total, tick, turns, acceleration)
        same(found, wanted, turns)


def test_contact_is_kept_over_late_borders(laws):
    """300 rpm and 30 N: the force never falls to zero, so there is no event, after 1e4 turns too.

    So it is where the angle is one number, of which 1e-11 rad are rounding.
    """
    p, speed = FollowerParameters(1.3, 4030.0, 8.642, 30.0, 3.3e8), 300.0 * RPM
    for tick, apart in itertools.product((PERIOD // 3, PERIOD // 8, 10 * MS), (True, False)):
        state = None
        for i in range(60):
            a, b = i * tick, (i + 1) * tick
            angle = speed * a / NS + (0.0 if apart else 1e4 * TURN)
            part = Interval(a, b, angle, speed, 0.0, 10_000 * apart)
            state, block = MODELS["one_mass"].advance(laws["poly345"], p, state, part, 1000)
            assert block.events == ()
            assert block.rows[4].min() > 0.0


def test_an_angle_that_jumped_is_refused(laws, paper_rig):
    """What goes on from a state begins where that ended, to 2e-6 rad, whatever the turn."""
    law, reached = laws["poly345"], 1.0 + SPEED * 0.007
    for name, model in MODELS.items():
        p, advance = late(paper_rig, name)[1], model.advance
        state, _ = advance(law, p, None, Interval(0, 7 * MS, 1.0, SPEED), RATE)
        for off, turns in ((1e-6, 0), (-1e-6, 5), (0.0, 10**9)):
            on = Interval(7 * MS, 14 * MS, reached + off, SPEED, 0.0, turns)
            advance(law, p, state, on, RATE)
        for off in (0.5, -1e-5, np.pi):
            on = Interval(7 * MS, 14 * MS, reached + off, SPEED)
            told = rf"from {on.angle:.9g} rad on, .* ended at {reached:.9g} rad .*; allowed: 2e-06"
            with pytest.raises(DynamicsError, match=told):
                advance(law, p, state, on, RATE)
            advance(law, p, replace(state, cam_angle=None), on, RATE)  # nobody said where it ended


def test_a_turn_ends_where_the_next_begins(laws, paper_rig):
    """Just below 2π and at 0 of the next turn is one place."""
    p, law = late(paper_rig, "one_mass")[1], laws["poly345"]
    state = replace(FollowerState(0.0, 0.0, 10.0, True), cam_angle=TURN - 1e-13, cam_speed=SPEED)
    MODELS["one_mass"].advance(law, p, state, Interval(0, MS, 0.0, SPEED), RATE)
    assert wrap(-1e-17) == (0, 0.0)
    assert wrap(7.0 * TURN + 1.0, 5) == (12, pytest.approx(1.0, abs=1e-14))
    assert wrap(-1.0) == (-1, TURN - 1.0)
    for huge in (2.2495818320978993e18, -1e300, 1e16):
        assert 0.0 <= wrap(huge)[1] < TURN
    for turns, angle in ((3, 1.0), (-7, 0.5), (10_000_000, 6.2)):
        assert wrap(turns * TURN + angle) == (turns, pytest.approx(angle, abs=np.spacing(1e8)))

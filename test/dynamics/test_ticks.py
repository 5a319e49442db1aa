"""Tests that results depend neither on the ticks of a run nor on earlier turns.

A tick is one of the time intervals into which a run is divided.
"""

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

#: Duration of each tested run, ns.
TOTAL = 400 * MS
#: Sample rate, Hz. It is prime, so that no sample coincides with a lift-off or landing, where it
#: could have either value.
RATE = 12_007
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
#: Relative tolerances of the samples, if not 1e-10. Bounces continue down to 1e-12 of the lift,
#: where the rounding of the gap limits the accuracy of landing times.
LIMITS = {"one mass, bouncing": 1e-9}
#: Cases (cam, name) that are not compared, because they are chaotic: a relative change of the
#: preload by 1e-16 changes 49 lift-offs and landings to 73.
CHAOTIC = {("tm21", "two_mass, chattering")}
#: Cases to run: each name with one of the two cams. The other pairs are marked `long`.
PAIRS = [
    pytest.param(cam, name, marks=[] if i % 2 == on else pytest.mark.long)
    for i, name in enumerate(CASES)
    for on, cam in enumerate(CAMS)
    if (cam, name) not in CHAOTIC
]


def sensitivity(law, model, parameters, interval, whole):
    """Return the change of each sampled quantity by a last-digit change of an input.

    The inputs are the preload and the stem stiffness. Runs with different ticks (time intervals)
    cannot agree better than this.
    """
    follower = getattr(parameters, "follower", parameters)
    largest = np.zeros(whole.shape[0])
    for name, last in itertools.product(("preload", "stem_stiffness"), (-1e-15, 1e-15)):
        nudged = replace(follower, **{name: getattr(follower, name) * (1.0 + last)})
        if follower is not parameters:
            nudged = replace(parameters, follower=nudged)
        rows = run_in_ticks(law, model, nudged, interval, [0, TOTAL], RATE)[0]
        largest = np.maximum(largest, np.abs(rows - whole).max(axis=1))
    return largest


def strong_landings(events):
    """Return the landings whose impulse is above a thousandth of the largest impulse.

    The last landings of a series of bounces are at the level of rounding errors.
    """
    max_impulse = max((event.impulse for event in events), default=0.0)
    return [event for event in events if event.impulse > 1e-3 * max_impulse]


@pytest.mark.parametrize(("cam", "name"), PAIRS)
def test_the_duration_of_ticks_does_not_matter(laws, paper_rig, cam, name):
    """Ticks of 1 ms and 200 ms give the same samples to 1e-10, and the same landings.

    A tick is a time interval that is simulated in one call. Bounces on a stiff stem amplify
    rounding errors a thousand times and more, and rounding depends on the processor. Ten times the
    effect of a last-digit change of preload or stem stiffness is therefore added to the tolerance.
    """
    model, rpm, changes = CASES[name]
    law, parameters = laws[cam], replace(MODELS[model].parameters(paper_rig), **changes)
    interval = Interval(0, TOTAL, 0.0, rpm * RPM)
    whole, events, last = run_in_ticks(law, model, parameters, interval, [0, TOTAL], RATE)
    limit = LIMITS.get(name, 1e-10) * np.abs(whole).max(axis=1)
    limit += 10.0 * sensitivity(law, model, parameters, interval, whole)
    for tick in (MS, 200 * MS):
        cuts = tick_borders(tick, TOTAL)
        rows, cut_events, state = run_in_ticks(law, model, parameters, interval, cuts, RATE)
        assert (np.abs(rows - whole).max(axis=1)[:5] <= limit[:5]).all()
        pairs = zip(strong_landings(cut_events), strong_landings(events), strict=True)
        for event, other in pairs:
            assert event.time == pytest.approx(other.time, abs=1e-10)
            assert event.impulse == pytest.approx(other.impulse, rel=1e-5)
        assert state.in_contact == last.in_contact
        assert abs(state.displacement - last.displacement) <= limit[1]


# -- flights with special damping


def test_critical_damping_is_not_a_special_case(laws):
    """Lift-offs and landings at critical damping agree with those at similar damping.

    At critical damping two modes of the free masses coincide. The weak springs have a distant
    position of rest.
    """
    for spring in (4030.0, 4.0, 1.0, 0.04):
        critical, times = 2.0 * np.sqrt(spring * 1.3), []
        for part in (0.9999, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.0001):
            p = TwoMassParameters(0.39, 0.91, 1.26e6, spring, 8.642, part * critical, 30.0, 0.5)
            trajectory = Separation(laws["poly345"], p, 400.0 * RPM)
            trajectory.run(TURN / trajectory.speed * 1.5)
            times.append([event.time for event in trajectory.events])
        assert len({len(events) for events in times}) == 1
        assert len(times[0]) > 4
        for events in (times[1], times[3]):
            assert events == pytest.approx(times[2], abs=1e-6)


def test_a_force_of_zero_at_the_start_of_a_phase(laws):
    """A phase that starts with a force of zero does not cause endless events.

    A phase is a time in contact or in flight.
    """
    mass, share, stem, spring = 1.3, 0.3, 37085.62382270041, 0.039389330736387895
    for critical in (spring * mass, spring * mass * 0.7, (stem + spring) * mass * 0.7):
        damping, preload = 2.0 * np.sqrt(critical), 0.2726594001662999
        masses = mass * share, mass * (1.0 - share)
        p = TwoMassParameters(*masses, stem, spring, 8.642, damping, preload, 0.5)
        trajectory = Separation(laws["poly345"], p, 158.68626222807606 * RPM)
        trajectory.run(2.0)
        times = [event.time for event in trajectory.events]
        assert times == sorted(times)
        assert len(times) < 200


# -- samples and events of one mass that lifts off

RPM_JUMPING = 600.0
TURN_NS = 60 * NS // 600
END = 4 * TURN_NS


def jumping(laws, p, cuts, rate=8000):
    """Run one mass on the 3-4-5 cam at a speed with flights, in ticks.

    A tick is a time interval that is simulated in one call. `cuts` are the borders of the ticks in
    ns, and `rate` is the sample rate in Hz.
    """
    interval = Interval(0, cuts[-1], 0.0, RPM_JUMPING * RPM)
    return run_in_ticks(laws["poly345"], "one_mass", p, interval, cuts, rate)


@pytest.fixture(scope="module")
def whole(laws, follower):
    """Run of four turns with flights on the 3-4-5 cam in one interval."""
    return jumping(laws, follower, [0, END])


def test_intervals_shorter_than_a_sample(laws, follower, whole):
    """Ticks of 40 µs lose no sample and no event, although most contain no sample.

    A tick is a time interval that is simulated in one call.
    """
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
def test_each_impulse_appears_once(laws, follower, inner, restitution):
    """Each impulse of a landing is in the samples exactly once, for any ticks.

    A tick is a time interval that is simulated in one call. An impulse after its last sample is
    kept in the state for the next tick. The sum of the impulses is compared to 1e-12, relative.
    """
    p, cuts = replace(follower, restitution=restitution), [0, *sorted(inner)]
    result = jumping(laws, p, [*cuts, 2 * TURN_NS], 1000)
    total = sum(event.impulse for event in result.events)
    assert total > 1.0
    shown = result.rows[5].sum() + result.state.pending_impulse
    assert shown == pytest.approx(total, rel=1e-12)


def test_events_and_impulses_are_in_order(whole):
    """Events alternate, and each impulse is in the sample that follows it.

    Events are lift-offs and landings.
    """
    kinds = [event.kind for event in whole.events]
    assert kinds[0] == "lift-off"
    assert all(a != b for a, b in itertools.pairwise(kinds))
    assert all(a.time <= b.time for a, b in itertools.pairwise(whole.events))
    expected = np.zeros(whole.rows.shape[1])
    for event in whole.events:
        expected[int(np.ceil(event.time * 8000))] += event.impulse
    np.testing.assert_allclose(whole.rows[5], expected, rtol=1e-14)


# -- whole turns are counted separately, so that late turns are exact to the last digit

#: Speed of 480 rpm in rad/s. A thousand turns are whole seconds, so they have the same sample
#: times.
SPEED = 480.0 * RPM
#: Duration of a turn at 480 rpm, ns.
PERIOD = NS // 8
LATE = {
    "kinetostatic": ("kinetostatic", {}),
    "elastic_stem": ("elastic_stem", {}),
    "torsional": ("torsional", {}),
    "one_mass": ("one_mass", {"preload": 12.753}),
    "one_mass, bouncing": ("one_mass", {"preload": 12.753, "restitution": 0.4}),
    "two_mass": ("two_mass", {}),
    "two_mass, bouncing": ("two_mass", {"restitution": 0.3}),
}


def run_late(law, model, p, total, tick, turns=0, acceleration=0.0):
    """Run in ticks after `turns` turns, and return samples, events and last state.

    A tick is a time interval that is simulated in one call. Times and angles are relative to the
    start of the run. `total` and `tick` are in ns, the `acceleration` is in rad/s².
    """
    start = turns * PERIOD
    late = Interval(start, start + total, 0.0, SPEED, acceleration, turns)
    rows, events, state = run_in_ticks(law, model, p, late, tick_borders(tick, total), RATE)
    rows[0] -= start / NS
    return rows, [(e.kind, e.time - start / NS, e.angle - turns * TURN, e) for e in events], state


def assert_same_late(late_run, expected, turns):
    """Assert that a run after many turns equals an expected run, to 1e-10.

    Times are compared to the rounding of the clock after `turns` turns.
    """
    rows, events, state = late_run
    size, clock = np.abs(expected[0]).max(axis=1), 1e-12 + np.spacing(turns * PERIOD / NS)
    assert (np.abs(rows - expected[0])[1:].max(axis=1) <= 1e-10 * size[1:]).all()
    assert np.abs(rows[0] - expected[0][0]).max() <= clock
    assert [kind for kind, *_ in events] == [kind for kind, *_ in expected[1]]
    for event, other in zip(events, expected[1], strict=True):
        assert event[1] == pytest.approx(other[1], abs=clock)
        assert event[2] == pytest.approx(other[2], abs=1e-10 + 2.0 * np.spacing(turns * TURN))
        impulse = 1e-10 * max(e.impulse for *_, e in expected[1])
        assert event[3].impulse == pytest.approx(other[3].impulse, abs=impulse)
    assert state.in_contact == expected[2].in_contact


def late_case(rig, name):
    """Return model name and parameters of the case `name` of the dict `LATE`."""
    model, changes = LATE[name]
    return model, replace(MODELS[model].parameters(rig), **changes)


@pytest.mark.parametrize("name", LATE)
def test_late_turns_equal_the_first(laws, paper_rig, name):
    """A run after 1e3 to 1e7 earlier turns equals a run from the start, to 1e-10.

    The angle after 1e7 turns in one float would have a rounding error of 7e-9 rad, so turns are
    counted separately.
    """
    (model, p), total = late_case(paper_rig, name), 250 * MS
    acceleration = 40.0 * (name.endswith("bouncing") or name == "elastic_stem")
    expected = run_late(laws["poly345"], model, p, total, PERIOD, 0, acceleration)
    if model in ("one_mass", "two_mass"):
        assert len(expected[1]) > 3
    for tick, turns in ((MS, 10_000_000), (50 * MS, 100_000), (PERIOD, 1_000)):
        late_run = run_late(laws["poly345"], model, p, total, tick, turns, acceleration)
        assert_same_late(late_run, expected, turns)


def test_contact_continues_over_late_borders(laws):
    """After 1e4 turns the borders between ticks cause no events in contact.

    A tick is a time interval that is simulated in one call. This is also true if angle and turns
    are one float with a rounding error of 1e-11 rad.
    """
    p, speed = FollowerParameters(1.3, 4030.0, 8.642, 30.0, 3.3e8), 300.0 * RPM
    for tick, separate in itertools.product((PERIOD // 3, PERIOD // 8, 10 * MS), (True, False)):
        state = None
        for i in range(60):
            a, b = i * tick, (i + 1) * tick
            angle = speed * a / NS + (0.0 if separate else 1e4 * TURN)
            part = Interval(a, b, angle, speed, 0.0, 10_000 * separate)
            state, block = MODELS["one_mass"].advance(laws["poly345"], p, state, part, 1000)
            assert block.events == ()
            assert block.rows[4].min() > 0.0


def test_an_interval_must_start_at_the_angle_of_the_state(laws, paper_rig):
    """A simulated time interval must start at the cam angle of the last state.

    The tolerance is 2e-6 rad, in any turn.
    """
    law, end = laws["poly345"], 1.0 + SPEED * 0.007
    for name, model in MODELS.items():
        p, advance = late_case(paper_rig, name)[1], model.advance
        state, _ = advance(law, p, None, Interval(0, 7 * MS, 1.0, SPEED), RATE)
        for offset, turns in ((1e-6, 0), (-1e-6, 5), (0.0, 10**9)):
            following = Interval(7 * MS, 14 * MS, end + offset, SPEED, 0.0, turns)
            advance(law, p, state, following, RATE)
        for offset in (0.5, -1e-5, np.pi):
            following = Interval(7 * MS, 14 * MS, end + offset, SPEED)
            message = (
                rf"from {following.angle:.9g} rad on, .* ended at {end:.9g} rad .*; allowed: 2e-06"
            )
            with pytest.raises(DynamicsError, match=message):
                advance(law, p, state, following, RATE)
            # A state without a cam angle is not compared.
            advance(law, p, replace(state, cam_angle=None), following, RATE)


def test_the_end_of_a_turn_is_the_start_of_the_next(laws, paper_rig):
    """An angle just below 2π equals angle 0 of the next turn."""
    p, law = late_case(paper_rig, "one_mass")[1], laws["poly345"]
    state = replace(FollowerState(0.0, 0.0, 10.0, True), cam_angle=TURN - 1e-13, cam_speed=SPEED)
    MODELS["one_mass"].advance(law, p, state, Interval(0, MS, 0.0, SPEED), RATE)
    assert wrap(-1e-17) == (0, 0.0)
    assert wrap(7.0 * TURN + 1.0, 5) == (12, pytest.approx(1.0, abs=1e-14))
    assert wrap(-1.0) == (-1, TURN - 1.0)
    for huge in (2.2495818320978993e18, -1e300, 1e16):
        assert 0.0 <= wrap(huge)[1] < TURN
    for turns, angle in ((3, 1.0), (-7, 0.5), (10_000_000, 6.2)):
        assert wrap(turns * TURN + angle) == (turns, pytest.approx(angle, abs=np.spacing(1e8)))

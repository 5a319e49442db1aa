"""One mass on the cam: rides, leaves where it would have to be pulled, lands with a blow."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, one_mass
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.units import NS, TURN

JUMPING = 600.0  # rpm, above the jump speed of every 50 mm cam


def speed_of(rpm):
    return rpm * np.pi / 30.0


@pytest.fixture(params=["poly345", "bezier15", "cycloidal"])
def course(request, laws, follower):
    """Three turns at a speed at which the follower jumps."""
    c = OneMassTrajectory(
        laws[request.param], follower, Interval(0, 3 * NS // 10, 0.0, speed_of(JUMPING))
    )
    c.run(None)
    return c


def test_rides_at_200_rpm(laws, follower, run):
    """Below the jump speed nothing happens: the samples are those of the kinetostatic model."""
    cuts = [0, NS // 5, NS]
    ridden = run(laws["poly345"], follower, 200.0, cuts)
    expected = run(laws["poly345"], follower, 200.0, cuts, model="kinetostatic")
    assert ridden.events == []
    np.testing.assert_array_equal(ridden.rows, expected.rows)
    assert ridden.state == expected.state


def test_leaves_where_the_force_is_zero(laws, follower, run):
    """The first lift-off is the first zero of m ω² s'' + c ω s' + k s + preload."""
    law, p, w = laws["poly345"], follower, speed_of(JUMPING)

    def force(angle):
        s, ds, dds = (float(law(angle, k)) for k in range(3))
        return p.mass * w**2 * dds + p.damping * w * ds + p.spring_stiffness * s + p.preload

    # on the rise's second half, between its middle and its end
    middle = np.radians(31.25 + 117.5 / 2)
    root = brentq(force, middle, np.radians(115.0), xtol=1e-15)
    first = run(law, p, JUMPING, [0, NS // 10]).events[0]
    assert first.kind == "lift-off"
    assert first.angle == pytest.approx(root, abs=1e-12)
    assert first.time == pytest.approx(root / w, rel=1e-12)
    assert first.impulse == first.energy_lost == 0.0


def test_flights_end_on_the_cam(course):
    """Where a flight ends the gap is zero, and before that the follower is above the cam."""
    w, law = course.interval.speed, course.law
    flights = [phase for phase in course.phases if phase.flight is not None]
    assert len(flights) >= 3
    for phase in flights[:-1]:
        times = np.linspace(phase.begin, phase.end, 400)
        gap = phase.flight.state(times - phase.begin)[0] - law(w * times)
        assert gap.min() > -1e-14  # 16 roundings of lift and of angle times slope
        assert gap[1:-1].max() > 1e-6  # it is a flight, not a graze
        assert abs(gap[-1]) < 1e-14


def test_phases_tile_the_interval(course):
    """Contact and flight follow each other without a hole."""
    ends = [phase.end for phase in course.phases]
    assert [phase.begin for phase in course.phases] == [0.0, *ends[:-1]]
    assert ends[-1] == course.interval.duration


def test_contact_never_pulls(course):
    """While the follower rides, the contact force is not negative."""
    for phase in course.phases:
        if phase.flight is None:
            forces = [course.on_cam(t).contact_force for t in np.linspace(phase.begin, phase.end)]
            assert min(forces) > -1e-8  # slope of the force (1e5 N/s) times rounding of time


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_impulse_is_the_change_of_momentum(laws, follower, restitution):
    """J = m Δv over a landing, and the energy lost is that of the two masses in one."""
    p = dataclasses.replace(follower, restitution=restitution)
    course = OneMassTrajectory(laws["poly345"], p, Interval(0, NS // 5, 0.0, speed_of(JUMPING)))
    course.run(None)
    landings = [event for event in course.events if event.kind == "landing"]
    flights = {phase.end: phase for phase in course.phases if phase.flight is not None}
    after = {phase.begin: phase for phase in course.phases}
    assert landings
    for event in landings:
        phase = flights[event.time]
        before = float(phase.flight.state(np.array([phase.end - phase.begin]))[1][0])
        cam = course.on_cam(event.time).velocity
        following = after[event.time].flight
        later = cam if following is None else float(following.start[1])
        assert event.impulse == pytest.approx(p.mass * (later - before), rel=1e-9)
        lost = 0.5 * p.mass * ((before - cam) ** 2 - (later - cam) ** 2)
        assert event.energy_lost == pytest.approx(lost, rel=1e-9)


def test_flight_samples(laws, follower, run):
    """In the air the contact force is zero and m a + c v + k y + preload = 0."""
    p: FollowerParameters = follower
    rows = run(laws["poly345"], p, JUMPING, [0, NS // 5]).rows
    air = rows[4] == 0.0
    assert 50 < air.sum() < rows.shape[1] - 50
    _, y, v, a = rows[:4, air]
    balance = p.mass * a + p.damping * v + p.spring_stiffness * y + p.preload
    np.testing.assert_allclose(balance, 0.0, atol=1e-12 * p.mass * np.abs(a).max())
    cam = laws["poly345"](speed_of(JUMPING) * rows[0])
    assert np.all(rows[1] - cam > -1e-14)
    np.testing.assert_allclose(rows[1, ~air], cam[~air], rtol=0, atol=1e-14)


def test_first_flight_repeats_each_turn(course):
    """The follower is back on the cam in the dwell, so each turn has the same lift-offs."""
    angles = [event.angle for event in course.events if event.kind == "lift-off"]
    turns = [sorted(a - n * TURN for a in angles if n * TURN <= a < (n + 1) * TURN) for n in (1, 2)]
    assert turns[0] == pytest.approx(turns[1], abs=1e-11)


# A change of speed between intervals: the cam's velocity jumps, the follower's not.

MS = NS // 1000
RISING, FALLING = np.radians(90.0), np.radians(270.0)  # middles of the 3-4-5 rise and fall
TEN_MS = NS // 100


def slow_and_fast():
    return 50.0 * np.pi / 30.0, 150.0 * np.pi / 30.0


@pytest.fixture
def step(laws, follower):
    """Ride to an angle at one speed, then go on from there at another."""

    def go(angle, before, after):
        law = laws["poly345"]
        ride = Interval(0, TEN_MS, angle - before * 0.01, before)
        state, block = one_mass.advance(law, follower, None, ride, 8000)
        assert block.events == ()
        go_on = Interval(TEN_MS, 2 * TEN_MS, angle, after)
        jump = float(law(angle, 1)) * (after - before)  # of the cam's surface, m/s
        return jump, state, *one_mass.advance(law, follower, state, go_on, 8000)

    return go


@pytest.mark.parametrize(("angle", "faster"), [(RISING, False), (FALLING, True)])
def test_thrown_off(step, angle, faster):
    """Braking on the rise, or speeding up on the fall, leaves the follower in the air."""
    slow, fast = slow_and_fast()
    before, after = (slow, fast) if faster else (fast, slow)
    jump, state, _, block = step(angle, before, after)
    assert jump < 0.0
    first = block.events[0]
    assert (first.kind, first.time) == ("lift-off", pytest.approx(0.01, abs=1e-15))
    assert first.angle == pytest.approx(angle, abs=1e-15)
    # it flies on with the velocity it had
    assert block.rows[2, 0] == pytest.approx(state.velocity, rel=1e-9)
    assert block.rows[4, 0] == 0.0


@pytest.mark.parametrize(("angle", "faster"), [(RISING, True), (FALLING, False)])
def test_struck(step, follower, angle, faster):
    """Speeding up on the rise, or braking on the fall, strikes the follower: J = m Δv."""
    slow, fast = slow_and_fast()
    before, after = (slow, fast) if faster else (fast, slow)
    jump, _, _, block = step(angle, before, after)
    assert jump > 0.0
    first = block.events[0]
    assert (first.kind, first.time) == ("landing", pytest.approx(0.01, abs=1e-15))
    assert first.impulse == pytest.approx(follower.mass * jump, rel=1e-9)
    assert first.energy_lost == pytest.approx(0.5 * follower.mass * jump**2, rel=1e-9)
    assert block.rows[5, 0] == first.impulse
    assert block.rows[4, 0] > 0.0


def test_in_the_dwell_nothing_happens(step):
    """The cam's surface stands still in the dwell at any speed."""
    slow, fast = slow_and_fast()
    jump, _, end, block = step(np.radians(180.0), slow, fast)
    assert jump == pytest.approx(0.0, abs=1e-15)
    assert block.events == ()
    assert end.in_contact


def test_same_speed_is_no_step(step):
    """A border between two intervals of one speed is no event."""
    slow, _ = slow_and_fast()
    assert step(RISING, slow, slow)[3].events == ()


def test_flight_goes_on_over_a_step(laws, follower):
    """A change of speed does not touch a follower in the air."""
    law, fast, faster = laws["poly345"], 20.0 * np.pi, 25.0 * np.pi
    stop = 40 * NS // 1000
    angle = fast * 0.04  # 144°: high above the cam since the lift-off at 101.5°
    state, _ = one_mass.advance(law, follower, None, Interval(0, stop, 0.0, fast), 8000)
    assert not state.in_contact
    go_on = Interval(stop, stop + NS // 1000, angle, faster)
    _, block = one_mass.advance(law, follower, state, go_on, 8000)
    assert block.events == ()
    assert block.rows[1, 0] == pytest.approx(state.displacement, rel=1e-14)
    assert block.rows[2, 0] == pytest.approx(state.velocity, rel=1e-14)


@pytest.mark.parametrize("faster", [0.8, 1.25])
@pytest.mark.parametrize("model", ["elastic_stem", "two_mass"])
@pytest.mark.parametrize("degrees", [90.0, 270.0])
def test_a_step_of_the_speed_moves_the_cam_alone(laws, paper_rig, model, faster, degrees):
    """No mass changes its velocity by itself, whatever the cam does under it.

    Where the cam gets faster it strikes: J = m Δv for the mass that touches it; where it gets
    slower the follower goes on with the velocity it had.
    """
    law, p = laws["poly345"], replace(MODELS[model].parameters(paper_rig), preload=200.0)
    angle, slow, advance = np.radians(degrees), 20.0, MODELS[model].advance
    state, block = advance(law, p, None, Interval(0, MS, angle - slow * 1e-3, slow), 12_007)
    assert block.events == ()
    change = float(law(angle, 1)) * slow * (faster - 1.0)
    _, block = advance(law, p, state, Interval(MS, 2 * MS, angle, slow * faster), 12_007)
    if model == "elastic_stem":
        assert block.rows[2, 0] == pytest.approx(state.velocity, abs=0.02 * abs(change))
        return  # its acceleration is the stem's
    first = block.events[0]
    assert first.kind == ("landing" if change > 0.0 else "lift-off")
    assert first.time == pytest.approx(1e-3, abs=1e-15)
    if change > 0.0:
        assert first.impulse == pytest.approx(p.roller_mass * change, rel=1e-9)
    else:
        since = block.rows[0, 0] - first.time
        begun = block.rows[2, 0] - block.rows[3, 0] * since
        assert begun == pytest.approx(state.velocity, abs=3e-3 * abs(change))

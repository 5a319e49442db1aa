"""Tests of flights from 0.1 mm to 0.1 pm high, against 50-digit references.

Further tests find the end of contact, where a polynomial falls below zero.
"""

import itertools
import math
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters, FollowerState, Interval
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.dynamics.one_mass import OneMassTrajectory, flight_from
from cam_rig.laws import Law, bernstein, polynomials
from cam_rig.laws.polynomials import NO_ROOT, find_fall
from cam_rig.units import NS, TURN

from .helpers import exact_law, land

P = FollowerParameters(1.3, 4030.0, 8.642, 30.0, 3.3e8)
SPEED = 300.0 * np.pi / 30.0
EPS = float(np.finfo(float).eps)
#: Heights of the tested flights above the cam, m.
HEIGHTS = (1.5e-4, 1e-6, 6e-9, 1e-11, 1e-13)


def exact_flight(law, p, speed, angle, gap_rate, guess):
    """Return time (s) and closing speed (m/s) of a landing, in 50 digits.

    The time is since the lift-off. The flight leaves the cam at `angle` (rad) with the relative
    speed `gap_rate` (m/s). The landing is the one near the time `guess` (s).
    """
    numbers = (p.mass, p.spring_stiffness, p.damping, p.preload, speed)
    m, k, c, load, speed = (mp.mpf(x) for x in numbers)
    s, slope, _ = exact_law(law, angle)
    matrix = mp.matrix([[0, 1, 0], [-k / m, -c / m, -load / m], [0, 0, 0]])
    start = mp.matrix([s, slope * speed + gap_rate, 1])

    def gap(time):
        return (mp.expm(matrix * time) * start)[0] - exact_law(law, angle + speed * time)[0]

    time = mp.findroot(gap, (mp.mpf(guess) * (1 + mp.mpf(10) ** -9), mp.mpf(guess)))
    velocity = (mp.expm(matrix * time) * start)[1]
    return time, exact_law(law, angle + speed * time)[1] * speed - velocity


def pull(law, angle):
    """Return a free follower's acceleration (m/s²) towards the cam, and its scale.

    The scale is the sum of the absolute values of its terms, for rounding errors.
    """
    parts = force_weights(P, SPEED) * np.array(law.at(angle)) / P.mass
    return float(parts.sum()) + P.preload / P.mass, float(np.abs(parts).sum() + P.preload / P.mass)


@pytest.mark.parametrize(
    ("cam", "degrees", "height"),
    [
        ("poly345", 75.0, 1.5e-4),
        ("tm21", 80.0, 1e-6),
        ("bezier15", 95.0, 6e-9),
        ("poly345", 75.0, 1e-11),
        ("tm21", 80.0, 1e-13),
        *(pytest.param("bezier15", 95.0, height, marks=pytest.mark.long) for height in HEIGHTS),
    ],
)
def test_a_flight_is_known_to_its_last_digits(laws, cam, degrees, height):
    """Duration and landing speed of a flight are exact to rounding, however low it is.

    Computed from the difference of two displacements, they would have an error of 1e-17 m, which is
    1e-11 s in the shortest flight.
    """
    law, angle = laws[cam], np.radians(degrees)
    back, parts = pull(law, angle)
    assert back > 1.0
    gap_rate = np.sqrt(2.0 * back * height)
    s, slope, _ = law.at(angle)
    flight = flight_from(P, s, slope * SPEED + gap_rate, 0.0, gap_rate)
    found = land(flight, law, angle, SPEED, 0.1)
    with mp.workdps(50):
        start = mp.mpf(angle), mp.mpf(gap_rate)
        time, approach = exact_flight(law, P, SPEED, *start, found.time)
        limit = 8.0 * EPS * (1.0 + parts / back)
        assert found.has_landed
        assert abs(float(found.time / time - 1)) < limit
        assert abs(float(-found.rate / approach - 1)) < limit


@pytest.mark.variants(3)
@pytest.mark.parametrize("part", [0.2, 0.9])
@pytest.mark.parametrize("height", HEIGHTS[:4])
def test_a_flight_over_a_joint(laws, height, part):
    """The duration of a flight over a jump of s'' is exact to rounding.

    The jump is at a joint, where two polynomial pieces of the law meet.
    """
    law = laws["tm21"]
    joint = float(law.breaks[np.argmax(np.abs(law.jumps(2)) * (law.breaks[:-1] > 0.1))])
    back, parts = pull(law, joint - 1e-9)
    after, more = pull(law, joint + 1e-9)
    back = max(back, 1.0)
    gap_rate = np.sqrt(2.0 * back * height)
    angle = joint - part * SPEED * gap_rate / back
    s, slope, _ = law.at(angle)
    flight = flight_from(P, s, slope * SPEED + gap_rate, 0.0, gap_rate)
    found = land(flight, law, angle, SPEED, 0.1)
    with mp.workdps(50):
        start = mp.mpf(angle), mp.mpf(gap_rate)
        time, _ = exact_flight(law, P, SPEED, *start, found.time)
    assert angle < joint < angle + SPEED * found.time
    # The angle of the joint has a rounding error, and s has a step of rounding there.
    limit = 8.0 * EPS * (1.0 + max(parts, more) / min(back, abs(after)))
    joint_error = 2.0 * EPS * joint / SPEED + 2.0 * law.largest_step / abs(found.rate)
    assert abs(float(found.time - time)) < limit * found.time + joint_error


@pytest.mark.variants(1)
@pytest.mark.parametrize("milliseconds", [7, 400, 20, 1])
def test_a_series_of_bounces(laws, milliseconds):
    """A series of bounces down to nanometres is exact, for any duration of the ticks.

    A tick is one of the time intervals into which the run is divided. The time of 12 landings is
    exact to its rounding, and the impulse to 1e-12.
    """
    # The only errors are the rounding of time and angle of a landing to floats.
    law, p = laws["poly345"], replace(P, restitution=0.6)
    events, total = [], 400 * NS // 1000
    state = FollowerState(float(law(0.0)), 0.3, 0.0, in_contact=False)
    edges = [*range(0, total, milliseconds * NS // 1000), total]
    for a, b in itertools.pairwise(edges):
        course = OneMassTrajectory(law, p, Interval(a, b, 2.0 * a / NS, 2.0))
        course.run(state)
        events += [(a / NS + e.time, e) for e in course.events if e.kind == "landing"]
        state = course.end
    with mp.workdps(50):
        time, gap_rate = mp.mpf(0), mp.mpf(0.3)
        for found, event in events[:12]:
            guess = found - float(time)
            flown, approach = exact_flight(law, p, 2.0, 2 * time, gap_rate, guess)
            time, gap_rate = time + flown, approach * mp.mpf(p.restitution)
            assert abs(float(found - time)) < 4.0 * np.spacing(0.5)
            impulse = p.mass * 1.6 * float(approach)
            assert event.impulse == pytest.approx(impulse, rel=1e-12)
    assert events[11][1].impulse < 1e-2 * events[0][1].impulse


# -- free motion against the matrix exponential in 50 digits

#: Damping, N·s/m. Critical damping is 2√(km) = 144.8 N·s/m with 1.3 kg and 4030 N/m.
DAMPINGS = {"none": 0.0, "paper": 8.642, "near critical": 144.76, "over": 2e3, "heavy": 2e4}
TIMES = [0.0, 1e-6, 1e-3, 0.01, 0.1, 1.0]


@pytest.fixture(params=DAMPINGS.values(), ids=DAMPINGS.keys())
def flight(request, follower):
    """Parameters and flight of a follower that starts at 31 mm with 1.7 m/s.

    The fixture runs each test with the dampings of `DAMPINGS`.
    """
    p = replace(follower, damping=request.param)
    return p, flight_from(p, 0.031, 1.7)


def exact(p, time):
    """Return displacement and velocity of the flight at a time (s), in 50 digits."""
    with mp.workdps(50):
        m, k, c = (mp.mpf(x) for x in (p.mass, p.spring_stiffness, p.damping))
        rest = -mp.mpf(p.preload) / k
        flow = mp.expm(mp.matrix([[0, 1], [-k / m, -c / m]]) * mp.mpf(time))
        y, v = flow * mp.matrix([mp.mpf(0.031) - rest, mp.mpf(1.7)])
        return float(y + rest), float(v)


def test_state_against_fifty_digits(flight):
    """Displacement and velocity in flight are exact to 1e-12 of their initial values.

    The acceleration satisfies m ÿ + c ẏ + k y + preload = 0.
    """
    p, flight = flight
    expected = np.array([exact(p, time) for time in TIMES]).T
    y, v, a = flight.motion(np.array(TIMES))
    for row, wanted, first in zip((y, v), expected, (0.031, 1.7), strict=True):
        np.testing.assert_allclose(row, wanted, rtol=0, atol=1e-12 * first)
    balance = p.mass * a + p.damping * v + p.spring_stiffness * y + p.preload
    np.testing.assert_allclose(balance, 0.0, atol=1e-12 * (1.0 + p.mass * np.abs(a).max()))


def test_weight_without_a_spring(follower):
    """A flight with a very weak spring and a preload is exact to 1e-12.

    The follower's position of rest is then far below the cam.
    """
    for stiffness in (1.0, 1e-3, 1e-6):
        soft = replace(follower, spring_stiffness=stiffness)
        y, v, _ = flight_from(soft, 0.031, 1.7).motion(np.array([0.1]))
        assert [y[0], v[0]] == pytest.approx(exact(soft, 0.1), abs=1e-12 * 0.031)


# -- hard cases of the search for events: long series, close events, a landing at a joint

#: Motion law with a dwell from 1 to 6 rad at zero lift, on which followers bounce.
DWELL = Law(
    "dwell",
    [0.0, 0.5, 1.0, 6.0, TURN],
    [[0.0, 0.01, 0.0, 0.0], [0.0, 0.01, 0.0, 0.0], [0.01, 0.0, 0.0, 0.0], [0.01, 0.0, 0.0, 0.0]],
)


def thrown(velocity, p, seconds):
    """Return the events of a follower that is thrown off a dwell at a velocity (m/s).

    `seconds` is the duration of the run.
    """
    course = OneMassTrajectory(DWELL, p, Interval(0, round(seconds * NS), 1.2, 1e-3))
    course.run(FollowerState(0.0, velocity, 0.0, in_contact=False, inner=(0.0, velocity)))
    return course.events


def bounces(velocity, p, count):
    """Return exact times (s) and impulses (N·s) of `count` bounces on a dwell.

    They are computed with 50 digits. Spring and preload pull the follower back. The duration T of a
    bounce with the speed v satisfies tan(ω T/2) = v k/(ω F), with the preload F.
    """
    with mp.workdps(50):
        rate = mp.sqrt(mp.mpf(p.spring_stiffness) / mp.mpf(p.mass))
        time, v, found = mp.mpf(0), mp.mpf(velocity), []
        for _ in range(count):
            time += 2 / rate * mp.atan(v * mp.mpf(p.spring_stiffness) / (rate * mp.mpf(p.preload)))
            found.append((time, mp.mpf(p.mass) * (1 + mp.mpf(p.restitution)) * v))
            v *= mp.mpf(p.restitution)
        return found


def test_four_hundred_bounces():
    """400 bounces with the restitution 0.99 are exact to 1e-12 s, impulses to 1e-12."""
    p = FollowerParameters(1.3, 4030.0, 0.0, 12.753, 3.3e8, 0.99)
    found, exact = thrown(0.3, p, 40.0)[:400], bounces(0.3, p, 400)
    assert len(found) == 400
    for event, (time, impulse) in zip(found, exact, strict=True):
        assert event.kind == "landing"
        assert abs(float(event.time - time)) < 1e-12
        assert event.impulse == pytest.approx(float(impulse), rel=1e-12)


def test_events_within_a_nanosecond():
    """Bounces within a nanosecond are found in order, without omission or repetition."""
    p = FollowerParameters(1.3, 4030.0, 0.0, 2.6e6, 3.3e8, 0.5)
    times = [event.time for event in thrown(0.1, p, 0.01)]
    exact = [float(time) for time, _ in bounces(0.1, p, len(times))]
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert 0.0 < min(gaps) < 1e-9
    assert times == pytest.approx(exact, abs=1e-15)


@pytest.mark.parametrize(("higher", "landed"), [(-1e-12, False), (1e-12, True)])
def test_a_joint_near_the_top_of_a_flight(higher, landed):
    """A flight lands on a peak of the cam that is 1 pm above the top of the flight.

    It passes a peak 1 pm below its top. The peak is a joint of two polynomial pieces.
    """
    p = FollowerParameters(1.3, 4030.0, 0.0, 12.753, 3.3e8)
    rate, speed = math.sqrt(p.spring_stiffness / p.mass), 30.0
    top, velocity = math.atan(0.3 * p.spring_stiffness / (rate * p.preload)) / rate, 0.3
    static = p.preload / p.spring_stiffness
    peak = math.hypot(velocity / rate, static) - static + higher
    joint, angle = 2.0, 2.0 - speed * top
    rise = [[0.0, 0.0, peak, 0.0], [0.0, 0.0, peak, 0.0], [0.0, peak, 0.0, 0.0]]
    breaks = [0.0, joint - 0.05, joint, joint + 0.05, TURN]
    law = Law("peak", breaks, [*rise, [0.0, peak, 0.0, 0.0]])
    flight = flight_from(p, 0.0, velocity, 0.0, velocity)
    found = land(flight, law, angle, speed, 1.5 * top)
    assert found.has_landed == landed
    if landed:
        assert found.time == pytest.approx(top, abs=1e-6)


# -- first fall of a polynomial below zero, which is the end of contact


def test_a_fall_is_the_first():
    """`find_fall` returns the first time at which a polynomial falls below zero.

    It agrees with a scan of 20 001 points, and returns `NO_ROOT` if there is no fall.
    """
    u = np.linspace(0.0, 1.0, 20_001)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        degree = int(rng.integers(2, 25))
        ordinates = rng.standard_normal(degree + 1) * 3.0 + 1.0
        ordinates[0] = abs(ordinates[0])
        values, found = bernstein.evaluate(ordinates, u), find_fall(ordinates.tolist(), 1e-12)
        below = np.flatnonzero(values < 0.0)
        if below.size == 0:
            assert found == NO_ROOT or abs(values).min() < 1e-6
        else:
            assert u[below[0] - 1] - 1e-12 <= found <= u[below[0]]
            assert abs(bernstein.scalar(ordinates)(found)) < 1e-12


def test_a_fall_that_starts_within_rounding():
    """`find_fall` treats a polynomial that starts at zero within its rounding error.

    If it descends, the fall is at time 0. If it rises first, the fall is its later root.
    """
    assert find_fall([-1e-13, -1.0], 1e-12) == 0.0
    assert find_fall([-1.0, 1.0], 1e-12) == 0.0
    rising = find_fall([-1e-13, 1.0, -1.0], 1e-12)
    assert rising == pytest.approx(2.0 / 3.0, abs=1e-6)
    assert find_fall([-1e-13, -1e-13, 1.0], 1e-12) == NO_ROOT
    assert find_fall([0.0, 0.0, 0.0], 0.0) == NO_ROOT


def test_a_root_next_to_zero_keeps_its_digits():
    """A root close to zero has a small relative error (1e-14), not only absolute."""
    for root in (1e-3, 1e-9, 1e-15):
        ordinates = bernstein.elevate(np.array([root, root - 1.0]), 26)
        assert polynomials.find_single_root(ordinates) == pytest.approx(root, rel=1e-14)

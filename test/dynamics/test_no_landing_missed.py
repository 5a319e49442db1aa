"""Tests that no landing or lift-off is missed, by fine samples of gap and force.

Further tests cover the time intervals of a simulation and their sample times.
"""

import itertools
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cam_rig
from cam_rig.dynamics import COLUMNS, MODELS, Interval, Samples
from cam_rig.dynamics.free_masses import free_masses, to_inner
from cam_rig.dynamics.kinetostatic import state_at
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.two_mass import Separation, states
from cam_rig.laws import build_law
from cam_rig.units import NS, RPM, TURN

from ..conftest import dwell, rise
from .helpers import MS, ONE, TWO, bumped, land, noisy, run_in_ticks, tick_borders


def scan(trajectory, samples, force_at):
    """Return the event count of a run, its smallest gap (m) and smallest force (N).

    `samples` is the number of samples per turn. `force_at(phase, times)` returns the contact force
    of a phase in contact.
    """
    gap, force, speed = 0.0, np.inf, trajectory.speed
    for phase in trajectory.phases:
        count = 50 + int((phase.end - phase.begin) * speed / TURN * samples)
        times = np.linspace(phase.begin, phase.end, count)
        if phase.flight is not None:
            displacement = phase.flight.motion(times - phase.begin)[0]
            gap = min(gap, float((displacement - trajectory.law(speed * times)).min()))
        elif phase.end > phase.begin:
            force = min(force, *force_at(phase, times[1:-1]))
    return len(trajectory.events), gap, force


def two_masses(law, p, rpm, turns, samples):
    """Simulate two masses from rest over some turns, and return the result of `scan`."""
    trajectory = Separation(law, p, rpm * RPM)
    trajectory.run(turns * TURN / trajectory.speed)
    return scan(trajectory, samples, lambda _, t: states(trajectory, t)[4])


def one_mass(law, p, rpm, turns, samples):
    """Simulate one mass from rest over some turns, and return the result of `scan`.

    The contact force is evaluated at each tenth sample.
    """
    speed = rpm * RPM
    interval = Interval(0, round(turns * TURN / speed * 1e9), 0.0, speed)
    trajectory = OneMassTrajectory(law, p, interval)
    trajectory.run(None)

    def force_at(_, times):
        return [state_at(law, p, speed * t, speed).contact_force for t in times[::10]]

    return scan(trajectory, samples, force_at)


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
    """On a measured law with noise no lift-off or landing is missed.

    The law has 1440 polynomial pieces. Gap and contact force are never negative, beyond rounding of
    1e-14 m and 1e-6 N.
    """
    law = noisy(laws["poly345"], 1440, amplitude, np.random.default_rng(seed))
    events, gap, force = run(law, p, 450.0, turns, 20_000)
    assert events > 50 or amplitude < 1e-6
    assert gap > -1e-14
    assert force > -1e-6


@pytest.mark.parametrize("apart", [24.0, pytest.param(0.75, marks=pytest.mark.long)])
@pytest.mark.parametrize(("run", "p"), [(two_masses, TWO), (one_mass, ONE)])
def test_a_narrow_bump_is_not_missed(laws, run, p, apart):
    """A bump of 0.3° and 1 mm at any angle causes lift-offs, and no event is missed.

    Gap and contact force are never negative beyond rounding.
    """
    for degrees in np.arange(0.7, 359.8, apart):
        law = bumped(laws["poly345"], np.radians(degrees), np.radians(0.3), 1e-3)
        events, gap, force = run(law, p, 480.0, 1, 20_000)
        assert events > 1
        assert gap > -1e-14, degrees
        assert force > -1e-6, degrees


# -- the roller is never below the cam, for any division of time into intervals

#: Two masses identified from the paper's Table 2, with the restitution 0.5.
PAPER = replace(TWO, restitution=0.5)


def min_gap(law, p, speed, acceleration, milliseconds, total=400, model="two_mass"):
    """Return the smallest gap (m) of a speed ramp in ticks, and its event count.

    A tick is a time interval of `milliseconds` that is simulated in one call. The ramp starts at
    `speed` (rad/s), has the `acceleration` (rad/s²) and takes `total` ms.
    """
    whole = Interval(0, total * MS, 0.0, speed, acceleration)
    rows, events, _ = run_in_ticks(
        law, model, p, whole, tick_borders(milliseconds * MS, total * MS)
    )
    angle = speed * rows[0] + 0.5 * acceleration * rows[0] ** 2
    return (rows[1] - law(angle)).min(), len(events)


@pytest.mark.variants(4)
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
@pytest.mark.parametrize("milliseconds", [7, 1])
@pytest.mark.parametrize("acceleration", [2.0, 30.0])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_no_tick_of_a_ramp_loses_a_landing(laws, cam, restitution, acceleration, milliseconds):
    """On a speed ramp, also in ticks of 1 ms, no landing is missed.

    The gap must never be negative. A tick is a time interval that is simulated in one call. On a
    ramp its motion is computed with a law for this tick, which may be zero everywhere in a dwell.
    The rounding error of the gap must therefore include that of the roller's displacement.
    """
    p = replace(PAPER, restitution=restitution)
    gap, events = min_gap(laws[cam], p, 52.0, acceleration, milliseconds)
    assert gap > -1e-12
    assert events > 0


@pytest.mark.parametrize("milliseconds", [20, 3])
def test_one_mass_lands_on_a_slope_at_the_end_of_a_tick(make_cam, milliseconds):
    """A landing on a slope of the cam at the end of a tick is not missed.

    A tick is a time interval that is simulated in one call, and on a ramp its law ends with it. If
    the end were taken for a dwell, the follower would sink 20 µm below the cam. The gap must stay
    above −1e-12 m, with the 33 events of a single tick.
    """
    event = rise(110, 1, "constant_velocity"), dwell(60), rise(100, 0)
    law = build_law(make_cam(dwell(50), *event, dwell(40), lift=0.04))
    p = replace(ONE, restitution=0.7)
    gap, events = min_gap(law, p, 0.0, 150.0 * np.pi / 30.0, milliseconds, model="one_mass")
    assert gap > -1e-12
    assert events == 33  # as in one tick of 400 ms


@pytest.mark.parametrize("spring", [4030.0, 1.0, 0.1])
def test_a_weak_spring_with_a_large_preload(laws, spring):
    """A follower lands although its position of rest is up to 1 km below the cam.

    The spring is very weak and the preload large. Samples have a rounding error of 1e-9 of that
    distance.
    """
    p = replace(PAPER, spring_stiffness=spring, preload=100.0)
    gap, events = min_gap(laws["poly345"], p, 62.0, 0.0, 200)
    assert gap > -1e-9 * p.preload / spring
    assert events > 10


def test_a_roller_below_the_cam_lands_at_once(laws):
    """A flight that starts below the cam lands at time 0."""
    law, state = laws["poly345"], np.array([-0.01, -1.0, -0.01, -1.0])
    flight = Flight(free_masses(PAPER), to_inner(PAPER, state))
    gap = land(flight, law, 0.0, 50.0, 0.1)
    assert (gap.has_landed, gap.time) == (True, 0.0)
    trajectory = Separation(law, PAPER, 50.0)
    trajectory.run(0.1, state, contact=False)
    assert trajectory.events[0].kind == "landing"
    assert trajectory.events[0].time == 0.0


# -- intervals of constant speed or of a speed ramp, θ = θ₀ + ω t + α t²/2


speeds = st.floats(0.0, 1e3)


@given(speeds, speeds, st.integers(1000, 10 * NS), st.floats(0.0, 1e4))
def test_ends_of_a_ramp(before, after, length, angle):
    """A ramp ends at its last speed, and turns by its mean speed times its duration."""
    ramp = Interval(5, 5 + length, angle, before, (after - before) * NS / length)
    top = max(before, after, 1e-300)
    assert ramp.speed_at(ramp.duration) == pytest.approx(after, abs=1e-12 * top)
    assert ramp.mean_speed == pytest.approx(0.5 * (before + after), abs=1e-12 * top)
    turned = ramp.unwrapped_at(ramp.duration) - angle
    assert turned == pytest.approx(ramp.mean_speed * ramp.duration, abs=1e-11 * (1.0 + angle))


@given(st.floats(1.0, 1e3), st.floats(1.0, 1e3), st.floats(1e-3, 1.0))
def test_time_is_the_inverse_of_the_angle(before, after, part):
    """`time_at` is the inverse of `angle_at`."""
    ramp = Interval(0, NS, 0.0, before, after - before)
    assert ramp.time_at(ramp.angle_at(part)) == pytest.approx(part, rel=1e-12)


def test_time_from_rest_and_never():
    """`time_at` is exact from rest, and infinite for an angle that is not reached.

    From rest the cam angle is θ = α t²/2 with the angular acceleration α.
    """
    start = Interval(0, NS, 0.0, 0.0, 8.0)
    assert start.time_at(4.0) == 1.0
    assert start.time_at(0.0) == 0.0
    assert start.time_at(1e-20) == pytest.approx(5e-11, rel=1e-14)
    stop = Interval(0, NS, 2.0, 10.0, -10.0)
    assert stop.time_at(7.0) == pytest.approx(1.0, rel=1e-12)
    assert stop.time_at(7.0001) == math.inf
    assert Interval(0, NS, 0.0, 0.0).time_at(1.0) == math.inf


@given(speeds, speeds, st.integers(1, NS // 10), st.floats(1.0, 50.0))
def test_parts_of_a_ramp(before, after, length, max_angle):
    """`split` divides a ramp into successive parts that turn by at most a given angle."""
    ramp = Interval(7, 7 + length, 3.0, before, (after - before) * NS / length)
    parts = ramp.split(max_angle)
    assert (parts[0].start_ns, parts[-1].stop_ns) == (ramp.start_ns, ramp.stop_ns)
    for part, following in itertools.pairwise(parts):
        assert part.stop_ns == following.start_ns
        end_angle = part.unwrapped_at(part.duration)
        assert end_angle == pytest.approx(following.unwrapped_at(0.0), rel=1e-12)
        assert part.speed_at(part.duration) == pytest.approx(following.speed, abs=1e-9)
    longest = max(part.duration for part in parts)
    if len(parts) < length:
        assert max(before, after) * longest <= max_angle * (1.0 + 1e-9) + 1e-6
    assert all(part.acceleration == ramp.acceleration for part in parts)


# -- grid of sample times, which all intervals share

times_ns = st.integers(0, 4000 * NS)
rates = st.integers(100, 1_000_000)


@given(st.lists(times_ns, min_size=2, max_size=8, unique=True), rates)
def test_consecutive_intervals_share_no_sample_and_miss_none(cuts, rate):
    """The first sample of an interval follows the last sample of the previous one."""
    cuts = sorted(cuts)
    pairs = itertools.pairwise(cuts)
    grids = [Interval(a, b, 0.0, 1.0).grid(rate) for a, b in pairs]
    for before, after in itertools.pairwise(grids):
        assert after.first == before.first + before.count
    whole = Interval(cuts[0], cuts[-1], 0.0, 1.0).grid(rate)
    assert whole.first == grids[0].first
    assert whole.count == sum(grid.count for grid in grids)


@given(times_ns, st.integers(1, NS), rates)
def test_samples_lie_inside(start, length, rate):
    """The samples of an interval are the times k / rate in [start, stop).

    The offset of the first sample from the start is exact.
    """
    grid = Interval(start, start + length, 0.0, 1.0).grid(rate)
    low, high = Fraction(start, NS), Fraction(start + length, NS)
    assert grid.count >= 0
    assert Fraction(grid.first - 1, rate) < low <= Fraction(grid.first, rate)
    end = grid.first + grid.count
    assert Fraction(end - 1, rate) < high <= Fraction(end, rate)
    assert grid.offset == float(Fraction(grid.first, rate) - low)


def test_index_after():
    """`index_after` returns the index of the first sample at or after a time.

    Before the interval it is 0.
    """
    grid = Interval(0, NS, 0.0, 1.0).grid(1000)
    assert [grid.index_after(t) for t in (-1.0, 0.0, 0.25, 0.2501)] == [0, 0, 250, 251]
    np.testing.assert_allclose(grid.sample_times()[[0, 999]], [0.0, 0.999], rtol=1e-15)


# -- samples at the end of an interval, and rows by their names


@pytest.mark.parametrize("model", ["one_mass", "two_mass", "elastic_stem"])
@pytest.mark.parametrize("rpm", [250, 500])
def test_a_sample_at_the_end_of_an_interval(model, rpm):
    """A sample less than 1 ns before the end of an interval is correct in every model.

    It equals that of a longer interval to 1e-9. Sample rates such as 48 kHz have such ends, in
    contact and in flight.
    """
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    parameters = MODELS[model].parameters(cam_rig.load_rig("paper_table2"))
    speed, rate = rpm * RPM, 2580
    ends = [k for k in range(200, 600) if 0 < -k * NS % rate < rate and -k * NS % rate < 1000]
    assert len(ends) > 100
    for k in ends[::10]:
        stop = -(-k * NS // rate)
        short, long = (
            MODELS[model].advance(law, parameters, None, Interval(0, end, 0.0, speed), rate)[1]
            for end in (stop, stop + NS // 100)
        )
        assert short.rows.shape[1] == k + 1
        assert short.rows[:5] == pytest.approx(long.rows[:5, : k + 1], rel=1e-9, abs=1e-9)


def test_names_are_the_columns_in_order():
    """Each attribute of `Samples`, such as `time`, is the array row of that quantity."""
    samples = Samples(np.arange(12.0).reshape(6, 2))
    names = ("time", "lift", "velocity", "acceleration", "force", "impulse")
    for row, (name, column) in enumerate(zip(names, COLUMNS, strict=True)):
        assert column.partition(" [")[0] in (name, f"contact_{name}", name[0])
        np.testing.assert_array_equal(getattr(samples, name), samples.rows[row])
    np.testing.assert_array_equal(samples.motion, samples.rows[1:4])

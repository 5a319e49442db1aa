"""Velocity jumps of a cam: impacts at upward jumps, lift-offs at downward jumps."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from benchmark.speed import exact
from benchmark.speed.models import Case, Oscillator
from benchmark.speed.study import stem_motion as motion
from cam_rig.dynamics import Interval
from cam_rig.dynamics.elastic_stem import response
from cam_rig.dynamics.events.trajectory import jumps_table
from cam_rig.dynamics.velocity_jumps import (
    JOINT_ATOL_RAD,
    step_before_velocity_jump,
    velocity_jumps_ahead,
)
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import NS, TURN

from .helpers import (
    CALM,
    MS,
    ONE,
    assert_same,
    off_joints,
    run_in_ticks,
    tick_borders,
    turned,
)

#: Lift (m) and angle (rad) of the rise of the cam `edge`.
LIFT, RISE = 0.05, np.radians(90.0)
#: Step of s' (m/rad) at the ends of rise and fall of the cam `edge`.
STEP = LIFT / RISE
#: Cam speed (rad/s) of 60° in 0.1 s. The velocity of the cam `edge` jumps at 0.1, 0.25, 0.35 and
#: 0.5 s of each turn of 0.6 s.
SPEED = 100.0 * np.pi / 30.0
#: Borders (ns) of ticks, the time intervals of a run. Most are at velocity jumps of the cam.
ON_JOINTS = [0, 100 * MS, 250 * MS, 350 * MS, 500 * MS, 550 * MS]


def run(model, law, p, cuts, speed=SPEED, rate=8000, nudge=0.0):
    """Run a model in ticks with the borders `cuts` (ns), as with `run_in_ticks`.

    A tick is a time interval that is simulated in one call. `nudge` (rad) is added to the start
    angle of every second tick.
    """
    return run_in_ticks(law, model, p, Interval(0, cuts[-1], 0.0, speed), cuts, rate, nudge=nudge)


def test_an_impact_at_the_start_of_a_run(edge):
    """A run that starts at a velocity jump starts with an impact on the follower.

    The impulse is m Ω Δs'. On an elastic stem the impulse is zero.
    """
    law = turned(edge, edge.breaks[1])
    for model, p, mass in (("one_mass", ONE, ONE.mass), ("two_mass", CALM, CALM.roller_mass)):
        rows, events, _ = run(model, law, p, [0, MS])
        assert [event.time for event in events[:1]] == [0.0]
        assert events[0].impulse == pytest.approx(mass * SPEED * STEP, rel=1e-14)
        assert rows[5, 0] == events[0].impulse
    start = run("elastic_stem", law, ONE, [0, MS])[0][:, 0]
    np.testing.assert_allclose(start[1:4], [0.0, 0.0, 0.0], atol=1e-12)


#: Runs at constant speed. At the first speed borders of ticks and samples are at velocity jumps.
EVEN = [Interval(0, 600 * MS, 0.0, rpm * np.pi / 30.0) for rpm in (100.0, 97.3, 300.0)]
#: Ramps from rest. The first ramp reaches 60° after 0.1 s.
RAMPS = [Interval(0, 170 * MS, 0.0, 0.0, rate) for rate in (2.0 * np.pi / 0.03, 150.0)]


@pytest.mark.variants(7)
@pytest.mark.parametrize("whole", EVEN + RAMPS)
@pytest.mark.parametrize(
    ("model", "p", "tolerance"),
    [
        ("elastic_stem", ONE, 1e-10),
        ("one_mass", ONE, 1e-10),
        ("two_mass", CALM, 1e-10),
        # Infinite bounces: the error of a landing time is the rounding of the gap over its speed.
        ("one_mass", dataclasses.replace(ONE, restitution=0.2), 1e-7),
    ],
)
def test_the_duration_of_ticks_does_not_matter(edge, model, p, tolerance, whole):
    """Ticks of 1 ms and 200 ms give the same run on a cam with velocity jumps.

    A tick is a time interval that is simulated in one call. Runs at constant speed and on ramps are
    compared within the tolerance of each case. Samples at velocity jumps are left out.
    """
    # A sample at a joint may have the value of either side and is not compared.
    total = whole.stop_ns
    fine, coarse = (
        run_in_ticks(edge, model, p, whole, tick_borders(t * MS, total)) for t in (1, 200)
    )
    time = fine[0][0]
    columns = off_joints(edge, whole.speed * time + 0.5 * whole.acceleration * time**2)
    assert_same(fine, coarse, tolerance, columns)


@pytest.mark.parametrize(
    ("model", "p"), [("one_mass", ONE), ("two_mass", CALM), ("elastic_stem", ONE)]
)
def test_rounding_neither_loses_nor_repeats_an_impact(edge, model, p):
    """Ticks that end at velocity jumps of the cam neither lose nor repeat an impact.

    A tick is a time interval that is simulated in one call. The start angle of every second tick
    has a rounding error of up to 1e-13 rad. The run agrees with a single tick to 1e-9.
    """
    expected = run(model, edge, p, [0, 550 * MS])
    columns = off_joints(edge, expected[0][0] * SPEED)
    for nudge in (-1e-13, -1e-15, 0.0, 1e-15, 1e-13):
        # An error of 1e-13 rad is an error of 1e-14 s, for a vibration of 16 000 rad/s.
        assert_same(run(model, edge, p, ON_JOINTS, nudge=nudge), expected, 1e-9, columns)


@pytest.mark.parametrize("stem", [1e5, 3.3e8])
def test_stem_against_fifty_digits(edge, stem):
    """On an elastic stem the motion over velocity jumps agrees with 50 digits.

    The jumps are those of the cam. Position and velocity of the mass are continuous there.
    """
    p, grid = dataclasses.replace(ONE, stem_stiffness=stem), np.arange(20) * 0.06
    times = np.sort(np.append(np.random.default_rng(8).uniform(0.0, 1.2, 40), grid[1:]))
    model = Oscillator(p.mass, p.damping, p.spring_stiffness, stem)
    solution = exact.solve(Case("edge", "", edge, model, SPEED, 2, 2, times))
    expected = np.stack([solution.displacement[0], solution.velocity[0]])
    ticks = run("elastic_stem", edge, p, range(0, 1200 * MS + 1, 50 * MS), rate=1000)[0]
    for rows, expected_rows in (
        (motion(edge, p, SPEED, 0.0, np.zeros(2), times), expected),
        (ticks[1:, 60::60], expected[:, np.isin(times, grid[1:])]),
    ):
        assert np.abs(rows[0] - expected_rows[0]).max() < 1e-13 * LIFT
        assert np.abs(rows[1] - expected_rows[1]).max() < 1e-11 * np.abs(expected[1]).max()


def test_the_periodic_state_returns_after_a_turn(edge):
    """The periodic state on a cam with velocity jumps returns after one turn.

    A damped run from rest converges to it.
    """
    p = dataclasses.replace(ONE, stem_stiffness=1e5, damping=200.0)
    model = response(edge, p, SPEED)
    start = model.periodic()
    after = model.end(start, 0.0, TURN / SPEED)
    np.testing.assert_allclose(after, start, atol=1e-13 * SPEED * STEP)
    settled = model.end(np.zeros(2), 0.0, 3.0 * TURN / SPEED)
    np.testing.assert_allclose(settled, start, atol=1e-12 * SPEED * STEP)


@pytest.mark.parametrize("stop", [0.6 * 7, 0.6 * 7 + 0.23])
def test_many_turns_in_one_interval(stop):
    """Seven turns with a velocity jump at θ = 0 end in the same state in any ticks.

    A tick is a time interval that is simulated in one call.
    """
    saw = Law("saw", np.array([0.0, 2.0, TURN]), LIFT * np.array([[0.0, 1.0], [1.0, 0.0]]))
    total = round(stop * NS)
    _, _, whole = run("elastic_stem", saw, ONE, [0, total])
    _, _, cut = run("elastic_stem", saw, ONE, [*range(0, total, 60 * MS), total])
    size = SPEED * LIFT / 2.0
    assert cut.inner == pytest.approx(whole.inner, abs=1e-9 * size)
    assert cut.velocity == pytest.approx(whole.velocity, abs=1e-10 * size)


# -- exactly one interval contains each velocity jump, whatever the rounding


def test_velocity_jumps_of_a_law(edge, laws):
    """The velocity jumps of a law are the angles at which its slope has a step.

    Of the shipped cams only the constant-velocity cam has any.
    """
    assert edge.velocity_jumps == pytest.approx({1: STEP, 2: -STEP, 3: -STEP, 4: STEP})
    cornered = {name for name, law in laws.items() if law.velocity_jumps}
    assert cornered == {"worked_example_constant_velocity"}


def test_rounding_of_a_steep_piece_is_not_a_velocity_jump():
    """The rounding error of a very steep slope (5e7 m/rad) is no velocity jump."""
    breaks = np.array([0.0, 1.0, 1.0 + 1e-9, 4.0, TURN])
    rise = 0.05 * np.array([0.0, 0, 0, 1, 1, 1])
    columns = [np.zeros(6), rise, np.full(6, 0.05), rise[::-1]]
    assert Law("steep", breaks, np.stack(columns, axis=1)).velocity_jumps == {}


def test_velocity_jumps_are_in_order_over_turns(edge):
    """Two turns from 100° have eight velocity jumps in order of time."""
    jumps = velocity_jumps_ahead(edge, math.radians(100.0), SPEED, 2.0 * TURN / SPEED)
    degrees = np.array([150, 210, 300, 420, 510, 570, 660, 780]) - 100.0
    np.testing.assert_allclose([k.time for k in jumps], np.radians(degrees) / SPEED, rtol=1e-14)
    assert [k.step > 0 for k in jumps] == [False, False, True, True, False, False, True, True]


def test_one_interval_contains_a_joint():
    """A velocity jump at the border of two intervals belongs only to the later one.

    This is true for any rounding of the border's angle.
    """
    saw = Law("saw", np.array([0.0, 1.0, 3.0, 5.0, TURN]), np.array([[0.0, 1, 0, 1], [1, 0, 1, 0]]))
    shifts, gaps = (-1e-13, -1e-15, 0.0, 1e-15, 1e-13, 3e-10), (-1e-13, 0.0, 1e-13)
    for turn, joint, shift, gap in itertools.product((0, 1, 1000), (0, 1, 3), shifts, gaps):
        border = saw.joints[joint] + turn * TURN + shift
        before = velocity_jumps_ahead(saw, border - 0.5, 10.0, 0.05)
        after = velocity_jumps_ahead(saw, border + gap, 10.0, 0.05)
        assert (len(before), len(after)) == (0, 1)
        assert after[0].time <= 1e-13 or shift + gap < 0.0


def test_the_time_of_a_velocity_jump_is_not_before_its_joint(edge):
    """At the computed time of a velocity jump the slope is that after the jump."""
    angles = np.random.default_rng(5).uniform(0.0, TURN, 300)
    for angle in angles.tolist():
        for velocity_jump in velocity_jumps_ahead(edge, angle, 7.3, 2.0):
            slope = edge.at(angle + 7.3 * velocity_jump.time)[1]
            before = edge.at(angle + 7.3 * velocity_jump.time - 1e-9)[1]
            assert slope - before == pytest.approx(velocity_jump.step)


def test_the_end_of_an_interval_is_before_a_velocity_jump(edge):
    """An interval that ends at a velocity jump of the cam ends just before it.

    It has the slope before the jump.
    """
    for shift in (-1e-12, 0.0, 1e-12):
        for joint in (60.0, 420.0):
            angle = step_before_velocity_jump(edge, math.radians(joint) + shift)
            assert edge.at(angle)[1] == 0.0
            assert abs(angle - math.radians(joint)) < 1e-14
    assert step_before_velocity_jump(edge, 1.0) == 1.0
    jumps = jumps_table(edge, 0.5, 1.0, edge.joints[1] - 0.5 + 0.5 * JOINT_ATOL_RAD)
    assert len(jumps.ahead) == 0
    assert jumps.contact_limit == pytest.approx(edge.joints[1] - 0.5, abs=1e-14)


def test_a_steady_level_needs_a_smooth_law(edge, follower, rig):
    """A law with velocity jumps has no steady sound level, which is an error.

    The mean square of its force rate is infinite.
    """
    from cam_rig.acoustics import RadiationParameters
    from cam_rig.acoustics.pressure import steady_power

    with pytest.raises(DynamicsError, match="velocity jumps by"):
        steady_power(edge, follower, RadiationParameters.from_rig(rig), 20.0)

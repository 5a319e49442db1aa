"""Joints of a law: jumps of s'', and very narrow segments.

A joint is the angle between two polynomial pieces of a law.
"""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.speed import exact
from benchmark.speed import study as rig
from benchmark.speed.models import Case, Oscillator, TwoMasses
from benchmark.speed.study import stem_motion as motion
from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.laws import Law, build_law
from cam_rig.laws.sampling import AT_SAMPLE
from cam_rig.units import NS, TURN

from ..conftest import dwell, rise
from .helpers import TWO, with_joints

SPEED = 120.0 * np.pi / 30.0
#: Sample rate (Hz) that gives samples 1 ns apart, the resolution of the simulated time.
FINEST = 1_000_000_000


@pytest.fixture(scope="module", params=["harmonic", "tm21"])
def jumping(request, laws, harmonic):
    """Law whose acceleration jumps: simple harmonic, then the TM21's arcs.

    The fixture runs each test with both.
    """
    return harmonic if request.param == "harmonic" else laws["tm21"]


def joints_of(law):
    """Return the joints at which s'' of the law jumps.

    At a joint two polynomial pieces of the law meet. An item is the index of the later piece, and
    s'' (m/rad²) before and after the joint.
    """
    second = law.derivative_ordinates(2)
    pieces = np.flatnonzero(np.abs(law.jumps(2)) > 1e-6 * np.abs(second).max())
    return [(int(i), float(second[-1, i - 1]), float(second[0, i])) for i in pieces]


def around(law, model, parameters, piece):
    """Return acceleration and contact force before and after a joint, and all samples.

    The joint is the start angle of the polynomial piece with the index `piece`.
    """
    joint = float(law.breaks[piece]) or TURN
    stamp = int(joint / SPEED * NS)
    interval = Interval(stamp - 2, stamp + 4, SPEED * (stamp - 2) / NS, SPEED)
    rows = MODELS[model].advance(law, parameters, None, interval, FINEST)[1].rows
    after = int(np.searchsorted(SPEED * rows[0], joint - AT_SAMPLE * SPEED / FINEST))
    return rows[3:5, after - 1], rows[3:5, after], rows


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "two_mass"])
def test_the_force_on_the_cam_jumps(jumping, follower, model):
    """Where s'' jumps, acceleration and contact force jump as expected.

    The acceleration jumps by ω² Δs'', the force by m ω² Δs''. m is the mass on the cam, for two
    masses that of the roller. The acceleration may change by the jerk within 2 ns in addition.
    """
    p = TWO if model == "two_mass" else follower
    mass = getattr(p, "roller_mass", None) or p.mass
    assert len(joints_of(jumping)) == 4
    jerk = float(np.abs(jumping.derivative_ordinates(3)).max()) * SPEED**3
    for piece, left, right in joints_of(jumping):
        before, after, _ = around(jumping, model, p, piece)
        limits = np.array([left, right]) * SPEED**2
        np.testing.assert_allclose([before[0], after[0]], limits, rtol=1e-9, atol=2e-9 * jerk)
        jump = mass * (limits[1] - limits[0])
        assert after[1] - before[1] == pytest.approx(jump, abs=1e-5 * abs(jump))


def test_a_stem_makes_the_jump_continuous(jumping, follower):
    """On an elastic stem acceleration and force are continuous at a jump of s''.

    The jump is that of the cam's law. They change by less than 1e-4 of the jump that a rigid
    follower would have.
    """
    for piece, left, right in joints_of(jumping):
        before, after, rows = around(jumping, "elastic_stem", follower, piece)
        ordinary = np.abs(np.diff(rows[3:5], axis=1)).max(axis=1)
        assert abs(after[0] - before[0]) < 1e-4 * SPEED**2 * abs(right - left)
        assert abs(after[1] - before[1]) < 1e-4 * follower.mass * SPEED**2 * abs(right - left)
        assert (ordinary < 1.0).all()


@pytest.mark.parametrize("kind", ["one", "two"])
def test_motion_around_joints_against_fifty_digits(jumping, many_digits, kind):
    """The motion within 10 ns of each jump of s'' agrees with 50-digit arithmetic.

    The jumps are at joints, where two polynomial pieces of the law meet. The tolerance is 1e-12 of
    the largest value.
    """
    model = Oscillator(1.3, 8.642, 4030.0, 1.26e6)
    if kind == "two":
        model = TwoMasses(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6)
    joints = [float(jumping.breaks[piece]) / SPEED for piece, *_ in joints_of(jumping)]
    near = np.add.outer(joints, [-1e-8, -1e-12, 0.0, 1e-12, 1e-8]).ravel()
    times = np.sort(np.concatenate([near, np.linspace(0.01, 0.99, 12) * TURN / SPEED]))
    times = times[(times > 0.0) & (times < 0.999 * TURN / SPEED)]
    case = Case("joints", "joints", jumping, model, SPEED, 1, 1, times)
    expected = many_digits.solution(case, exact.solve)
    assert rig.solve(case).error(expected) < 1e-12


@pytest.mark.parametrize(("model", "rpm"), [("one_mass", 600.0), ("two_mass", 900.0)])
def test_lift_off_at_a_jump_of_the_force(harmonic, follower, model, rpm):
    """A contact force that jumps to a negative value gives a lift-off at the jump.

    The jump is at a joint, where two polynomial pieces of the law meet. The force changes its sign
    without being zero.
    """
    speed, start = rpm * np.pi / 30.0, np.radians(200.0)
    fall = int(np.flatnonzero(harmonic.breaks > np.radians(239.0))[0])
    joint = float(harmonic.breaks[fall])
    p = replace(follower, preload=10.0, damping=0.0)
    if model == "two_mass":
        p = replace(TWO, preload=10.0)
    interval = Interval(0, round((joint + 0.2 - start) / speed * NS), start, speed)
    events = MODELS[model].advance(harmonic, p, None, interval, 1000)[1].events
    assert events[0].kind == "lift-off"
    assert events[0].angle == pytest.approx(joint, abs=4.0 * np.spacing(joint))


# -- very narrow segments, events at the ends of segments, and a segment of a whole turn

FAST = 600.0 * np.pi / 30.0
TURN_NS = 60 * NS // 600


@pytest.fixture(scope="module")
def parameters(paper_rig):
    """Parameters of the follower models for the paper's rig, by model name."""
    return {name: model.parameters(paper_rig) for name, model in MODELS.items()}


def one_turn(law, name, parameters, turns=1):
    """Return the last state and the samples of a run over some turns.

    `name` is the name of the model, and `parameters` are those of all models.
    """
    interval = Interval(0, turns * TURN_NS, 0.0, FAST)
    return MODELS[name].advance(law, parameters[name], None, interval, 4000)


@pytest.mark.parametrize("name", ["one_mass", "two_mass"])
def test_lift_off_at_the_end_of_a_segment(laws, parameters, name):
    """A lift-off within 1e-12 of the end of a polynomial piece is found exactly once.

    The case is a law with an additional smooth joint next to a known lift-off. Lift-off and landing
    keep their angles to 1e-11 rad.
    """
    law = laws["poly345"]
    expected = one_turn(law, name, parameters)[1].events
    for offset in (1e-12, 1e-13, 4e-16, 0.0, -1e-13):
        events = one_turn(with_joints(law, expected[0].angle + offset), name, parameters)[1].events
        assert [event.kind for event in events[:2]] == ["lift-off", "landing"]
        for event, other in zip(events[:2], expected[:2], strict=True):
            assert event.angle == pytest.approx(other.angle, abs=1e-11)
            assert event.impulse == pytest.approx(other.impulse, rel=1e-7)


@pytest.mark.parametrize("name", list(MODELS))
def test_a_dwell_of_a_nanoradian(make_cam, parameters, name):
    """A high dwell of only 1e-9 rad gives the same motion as a law without it.

    The relative tolerance is 1e-6, for every follower model.
    """
    tiny = float(np.degrees(1e-9))
    up, down = rise(120, 1), rise(120, 0)
    without = build_law(make_cam(up, down, dwell(120)))
    thin = build_law(make_cam(up, dwell(tiny), down, dwell(120 - tiny)))
    assert thin.spans.min() == pytest.approx(1e-9, rel=1e-6)
    _, expected = one_turn(without, name, parameters)
    _, block = one_turn(thin, name, parameters)
    assert len(block.events) == len(expected.events)
    sizes = np.abs(expected.rows).max(axis=1, keepdims=True) + 1e-300
    assert (np.abs(block.rows - expected.rows) / sizes)[:3].max() < 1e-6


@pytest.mark.parametrize("name", list(MODELS))
def test_adjacent_dwells_of_a_nanoradian(parameters, name):
    """On twenty successive dwells of 1e-9 rad the follower is exactly at rest."""
    breaks = np.concatenate([[0.0], 1.0 + 1e-9 * np.arange(20), [TURN]])
    law = Law("slices", breaks, np.zeros((6, breaks.size - 1)))
    _, block = one_turn(law, name, parameters)
    preload = block.rows[4, 0]
    assert block.events == ()
    assert preload > 0.0
    np.testing.assert_array_equal(block.rows[1:4], 0.0)
    np.testing.assert_allclose(block.rows[4], preload, rtol=1e-12)


def test_a_rise_of_a_nanoradian_is_a_step(laws):
    """A rise over only 1e-9 rad gives the same response of a stem as a step.

    It is x = h (1 − cos Ωt) for a rise of h and the natural frequency Ω.
    """
    # The rise takes 1e-9/ω s, in which the phase of the stem advances by 2e-8 rad. This gives the
    # tolerance. Velocities of 1e9 m/s and accelerations of 1e19 m/s² in the rise must have no
    # effect.
    follower, speed = FollowerParameters(1.3, 4030.0, 0.0, 0.0, 1e5), 10.0
    rise = 0.01 * np.repeat([0.0, 1.0], 3)
    columns = [0.0 * rise, rise, 0.0 * rise + 0.01, rise[::-1]]
    law = Law("cliff", np.array([0.0, 1.0, 1.0 + 1e-9, 5.0, TURN]), np.stack(columns, axis=1))
    since = np.linspace(1e-6, 0.39, 200)
    x, v, _, _ = motion(law, follower, speed, 0.0, np.zeros(2), 0.1 + since)
    total = follower.spring_stiffness + follower.stem_stiffness
    rate, static = np.sqrt(total / follower.mass), 0.01 * follower.stem_stiffness / total
    np.testing.assert_allclose(x, static * (1.0 - np.cos(rate * since)), atol=1e-7 * static, rtol=0)
    np.testing.assert_allclose(v, static * rate * np.sin(rate * since), atol=1e-7 * static * rate)

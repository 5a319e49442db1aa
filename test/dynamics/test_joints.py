"""Simple-harmonic and arc cams: acceleration and force on either side of a jump."""

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
#: Samples 1 ns apart, the finest instants that rig time has.
FINEST = 1_000_000_000


@pytest.fixture(scope="module", params=["harmonic", "tm21"])
def jumping(request, laws, harmonic):
    return harmonic if request.param == "harmonic" else laws["tm21"]


def joints_of(law):
    """Pieces at whose beginning s'' jumps, with the limits on both sides."""
    second = law.derivative_ordinates(2)
    found = np.flatnonzero(np.abs(law.jumps(2)) > 1e-6 * np.abs(second).max())
    return [(int(i), float(second[-1, i - 1]), float(second[0, i])) for i in found]


def around(law, model, parameters, piece):
    """Acceleration and force at the last sample before a joint and the first after it."""
    joint = float(law.breaks[piece]) or TURN
    begin = int(joint / SPEED * NS)
    interval = Interval(begin - 2, begin + 4, SPEED * (begin - 2) / NS, SPEED)
    rows = MODELS[model].advance(law, parameters, None, interval, FINEST)[1].rows
    after = int(np.searchsorted(SPEED * rows[0], joint - AT_SAMPLE * SPEED / FINEST))
    return rows[3:5, after - 1], rows[3:5, after], rows


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "two_mass"])
def test_the_mass_on_the_cam_feels_the_jump(jumping, follower, model):
    """ẍ = ω² s'' from either side, and F jumps by m times that: of two masses by the roller's.

    The tolerance is 1 ns of jerk.
    """
    p = TWO if model == "two_mass" else follower
    mass = getattr(p, "roller_mass", None) or p.mass
    assert len(joints_of(jumping)) == 4
    jerk = float(np.abs(jumping.derivative_ordinates(3)).max()) * SPEED**3
    for piece, left, right in joints_of(jumping):
        before, after, _ = around(jumping, model, p, piece)
        wanted = np.array([left, right]) * SPEED**2
        np.testing.assert_allclose([before[0], after[0]], wanted, rtol=1e-9, atol=2e-9 * jerk)
        jump = mass * (wanted[1] - wanted[0])
        assert after[1] - before[1] == pytest.approx(jump, abs=1e-5 * abs(jump))


def test_a_stem_does_not_let_it_through(jumping, follower):
    """On an elastic stem x is smoother than s by two orders: acceleration and force go on."""
    for piece, left, right in joints_of(jumping):
        before, after, rows = around(jumping, "elastic_stem", follower, piece)
        ordinary = np.abs(np.diff(rows[3:5], axis=1)).max(axis=1)
        assert abs(after[0] - before[0]) < 1e-4 * SPEED**2 * abs(right - left)
        assert abs(after[1] - before[1]) < 1e-4 * follower.mass * SPEED**2 * abs(right - left)
        assert (ordinary < 1.0).all()


@pytest.mark.parametrize("kind", ["one", "two"])
def test_motion_around_joints_against_fifty_digits(jumping, many_digits, kind):
    """From 10 ns before each joint to 10 ns after: no side is taken for the other."""
    model = Oscillator(1.3, 8.642, 4030.0, 1.26e6)
    if kind == "two":
        model = TwoMasses(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6)
    joints = [float(jumping.breaks[piece]) / SPEED for piece, *_ in joints_of(jumping)]
    near = np.add.outer(joints, [-1e-8, -1e-12, 0.0, 1e-12, 1e-8]).ravel()
    times = np.sort(np.concatenate([near, np.linspace(0.01, 0.99, 12) * TURN / SPEED]))
    times = times[(times > 0.0) & (times < 0.999 * TURN / SPEED)]
    case = Case("joints", "joints", jumping, model, SPEED, 1, 1, times)
    wanted = many_digits.solution(case, exact.solve)
    assert rig.solve(case).error(wanted) < 1e-12


@pytest.mark.parametrize(("model", "rpm"), [("one_mass", 600.0), ("two_mass", 900.0)])
def test_thrown_off_by_the_jump_itself(harmonic, follower, model, rpm):
    """Where the fall begins F goes from pushing to pulling at once: off at the joint, not near it.

    There is no zero of the force to find, only a change of sign.
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


# Segments of no width to speak of, events at their very ends, and a segment that is the turn.

FAST = 600.0 * np.pi / 30.0
TURN_NS = 60 * NS // 600


@pytest.fixture(scope="module")
def parameters(paper_rig):
    """Every model's numbers, from one rig."""
    return {name: model.parameters(paper_rig) for name, model in MODELS.items()}


def one_turn(law, name, parameters, turns=1):
    interval = Interval(0, turns * TURN_NS, 0.0, FAST)
    return MODELS[name].advance(law, parameters[name], None, interval, 4000)


@pytest.mark.parametrize("name", ["one_mass", "two_mass"])
def test_lift_off_in_the_last_of_a_segment(laws, parameters, name):
    """A joint where nothing happens is put some last digits behind the lift-off: nothing changes.

    The event is found in the last 1e-12 of its segment, or in the first of the next, once; its
    angle is known to the rounding of a force of 1e3 N over its slope.
    """
    law = laws["poly345"]
    first = one_turn(law, name, parameters)[1].events
    for before in (1e-12, 1e-13, 4e-16, 0.0, -1e-13):
        found = one_turn(with_joints(law, first[0].angle + before), name, parameters)[1].events
        assert [event.kind for event in found[:2]] == ["lift-off", "landing"]
        for one, other in zip(found[:2], first[:2], strict=True):
            assert one.angle == pytest.approx(other.angle, abs=1e-11)
            assert one.impulse == pytest.approx(other.impulse, rel=1e-7)


@pytest.mark.parametrize("name", list(MODELS))
def test_a_dwell_of_a_nanoradian(make_cam, parameters, name):
    """A high dwell of 1e-9 rad is as good as none: its follower moves a billionth as far ahead."""
    tiny = float(np.degrees(1e-9))
    up, down = rise(120, 1), rise(120, 0)
    without = build_law(make_cam(up, down, dwell(120)))
    thin = build_law(make_cam(up, dwell(tiny), down, dwell(120 - tiny)))
    assert thin.spans.min() == pytest.approx(1e-9, rel=1e-6)
    _, wanted = one_turn(without, name, parameters)
    _, found = one_turn(thin, name, parameters)
    assert len(found.events) == len(wanted.events)
    sizes = np.abs(wanted.rows).max(axis=1, keepdims=True) + 1e-300
    assert (np.abs(found.rows - wanted.rows) / sizes)[:3].max() < 1e-6


@pytest.mark.parametrize("name", list(MODELS))
def test_rest_in_slices_of_a_nanoradian(parameters, name):
    """Twenty dwells of 1e-9 rad in a row: at rest is at rest, to the last digit."""
    breaks = np.concatenate([[0.0], 1.0 + 1e-9 * np.arange(20), [TURN]])
    law = Law("slices", breaks, np.zeros((6, breaks.size - 1)))
    _, block = one_turn(law, name, parameters)
    preload = block.rows[4, 0]
    assert block.events == ()
    assert preload > 0.0
    np.testing.assert_array_equal(block.rows[1:4], 0.0)
    np.testing.assert_allclose(block.rows[4], preload, rtol=1e-12)


def test_a_rise_of_a_nanoradian_is_a_step(laws):
    """A stem cannot tell 1e-9 rad from a step: x = h (1 − cos Ωt), whatever the rise is made of."""
    # The rise takes 1e-9/ω s, in which the stem turns by 2e-8 rad: that is the difference, and
    # velocities of 1e9 m/s and accelerations of 1e19 m/s² in between must leave no trace.
    follower, speed = FollowerParameters(1.3, 4030.0, 0.0, 0.0, 1e5), 10.0
    rise = 0.01 * np.repeat([0.0, 1.0], 3)
    columns = [0.0 * rise, rise, 0.0 * rise + 0.01, rise[::-1]]
    law = Law("cliff", np.array([0.0, 1.0, 1.0 + 1e-9, 5.0, TURN]), np.stack(columns, axis=1))
    since = np.linspace(1e-6, 0.39, 200)
    x, v, _, _ = motion(law, follower, speed, 0.0, np.zeros(2), 0.1 + since)
    total = follower.spring_stiffness + follower.stem_stiffness
    rate, rest = np.sqrt(total / follower.mass), 0.01 * follower.stem_stiffness / total
    np.testing.assert_allclose(x, rest * (1.0 - np.cos(rate * since)), rtol=0, atol=1e-7 * rest)
    np.testing.assert_allclose(v, rest * rate * np.sin(rate * since), atol=1e-7 * rest * rate)

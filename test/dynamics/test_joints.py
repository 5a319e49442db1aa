"""Simple-harmonic and arc cams: acceleration and force on either side of a jump."""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.speed import exact
from benchmark.speed import study as rig
from benchmark.speed.models import Case, Oscillator, TwoMasses
from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.laws.sampling import AT_SAMPLE
from cam_rig.units import NS, TURN

SPEED = 120.0 * np.pi / 30.0
#: Samples 1 ns apart, the finest instants that rig time has.
FINEST = 1_000_000_000
TWO = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6)


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


def test_the_jumps_of_simple_harmonic_motion(harmonic):
    """± h π²/(2β²) where it leaves a dwell, and as much where it comes to one."""
    expected = 0.05 * np.pi**2 / (2.0 * np.radians(120.0) ** 2)
    jumps = [after - before for _, before, after in joints_of(harmonic)]
    np.testing.assert_allclose(jumps, expected * np.array([-1, 1, 1, -1]), rtol=1e-11)


def test_the_arc_cam_has_four(laws):
    """Base to flank, flank to nose, and back."""
    assert len(joints_of(laws["tm21"])) == 4


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass"])
def test_a_rigid_follower_feels_the_jump(jumping, follower, model):
    """ẍ = ω² s'' from either side, and F jumps by m times that; 1 ns of jerk is the tolerance."""
    jerk = float(np.abs(jumping.derivative_ordinates(3)).max()) * SPEED**3
    for piece, left, right in joints_of(jumping):
        before, after, _ = around(jumping, model, follower, piece)
        wanted = np.array([left, right]) * SPEED**2
        np.testing.assert_allclose([before[0], after[0]], wanted, rtol=1e-9, atol=2e-9 * jerk)
        jump = follower.mass * (wanted[1] - wanted[0])
        assert after[1] - before[1] == pytest.approx(jump, abs=1e-5 * abs(jump))


def test_the_roller_mass_feels_the_jump(jumping):
    """Of two masses the roller alone follows the law: F jumps by m₁ ω² [s'']."""
    for piece, left, right in joints_of(jumping):
        before, after, _ = around(jumping, "two_mass", TWO, piece)
        jump = TWO.roller_mass * SPEED**2 * (right - left)
        assert after[0] - before[0] == pytest.approx(SPEED**2 * (right - left), rel=1e-6)
        assert after[1] - before[1] == pytest.approx(jump, rel=1e-5)


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

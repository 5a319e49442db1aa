"""Joints at which the velocity jumps: one interval owns each, whatever rounding does."""

import math

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, Interval
from cam_rig.dynamics.velocity_jumps import (
    SLACK,
    VelocityJumpsAhead,
    require_smooth,
    short_of_velocity_jump,
    velocity_jumps_ahead,
)
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import NS, TURN

LIFT, RISE = 0.05, np.radians(90.0)
STEP = LIFT / RISE
SPEED = 100.0 * np.pi / 30.0  # 60° in 0.1 s


@pytest.fixture(scope="module")
def edge():
    """Dwell, constant velocity up, dwell, constant velocity down, dwell."""
    breaks = np.radians([0.0, 60.0, 150.0, 210.0, 300.0, 360.0])
    breaks[-1] = TURN
    return Law("edge", breaks, LIFT * np.array([[0.0, 0, 1, 1, 0], [0, 1, 1, 0, 0]]))


def test_kinks_of_a_law(edge, laws):
    """Where s' jumps and by how much; none in a law that joins with one slope."""
    assert edge.velocity_jumps == pytest.approx({1: STEP, 2: -STEP, 3: -STEP, 4: STEP})
    cornered = {name for name, law in laws.items() if law.velocity_jumps}
    assert cornered == {"worked_example_constant_velocity"}


def test_rounding_of_a_steep_piece_is_no_kink():
    """A rise over 1e-9 rad has slopes of 5e7 m/rad: their rounding is not a jump."""
    breaks = np.array([0.0, 1.0, 1.0 + 1e-9, 4.0, TURN])
    rise = 0.05 * np.array([0.0, 0, 0, 1, 1, 1])
    columns = [np.zeros(6), rise, np.full(6, 0.05), rise[::-1]]
    assert Law("steep", breaks, np.stack(columns, axis=1)).velocity_jumps == {}


def test_kinks_in_order_over_turns(edge):
    """Two turns from 100°: seven joints with a jump and one more, at their times."""
    found = velocity_jumps_ahead(edge, math.radians(100.0), SPEED, 2.0 * TURN / SPEED)
    degrees = np.array([150, 210, 300, 420, 510, 570, 660, 780]) - 100.0
    np.testing.assert_allclose([k.time for k in found], np.radians(degrees) / SPEED, rtol=1e-14)
    assert [k.step > 0 for k in found] == [False, False, True, True, False, False, True, True]


@pytest.mark.variants(8)
@pytest.mark.parametrize("turn", [0, 1, 1000])
@pytest.mark.parametrize("joint", [0, 1, 3])
@pytest.mark.parametrize("shift", [-1e-13, -1e-15, 0.0, 1e-15, 1e-13, 3e-10])
@pytest.mark.parametrize("gap", [-1e-13, 0.0, 1e-13])
def test_a_joint_has_one_owner(turn, joint, shift, gap):
    """A border beside a joint, and an angle that two intervals round differently."""
    saw = Law("saw", np.array([0.0, 1.0, 3.0, 5.0, TURN]), np.array([[0.0, 1, 0, 1], [1, 0, 1, 0]]))
    border = saw.joints[joint] + turn * TURN + shift
    before = velocity_jumps_ahead(saw, border - 0.5, 10.0, 0.05)
    after = velocity_jumps_ahead(saw, border + gap, 10.0, 0.05)
    assert len(before) + len(after) == 1
    assert len(after) == 1
    assert after[0].time <= 1e-13 or shift + gap < 0.0


def test_a_kink_is_met_behind_the_joint_never_before(edge):
    """At the time of a kink the law is that of the piece that begins there."""
    angles = np.random.default_rng(5).uniform(0.0, TURN, 300)
    for angle in angles.tolist():
        for velocity_jump in velocity_jumps_ahead(edge, angle, 7.3, 2.0):
            slope = edge.at(angle + 7.3 * velocity_jump.time)[1]
            before = edge.at(angle + 7.3 * velocity_jump.time - 1e-9)[1]
            assert slope - before == pytest.approx(velocity_jump.step)


def test_short_of_a_kink(edge):
    """The end of an interval at a joint is read before the joint, on either side of it."""
    for shift in (-1e-12, 0.0, 1e-12):
        for joint in (60.0, 420.0):
            angle = short_of_velocity_jump(edge, math.radians(joint) + shift)
            assert edge.at(angle)[1] == 0.0
            assert abs(angle - math.radians(joint)) < 1e-14
    assert short_of_velocity_jump(edge, 1.0) == 1.0
    ahead = VelocityJumpsAhead(edge, 0.5, 1.0, edge.joints[1] - 0.5 + 0.5 * SLACK)
    assert not ahead.at(10.0)
    assert ahead.clear == pytest.approx(edge.joints[1] - 0.5, abs=1e-14)


def test_a_smooth_law_has_nothing_to_look_for(laws):
    """No kinks: the interval is one stretch and nothing is searched."""
    ahead = VelocityJumpsAhead(laws["poly345"], 0.3, 5.0, 2.0)
    assert (ahead.bound, ahead.clear, ahead.take(2.0)) == (2.0, 2.0, 0.0)
    assert ahead.no_later(1.9999999999999) == 1.9999999999999
    require_smooth(laws["poly345"])


@pytest.mark.parametrize("model", ["kinetostatic", "torsional"])
def test_a_model_of_rigid_parts_refuses(edge, config_dir, model):
    """An infinite force: the message says where, how much, and which models can."""
    from cam_rig.schema import load_rig

    rig = load_rig(config_dir / "rigs" / "paper_table2.yaml")
    parameters = MODELS[model].parameters(rig)
    told = r"law 'edge': velocity jumps by 0.0318 m/rad at 60°, an infinite force in this model"
    for interval in (Interval(0, NS, 0.0, 6.0), Interval(0, NS, 0.0, 0.0, 6.0)):
        with pytest.raises(DynamicsError, match=told + ".*elastic_stem, one_mass and two_mass"):
            MODELS[model].advance(edge, parameters, None, interval, 1000)


def test_a_steady_level_is_refused_too(edge, follower, rig):
    """The exact mean of the force's rate does not exist where the force is infinite."""
    from cam_rig.acoustics import RadiationParameters
    from cam_rig.acoustics.pressure import steady_power

    with pytest.raises(DynamicsError, match="velocity jumps by"):
        steady_power(edge, follower, RadiationParameters.from_rig(rig), 20.0)

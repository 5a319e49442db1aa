"""Periodic motions over the speed: what is found where they change is so on either side."""

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.studies.bounce.branches import (
    FLIP,
    FOLD,
    GRAZE,
    Family,
    UnfoundMotionError,
    branch_through,
    branches,
)
from cam_rig.units import RPM

from .table import by_speed

BESIDE = 1e-6


@pytest.fixture(scope="module")
def follower():
    """The paper's, restitution 0.7."""
    return FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8, 0.7)


@pytest.fixture(scope="module")
def family(laws, follower):
    """Of the paper's cam, of period 1."""
    return Family(laws["tm21"], by_speed(follower), 1)


@pytest.fixture(scope="module")
def four(family, follower):
    """The branch of four landings a turn, from 410 to 520 rpm."""
    state = StroboscopicMap(family.law, follower, 450.0 * RPM).run(200).states[-1]
    begin = family.at(450.0 * RPM, tuple(state))
    return branch_through(family.law, family.sweep, begin, 410.0 * RPM, 520.0 * RPM)


def of_kind(branch, kind):
    return [one for one in branch.bifurcations if one.kind == kind]


def nearest(branch, rpm, stable=None):
    motions = [one for one in branch.motions if stable in (None, one.stable)]
    return min(motions, key=lambda one: abs(one.point.rpm - rpm))


def test_every_motion_repeats(four, family, follower):
    """A period from its state leads back to it, and has its landings."""
    for motion in four.motions[::10]:
        turn_map = StroboscopicMap(family.law, follower, motion.point.speed)
        run = turn_map.run(1, motion.state)
        assert np.abs((run.states[0] - motion.state) / turn_map.scale).max() < 1e-9
        assert run.landings.sum() == motion.landings == 4


def test_a_doubling_is_told_to_a_millionth(four, family, follower):
    """A part in 1e6 slower it is stable, faster it is not; a motion of twice the period begins."""
    (flip,) = of_kind(four, FLIP)
    near, speed = nearest(four, flip.point.rpm), flip.point.rpm * RPM
    below, above = (family.at(speed * (1.0 + side), near.state) for side in (-BESIDE, BESIDE))
    assert below.stable
    assert not above.stable
    assert above.multipliers.real.min() == pytest.approx(-1.0, abs=1e-4)
    speed *= 1.0 + 1e-3
    state = StroboscopicMap(family.law, follower, speed).run(600, near.state).states[-1]
    double = Family(family.law, family.sweep, 2).at(speed, tuple(state))
    assert double.stable
    assert np.abs(double.states[0] - double.states[1]).max() > 1e-4


def test_a_fold_is_told_to_a_millionth(four, family):
    """A part in 1e6 faster there are two motions, one of them stable, and slower there is none."""
    (fold,) = of_kind(four, FOLD)
    speed = fold.point.rpm * RPM * (1.0 + BESIDE)
    side = [nearest(four, fold.point.rpm + 0.02, stable).state for stable in (True, False)]
    found = [family.at(speed, state) for state in side]
    assert [one.stable for one in found] == [True, False]
    with pytest.raises(UnfoundMotionError, match="no motion of period 1 is found near 418"):
        family.at(fold.point.rpm * RPM * (1.0 - BESIDE), found[0].state)


def test_a_graze_is_a_landing_that_comes(four, family, follower):
    """Past the branch's end a start from its last motion lands once more, at hardly any speed."""
    (graze,) = of_kind(four, GRAZE)
    last = nearest(four, graze.point.rpm)
    beyond = StroboscopicMap(family.law, follower, graze.point.rpm * RPM * (1.0 + BESIDE))
    run = beyond.run(1, last.state)
    assert run.landings[0] == last.landings + 1
    assert run.min_landing_speeds[0] < 0.02 * last.softest


def test_what_is_on_a_branch_begins_no_other(four, family):
    """Two motions of one curve, and one that is none, give one branch."""
    seen = [(m.point.speed, m.state, 1) for m in (four.motions[60], four.motions[120])]
    seen.append((380.0 * RPM, (0.5, 3.0), 1))
    found = branches(family.law, family.sweep, seen, 440.0 * RPM, 452.0 * RPM)
    assert len(found) <= 2
    assert found[0].holds(four.motions[60])

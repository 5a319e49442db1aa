"""Tests of branches: periodic motions followed over the cam speed.

A branch ends or changes at a bifurcation. It is a fold, a period doubling (flip), or a graze, where
a landing of zero speed appears.
"""

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.studies.bounce.branches import (
    FLIP,
    FOLD,
    GRAZE,
    Family,
    MotionNotFoundError,
    branch_through,
    branches,
)
from cam_rig.units import RPM

from .table import by_speed

#: Relative difference from a bifurcation's speed at which the motion on either side is checked.
BESIDE = 1e-6


@pytest.fixture(scope="module")
def follower():
    """Follower of one mass with the restitution 0.7."""
    return FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8, 0.7)


@pytest.fixture(scope="module")
def family(laws, follower):
    """Family of motions on the TM21's cam that repeat after one turn, by cam speed."""
    return Family(laws["tm21"], by_speed(follower), 1)


@pytest.fixture(scope="module")
def four(family, follower):
    """Branch (family of periodic motions over speed) with four landings per turn.

    It extends from 410 to 520 rpm.
    """
    state = StroboscopicMap(family.law, follower, 450.0 * RPM).run(200).states[-1]
    start = family.at(450.0 * RPM, tuple(state))
    return branch_through(family.law, family.sweep, start, 410.0 * RPM, 520.0 * RPM)


def of_kind(branch, kind):
    return [bifurcation for bifurcation in branch.bifurcations if bifurcation.kind == kind]


def nearest(branch, rpm, stable=None):
    motions = [motion for motion in branch.motions if stable in (None, motion.stable)]
    return min(motions, key=lambda motion: abs(motion.point.rpm - rpm))


def test_every_motion_repeats(four, family, follower):
    """Each motion of a branch repeats: a simulated turn returns to its start state.

    A branch is a family of periodic motions over speed. The error is below 1e-9 of the state's
    scale, and the turn has the four landings that the motion states.
    """
    for motion in four.motions[::10]:
        turn_map = StroboscopicMap(family.law, follower, motion.point.speed)
        run = turn_map.run(1, motion.state)
        assert np.abs((run.states[0] - motion.state) / turn_map.scale).max() < 1e-9
        assert run.landings.sum() == motion.landings == 4


def test_a_period_doubling_is_located_to_a_millionth(four, family, follower):
    """A periodic motion is stable 1e-6 below a period doubling, and unstable above it.

    The critical multiplier (growth of a small change per period) at 1e-6 above it is −1 within
    1e-4. At 0.1 % higher speed a stable motion of twice the period exists, whose two states differ.
    """
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


def test_a_fold_is_located_to_a_millionth(four, family):
    """Two periodic motions exist 1e-6 above the speed of a fold.

    No motion exists 1e-6 below it. The difference of the speed is relative. One of the two motions
    is stable, the other unstable.
    """
    (fold,) = of_kind(four, FOLD)
    speed = fold.point.rpm * RPM * (1.0 + BESIDE)
    states = [nearest(four, fold.point.rpm + 0.02, stable).state for stable in (True, False)]
    motions = [family.at(speed, state) for state in states]
    assert [motion.stable for motion in motions] == [True, False]
    with pytest.raises(MotionNotFoundError, match="no motion of period 1 was found near 418"):
        family.at(fold.point.rpm * RPM * (1.0 - BESIDE), motions[0].state)


def test_a_graze_adds_a_landing(four, family, follower):
    """Just beyond a graze a periodic motion has one more landing, of near zero speed.

    A graze is a bifurcation at which a landing appears. The speed of the new landing must be below
    2 % of the smallest landing speed before the graze.
    """
    (graze,) = of_kind(four, GRAZE)
    last = nearest(four, graze.point.rpm)
    beyond = StroboscopicMap(family.law, follower, graze.point.rpm * RPM * (1.0 + BESIDE))
    run = beyond.run(1, last.state)
    assert run.landings[0] == last.landings + 1
    assert run.min_landing_speeds[0] < 0.02 * last.min_landing_speed


def test_a_motion_on_a_branch_starts_no_other_branch(four, family):
    """Two start states on the same branch do not give two copies of this branch.

    A branch is a family of periodic motions over speed. A third start state, from which no periodic
    motion is found, adds no branch.
    """
    seen = [(m.point.speed, m.state, 1) for m in (four.motions[60], four.motions[120])]
    seen.append((380.0 * RPM, (0.5, 3.0), 1))
    result = branches(family.law, family.sweep, seen, 440.0 * RPM, 452.0 * RPM)
    assert len(result) <= 2
    assert result[0].contains(four.motions[60])

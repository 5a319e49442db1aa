"""Classification of simulated motions, and basins of attraction.

A motion is in contact, periodic, irregular, or undetermined.
"""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.errors import ConfigError
from cam_rig.studies.bounce.basins import basins
from cam_rig.studies.bounce.motion import (
    IN_CONTACT,
    IRREGULAR,
    PERIODIC,
    UNDETERMINED,
    _find_period,
    bouncing,
    motion_of,
)
from cam_rig.units import RPM

from ...dynamics.test_turn_map import random_map


@pytest.mark.variants(12)
@pytest.mark.parametrize("seed", range(120))
def test_each_kind_of_motion_has_its_property(laws, seed):
    """The motion that is reported for a random rig has the property of its kind.

    In contact: no landing. Periodic: one more period returns to the state within 1e-8 times the
    growth of an error. Irregular: the Lyapunov exponent is larger than its own error.
    """
    turn_map, _ = random_map(laws, seed)
    run = turn_map.run(160)
    motion = motion_of(turn_map, run, 60)
    last, scale = run.states[-1], turn_map.law.lift * np.array([1.0, turn_map.speed])
    if motion.motion == IN_CONTACT:
        assert not run.landings[-60:].any()
        assert (last == 0.0).all()
    elif motion.motion == PERIODIC:
        assert motion.settled <= 160 - 2 * motion.period
        state_later = turn_map.run(motion.period, tuple(last)).states[-1]
        if turn_map.law.spans.size < 1000:  # more bounces amplify rounding
            grows = max(1.0, np.abs(run.derivatives[-motion.period :]).max())
            assert np.abs((state_later - last) / scale).max() < 1e-8 * grows
        assert motion.lyapunov_exponent < 1e-6
    elif motion.motion == IRREGULAR:
        assert motion.lyapunov_exponent > motion.exponent_error > 0.0
        assert (run.contact_times[-60:] == 0.0).all()
    else:
        assert motion.motion == UNDETERMINED
        assert motion.period is None


@pytest.mark.parametrize(
    ("name", "restitution", "speed"),
    [
        ("tm21", 0.6704042892368254, 41.733759168481214),
        ("poly345", 0.7778414693754891, 54.95817425239818),
        ("bezier15", 0.7276177037817477, 76.90765846400849),
    ],
)
def test_a_period_that_rounding_decides_is_not_reported(laws, rig, name, restitution, speed):
    """A motion is undetermined if its period changes with a parameter's last digit.

    The spring stiffness of the two runs differs by the smallest step of a float.
    """
    follower = bouncing(rig, restitution)
    periods, motions = [], []
    for stiffness in (follower.spring_stiffness, np.nextafter(follower.spring_stiffness, np.inf)):
        turn_map = StroboscopicMap(
            laws[name], replace(follower, spring_stiffness=float(stiffness)), speed
        )
        run = turn_map.run(600)
        periods.append(_find_period(run.states[-200:] / turn_map.scale))
        motions.append(motion_of(turn_map, run, 200).motion)
    assert periods[0] != periods[1]
    assert motions == [UNDETERMINED, UNDETERMINED]


def test_restitution_of_the_caller_replaces_that_of_the_rig(rig):
    """A restitution given by the caller replaces that of the rig file.

    Without both, the error contains the option --restitution.
    """
    assert bouncing(rig, None).restitution == 0.0
    assert bouncing(rig, 0.4).restitution == 0.4
    data = rig.model_dump(exclude_none=True)
    del data["follower"]["restitution"]
    incomplete = type(rig).model_validate(data)
    assert bouncing(incomplete, 0.4).restitution == 0.4
    with pytest.raises(ConfigError, match=r"by bouncing; .* or set --restitution"):
        bouncing(incomplete, None)


# -- basins of attraction: from each start state the motion ends in the reported motion


@pytest.fixture(scope="module")
def two(laws, rig):
    """Basins of attraction at 420 rpm, where two different motions exist.

    They are the final motions of an 8 × 8 grid of start states.
    """
    return basins(laws["tm21"], rig, rpm=420, restitution=0.7, grid=8)


def test_two_motions_at_one_speed(two):
    """At 420 rpm one of the two possible motions is irregular and one periodic.

    Each start state of the grid ends in one of them. The shares of the motions are the fractions of
    the start states and are in descending order.
    """
    assert {motion.motion for motion in two.motions} == {IRREGULAR, PERIODIC}
    assert [motion.name for motion in two.motions] == ["A", "B"]
    assert sum(motion.share for motion in two.motions) == pytest.approx(1.0)
    for motion in two.motions:
        assert motion.exponent_error > 0.0 or motion.motion == PERIODIC
        assert np.isfinite(motion.exponent_error)
    shares = np.bincount(two.ends.ravel()) / two.ends.size
    np.testing.assert_allclose(shares, [motion.share for motion in two.motions])
    assert shares[0] >= shares[1]


@pytest.mark.parametrize("position", [(0, 0), (3, 5), (7, 2), (4, 4)])
def test_a_start_ends_in_the_reported_motion(two, position):
    """A simulation of 240 turns from a start state ends in the motion reported for it.

    A periodic motion is compared by its landings and its state (relative 1e-6). An irregular motion
    must have varying landing speeds.
    """
    start = float(two.gap[position[1]]), float(two.gap_rate[position[0]])
    run = StroboscopicMap(two.law, two.parameters, two.rpm * RPM).run(240, start)
    motion = two.motions[two.ends[position]]
    if motion.motion == PERIODIC:
        assert run.landings[-1] == motion.landings_per_turn
        np.testing.assert_allclose(run.states[-1], motion.states[-1], rtol=1e-6)
    else:
        assert np.ptp(run.max_landing_speeds[-40:]) > 1e-3


def test_a_portrait_shows_one_period(two):
    """The phase portrait of a motion (gap, gap rate) covers a period from angle 0 on.

    The gap is never negative beyond rounding (1e-12 m).
    """
    motion = next(candidate for candidate in two.motions if candidate.motion == PERIODIC)
    gap, rate = two.portrait(motion)
    assert gap.min() > -1e-12
    assert gap[0] == pytest.approx(motion.states[-1, 0], abs=1e-5)
    assert (np.diff(np.sign(rate)) > 0).sum() >= motion.landings_per_turn - 1


def test_data_has_one_row_per_start(two):
    """The JSON data of the basins have one row per start state, with its final motion."""
    data = two.data()
    assert len(data["starts"]) == two.ends.size
    assert data["starts"][1]["gap"] == pytest.approx(two.gap[1])
    assert data["starts"][8]["gap_rate"] == pytest.approx(two.gap_rate[1])
    names = [two.motions[i].name for i in two.ends.ravel()]
    assert [row["name"] for row in data["starts"]] == names


def test_a_grid_below_two_is_refused(two):
    """Basins of attraction on a grid of fewer than 2 x 2 points raise ConfigError."""
    with pytest.raises(ConfigError, match="grid must be 2 or more"):
        basins(two.law, two.rig, rpm=420, grid=1)

"""What a run is called holds for any law, follower and speed."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.errors import ConfigError
from cam_rig.studies.bounce.basins import basins
from cam_rig.studies.bounce.motion import (
    IN_CONTACT,
    IRREGULAR,
    NOT_TOLD,
    PERIODIC,
    _period,
    bouncing,
    motion_of,
)
from cam_rig.units import RPM

from ...dynamics.test_turn_map import random_map


@pytest.mark.variants(12)
@pytest.mark.parametrize("seed", range(120))
def test_a_name_is_kept(laws, seed):
    """Periodic: turns later it is where it was. Irregular: more growth than error."""
    turn_map, _ = random_map(laws, seed)
    run = turn_map.run(160)
    found = motion_of(turn_map, run, 60)
    last, scale = run.states[-1], turn_map.law.lift * np.array([1.0, turn_map.speed])
    if found.motion == IN_CONTACT:
        assert not run.landings[-60:].any()
        assert (last == 0.0).all()
    elif found.motion == PERIODIC:
        assert found.settled <= 160 - 2 * found.period
        again = turn_map.run(found.period, tuple(last)).states[-1]
        if turn_map.law.spans.size < 1000:  # hundreds of bounces on a noisy one enlarge a rounding
            grows = max(1.0, np.abs(run.derivatives[-found.period :]).max())
            assert np.abs((again - last) / scale).max() < 1e-8 * grows
        assert found.exponent < 1e-6
    elif found.motion == IRREGULAR:
        assert found.exponent > found.exponent_error > 0.0
        assert (run.contact_times[-60:] == 0.0).all()
    else:
        assert found.motion == NOT_TOLD
        assert found.period is None


@pytest.mark.parametrize(
    ("name", "restitution", "speed"),
    [
        ("tm21", 0.6704042892368254, 41.733759168481214),
        ("poly345", 0.7778414693754891, 54.95817425239818),
        ("bezier15", 0.7276177037817477, 76.90765846400849),
    ],
)
def test_a_period_that_rounding_decides_is_not_reported(laws, rig, name, restitution, speed):
    """One ulp of the spring changes the period, because rounding grows from rest to rest."""
    follower = bouncing(rig, restitution)
    periods, motions = [], []
    for stiffness in (follower.spring_stiffness, np.nextafter(follower.spring_stiffness, np.inf)):
        turn_map = StroboscopicMap(
            laws[name], replace(follower, spring_stiffness=float(stiffness)), speed
        )
        run = turn_map.run(600)
        periods.append(_period(run.states[-200:] / turn_map.scale))
        motions.append(motion_of(turn_map, run, 200).motion)
    assert periods[0] != periods[1]
    assert motions == [NOT_TOLD, NOT_TOLD]


def test_a_restitution_is_the_rigs_or_the_callers(rig):
    """A rig without one takes the caller's, and else says that it lacks one."""
    assert bouncing(rig, None).restitution == 0.0
    assert bouncing(rig, 0.4).restitution == 0.4
    data = rig.model_dump(exclude_none=True)
    del data["follower"]["restitution"]
    silent = type(rig).model_validate(data)
    assert bouncing(silent, 0.4).restitution == 0.4
    with pytest.raises(ConfigError, match=r"by bouncing; .* or give --restitution"):
        bouncing(silent, None)


# -- basins: every start ends in the motion that is said, and one motion alone has every start


@pytest.fixture(scope="module")
def two(laws, rig):
    """At 420 rpm there are two motions."""
    return basins(laws["tm21"], rig, rpm=420, restitution=0.7, grid=8)


def test_two_motions_at_one_speed(two):
    """One irregular, one of four landings a turn; together they have all starts."""
    assert {one.motion for one in two.motions} == {IRREGULAR, PERIODIC}
    assert [one.name for one in two.motions] == ["A", "B"]
    assert sum(one.share for one in two.motions) == pytest.approx(1.0)
    for one in two.motions:
        assert one.exponent_error > 0.0 or one.motion == PERIODIC
        assert np.isfinite(one.exponent_error)
    shares = np.bincount(two.ends.ravel()) / two.ends.size
    np.testing.assert_allclose(shares, [one.share for one in two.motions])
    assert shares[0] >= shares[1]


@pytest.mark.parametrize("place", [(0, 0), (3, 5), (7, 2), (4, 4)])
def test_a_start_ends_as_said(two, place):
    """Turned from there, the last turns are those of the motion."""
    start = float(two.gap[place[1]]), float(two.opening[place[0]])
    run = StroboscopicMap(two.law, two.parameters, two.rpm * RPM).run(240, start)
    motion = two.motions[two.ends[place]]
    if motion.motion == PERIODIC:
        assert run.landings[-1] == motion.landings_per_turn
        np.testing.assert_allclose(run.states[-1], motion.states[-1], rtol=1e-6)
    else:
        assert np.ptp(run.max_landing_speeds[-40:]) > 1e-3


def test_a_portrait_is_the_motion(two):
    """Its gap is never below zero, begins at the section, and is back there after the period."""
    motion = next(one for one in two.motions if one.motion == PERIODIC)
    gap, rate = two.portrait(motion)
    assert gap.min() > -1e-12
    assert gap[0] == pytest.approx(motion.states[-1, 0], abs=1e-5)
    assert (np.diff(np.sign(rate)) > 0).sum() >= motion.landings_per_turn - 1


def test_its_data(two):
    """A row a start, with the name of what it ends in."""
    data = two.data()
    assert len(data["starts"]) == two.ends.size
    assert data["starts"][1]["gap"] == pytest.approx(two.gap[1])
    assert data["starts"][8]["opening"] == pytest.approx(two.opening[1])
    names = [two.motions[i].name for i in two.ends.ravel()]
    assert [row["name"] for row in data["starts"]] == names


def test_a_grid_that_is_none(two):
    with pytest.raises(ConfigError, match="grid: is 1; allowed: 2 or more"):
        basins(two.law, two.rig, rpm=420, grid=1)

"""Basins: every start ends in the motion that is said, and one motion alone has every start."""

import numpy as np
import pytest

import cam_rig
from cam_rig.bounce.basins import basins
from cam_rig.bounce.motion import IRREGULAR, PERIODIC
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.errors import ConfigError
from cam_rig.units import RPM


@pytest.fixture(scope="module")
def two():
    """At 420 rpm there are two motions."""
    law = cam_rig.build_law(cam_rig.load_cam("tm21"))
    return basins(law, cam_rig.load_rig("tm21"), rpm=420, restitution=0.7, grid=8)


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
        assert np.ptp(run.hardest[-40:]) > 1e-3


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

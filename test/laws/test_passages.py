"""Cam angles at which heights are passed: closed forms, joints on a height, random laws."""

from itertools import pairwise

import numpy as np
import pytest

import cam_rig
from cam_rig.laws import Law, build_law
from cam_rig.laws.passages import LEVELS, passages

from ..conftest import rise


def test_simple_harmonic(make_cam):
    """(1 − cos πu)/2 passes p at u = arccos(1 − 2p)/π, and the fall is its mirror image."""
    cam = make_cam(rise(180, 1, "simple_harmonic"), rise(180, 0, "simple_harmonic"))
    found = passages(build_law(cam), cam.lift.si)
    up = np.arccos(1.0 - 2.0 * np.array(LEVELS))
    assert [passage.angle for passage in found] == pytest.approx([*up, *(2 * np.pi - up[::-1])])
    assert [passage.rising for passage in found] == [True] * 3 + [False] * 3


@pytest.mark.parametrize("name", ["half_rises", "bezier_segments", "poly345", "trigonometric"])
def test_a_joint_on_the_height_counts_once(laws, name):
    """Half-rises meet at half the lift, in the middle of rise and fall; nothing is above it."""
    found = [passage.angle for passage in passages(laws[name], 0.05, [0.5])]
    assert found == pytest.approx([0.5 * np.pi, 1.5 * np.pi], abs=1e-9)
    assert passages(laws[name], 0.05, [1.01]) == ()


@pytest.mark.parametrize("seed", range(4))
def test_the_law_is_there(seed):
    """At every event the law has that height, over its lowest place; up and down alternate."""
    random = np.random.default_rng(seed)
    ordinates = np.concatenate([np.zeros(3), random.uniform(-0.5, 1.0, 9), np.zeros(3)])
    law = Law("random", [0.0, 2.0 * np.pi], 0.02 * ordinates[:, None])
    low = law(np.linspace(0.0, 2.0 * np.pi, 100_001)).min()
    level = 0.4 * law.lift
    found = passages(law, level, [1.0])
    assert found
    for passage in found:
        assert float(law(passage.angle)) - low == pytest.approx(level, rel=1e-8)
        assert (float(law(passage.angle, 1)) > 0.0) == passage.rising
    assert all(a.rising != b.rising for a, b in pairwise(found))


def test_columns_of_the_law():
    """The first passage upwards and the last downwards, in rad; half the lift in the middle."""
    heights = cam_rig.law(["poly345", "bezier15"]).to_pandas("heights").set_index("cam")
    assert list(heights) == ["up_1", "up_50", "up_99", "down_99", "down_50", "down_1"]
    assert heights.up_50["poly345"] == pytest.approx(0.5 * np.pi)
    shown = np.degrees(heights.loc["bezier15"].astype(float)).round(3).tolist()
    assert shown == [19.063, 72.805, 132.511, 227.489, 287.195, 340.937]

"""Passages through heights: closed forms, joints on a height, random laws."""

from itertools import pairwise

import numpy as np
import pytest

import cam_rig
from cam_rig.laws import Law, build_law
from cam_rig.laws.passages import LEVELS, passages

from ..conftest import rise


def test_passages_of_simple_harmonic_have_a_closed_form(make_cam):
    """The passages of simple harmonic motion are those of a closed form.

    (1 − cos πu)/2 passes p at u = arccos(1 − 2p)/π, and the fall mirrors the rise.
    """
    cam = make_cam(rise(180, 1, "simple_harmonic"), rise(180, 0, "simple_harmonic"))
    result = passages(build_law(cam), cam.lift.si)
    up = np.arccos(1.0 - 2.0 * np.array(LEVELS))
    assert [passage.angle for passage in result] == pytest.approx([*up, *(2 * np.pi - up[::-1])])
    assert [passage.rising for passage in result] == [True] * 3 + [False] * 3


@pytest.mark.parametrize("name", ["half_rises", "bezier_segments", "poly345", "trigonometric"])
def test_a_joint_on_the_height_counts_once(laws, name):
    """A height at a joint is passed once upwards and once downwards.

    Half-rises meet at half the lift. A height above the lift is not passed.
    """
    angles = [passage.angle for passage in passages(laws[name], 0.05, [0.5])]
    assert angles == pytest.approx([0.5 * np.pi, 1.5 * np.pi], abs=1e-9)
    assert passages(laws[name], 0.05, [1.01]) == ()


@pytest.mark.parametrize("seed", range(4))
def test_the_law_has_the_height_at_every_passage(seed):
    """At every passage the law has the height above its minimum.

    Rising and falling passages alternate.
    """
    random = np.random.default_rng(seed)
    ordinates = np.concatenate([np.zeros(3), random.uniform(-0.5, 1.0, 9), np.zeros(3)])
    law = Law("random", [0.0, 2.0 * np.pi], 0.02 * ordinates[:, None])
    low = law(np.linspace(0.0, 2.0 * np.pi, 100_001)).min()
    level = 0.4 * law.lift
    result = passages(law, level, [1.0])
    assert result
    for passage in result:
        assert float(law(passage.angle)) - low == pytest.approx(level, rel=1e-8)
        assert (float(law(passage.angle, 1)) > 0.0) == passage.rising
    assert all(a.rising != b.rising for a, b in pairwise(result))


def test_passages_are_columns_of_the_law_table():
    """The table of laws has the first passage upwards and the last one downwards.

    Both are in rad for 1, 50 and 99 % of the lift.
    """
    heights = cam_rig.law_summary(["poly345", "bezier15"]).to_pandas("heights").set_index("cam")
    assert list(heights) == ["up_1", "up_50", "up_99", "down_99", "down_50", "down_1"]
    assert heights.up_50["poly345"] == pytest.approx(0.5 * np.pi)
    degrees = np.degrees(heights.loc["bezier15"].astype(float)).round(3).tolist()
    assert degrees == [19.063, 72.805, 132.511, 227.489, 287.195, 340.937]

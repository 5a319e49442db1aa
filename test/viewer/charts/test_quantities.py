"""How far the axes of a scene go: the smallest gap is seen as well as the greatest."""

from __future__ import annotations

import pytest

from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.viewer.quantities import CLOSE_GAP, MAX_SHARE, close_gap, scene_ranges


def test_a_small_gap_beside_a_great_one_has_an_axis_of_its_own() -> None:
    """It fills a fifth of that axis at least, wherever it would fill less of the other."""
    for least in (1.5e-6, 16.5e-6, 3e-4):
        (low, high, _) = close_gap([least, 0.04, 0.0])[CLOSE_GAP]
        assert low == 0.0
        assert 0.15 <= least * 1e6 / high <= 0.5


@pytest.mark.parametrize("gaps", [[], [0.0], [1e-9, 0.04], [0.02, 0.04], [1e-4]])
def test_gaps_that_one_axis_shows_have_no_other(gaps: list[float]) -> None:
    """None at all, none that can be measured, or all of a size."""
    assert close_gap(gaps) == {}


def test_a_scene_has_it_where_its_speeds_need_it() -> None:
    """TM21's cams fly a little at one speed, and far at another; what never flies has none."""
    whole = scene_ranges(open_scene(config_root() / "scenes" / "tm21_sweep.yaml")).whole
    assert whole[CLOSE_GAP][1] <= MAX_SHARE * 4.0 * whole["gap"][1]

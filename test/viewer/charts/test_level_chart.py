"""Names beside the last points of the level chart."""

from __future__ import annotations

import numpy as np

from cam_rig.viewer.level_chart import STEP, beside, level_axes, shown_cams, spread

from ..conftest import Picture, SmallBag


def test_each_cam_is_named_beside_its_last_point(bag: SmallBag, picture: Picture) -> None:
    """All of them, in words, right of the axes and none over another."""
    names = picture.column("noise/names", "Points2D:labels")[-1]
    assert names == [*shown_cams(bag.loaded).values()]
    places = picture.column("noise/names", "Points2D:positions")[-1]
    axes, (x, y) = level_axes(bag.loaded), np.array(places).T
    assert np.all(x > axes.width)
    assert np.all(x < axes.width * (1.0 + beside(bag.loaded)))
    assert np.diff(np.sort(y)).min() >= STEP - 1e-4


def test_names_keep_their_order() -> None:
    """Of random places none is nearer to the next than a step, and none is moved up."""
    random = np.random.default_rng(18)
    for _ in range(50):
        places = random.uniform(0.0, 30.0, random.integers(1, 7))
        moved = spread(places, 5.0)
        np.testing.assert_array_equal(np.argsort(moved), np.argsort(places))
        assert np.all(moved >= places)
        assert np.all(np.diff(np.sort(moved)) >= 5.0 - 1e-12)

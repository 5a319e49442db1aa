"""Bars that can be read as numbers: on one scale, each over its own band."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cam_rig.viewer.blueprint import Layout, ViewOptions
from cam_rig.viewer.level_chart import BAND_LEVELS as LEVELS
from cam_rig.viewer.level_chart import band_axes, band_numbers, third_octaves
from cam_rig.viewer.recording import save_recording

from ..conftest import Picture, SmallBag

STRIPS = "LineStrips2D:strips"


def test_each_bar_stands_around_its_band_and_is_as_high_as_its_level(
    bag: SmallBag, tmp_path: Path
) -> None:
    """Both cams' bars in the same axes: middle n, foot at the lowest dB, top at the level."""
    path = tmp_path / "a.rrd"
    save_recording(bag.path, path, ViewOptions(Layout.COMPARE, 700.0))
    shown, rate = Picture(path), bag.loaded.scene.sample_rate.si
    axes, numbers = band_axes(rate), band_numbers(rate)
    for i, cam in enumerate(bag.loaded.cams):
        ((skyline,),) = shown.column(f"compare/{cam}/bands/bars", STRIPS)
        rows = np.concatenate(bag.rows[8 * i + 6 : 8 * i + 8], axis=1)
        levels = third_octaves(bag.loaded.radiation, rows[4], rows[5], rate)
        bars = np.array(skyline).reshape(-1, 4, 2)
        middle = np.mean(bars[:, 1:3], axis=1)
        np.testing.assert_allclose(middle, axes.place(numbers, levels), atol=1e-4)
        foot = np.mean(bars[:, [0, 3]], axis=1)
        np.testing.assert_allclose(
            foot, axes.place(numbers, np.full_like(numbers, LEVELS[0])), atol=1e-4
        )


def test_a_run_has_bars_for_each_turn(bag: SmallBag, picture: Picture) -> None:
    """From the end of the tick that completes a turn on."""
    times = np.array([end for end, _ in bag.levels]) * 1e-9
    whole = [i for i in range(16) if i % 4]  # two ticks are a turn, and each step begins anew
    np.testing.assert_allclose(picture.time("bands/bars"), times[whole], atol=1e-9)


@pytest.mark.parametrize("rate", [4_000.0, 12_000.0, 96_000.0])
def test_the_scale_is_the_same_for_every_band_chart(rate: float) -> None:
    """The levels do not depend on what is shown."""
    assert band_axes(rate).y == LEVELS
    assert band_axes(rate).x[0] == 4.5

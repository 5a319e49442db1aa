"""Atlas of the page on electronic cams, against the code."""

import re

import pytest

import cam_rig
from cam_rig.studies.electronic.segmentation import Tolerances, feasibility, fewest_segments
from tools.docs.electronic import (
    FORMS,
    PAGE,
    RIG,
    atlas_cams,
    excess_levels,
    jump_speeds,
    vibrations,
)

from .test_segments import equal_count

TEXT = PAGE.read_text(encoding="utf-8")


def test_the_atlas_contains_each_cam_three_times():
    """Each table of the atlas has a row per shipped cam with a spring, and all forms."""
    rows = re.findall(r"^\| (\w+) \|", TEXT.partition("## Atlas")[2], re.M)
    assert [name for name in rows if name != "cam"] == 3 * atlas_cams()
    assert TEXT.count(" | ".join(FORMS)) == 3


@pytest.mark.parametrize("name", ["poly4567", "tm21"])
@pytest.mark.parametrize("cells", [vibrations, jump_speeds, excess_levels])
def test_rows_of_the_atlas(name, cells):
    """Rows of the atlas have the numbers of today."""
    assert f"| {name} | {' | '.join(cells(name))} |" in TEXT


def test_numbers_of_the_prose():
    """The page quotes the vibrations at 150 rpm, and the segments of Bézier 15, as computed."""
    names = ["linear", "cubic", "sliding", "spline"]
    result = cam_rig.electronic("poly4567", points=64, interpolation=names, rpm=150.0)
    law, *tables, _ = [1e6 * row.vibration for row in result.rows]
    quoted = "{:.2g} µm there", "{:.4g} µm by lines", "{:.2g} µm by cubics", "{:.2g} µm by the"
    flat = " ".join(TEXT.split())
    for text, value in zip(quoted, [law, *tables[:3]], strict=True):
        assert text.format(value).replace("2069", "2 070") in flat
    assert f"{tables[3]:.1f} µm by the C2 spline" in flat
    assert f"with 64 points is {result.rows[2].jump_rpm:.0f} rpm" in flat
    assert f"instead of {result.rows[0].jump_rpm:.0f} rpm" in flat
    test = feasibility(cam_rig.build_law("bezier15"), 0, Tolerances(1e-6, 0.005))
    assert equal_count(test) == 19 and len(fewest_segments(test)) - 1 == 12
    coarse = cam_rig.electronic("poly4567", lift_error=1e-6, acceleration_error=0.005, rig=RIG)
    loss = 1.0 - coarse.rows[1].vibration / coarse.rows[0].vibration
    assert f"as {coarse.rows[1].count} quintics loses {100.0 * loss:.0f} %" in flat

"""The drawing on paper is true: the follower's positions touch the contour all around."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from shapely import LinearRing, LineString

from cam_rig.laws import Law
from cam_rig.profile import contours, turn_angles
from cam_rig.profile.check_table import check_cam
from cam_rig.profile.figures import figure, positions
from cam_rig.schema import CamConfig
from cam_rig.show.figure import write


def test_positions_touch_the_contour(followed, cams: dict[str, CamConfig]) -> None:
    for law in followed.values():
        for contour in contours(cams[law.name].follower, law, 7200):
            ring = LinearRing(contour.points.T * 1e3)
            for strips in positions(contour.disc.element, law, turn_angles(12)):
                touching = [strip for strip in strips if len(strip) > 1 and np.ptp(strip) > 0.0]
                gap = min(LineString(strip).distance(ring) for strip in touching)
                assert gap < 0.02


@pytest.mark.variants(2)
@pytest.mark.parametrize(
    "name", ["flat", "oscillating_point", "conjugate", "oscillating_conjugate"]
)
def test_each_kind_is_drawn(
    name: str, cams: dict[str, CamConfig], laws: dict[str, Law], tmp_path: Path
) -> None:
    cam, law = cams[name], laws[name]
    write(figure(cam, law, check_cam(cam, law)), tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 50_000


@pytest.mark.variants(2)
@pytest.mark.parametrize("count", [3, 10, 37])
def test_as_many_positions_as_asked_for(
    count: int, cams: dict[str, CamConfig], laws: dict[str, Law]
) -> None:
    cam, law = cams["oscillating_roller"], laws["oscillating_roller"]
    plan = figure(cam, law, check_cam(cam, law), count).axes[0]
    rest, first = (collection.get_segments() for collection in plan.collections[:2])
    assert len(rest) == (count - 1) * len(first)
    named = {text.get_text() for text in plan.texts}
    assert len(named) == (count if count <= 12 else 6)
    assert f"follower every {360 / count:.4g}°" in plan.get_legend_handles_labels()[1]


@pytest.mark.parametrize("name", ["flat", "conjugate", "oscillating_roller"])
def test_the_numbers_are_those_of_the_contour(
    name: str, cams: dict[str, CamConfig], laws: dict[str, Law]
) -> None:
    """Least radius and greatest pressure angle of 36 000 points, and where; to the digits shown."""
    cam, law = cams[name], laws[name]
    _, curvature, pressure = figure(cam, law, check_cam(cam, law)).axes
    for i, contour in enumerate(contours(cam.follower, law, 36_000)):
        bend = np.where(contour.radius > 0.0, contour.radius, np.inf) * 1e3
        steep = np.degrees(np.abs(contour.pressure))
        shown = [axes.get_legend().get_texts()[i].get_text() for axes in (curvature, pressure)]
        for text, values, best in zip(shown, (bend, steep), (bend.min(), steep.max()), strict=True):
            value, at = (float(n) for n in re.findall(r"[=t] ([\d.]+)", text)[-2:])
            assert value == pytest.approx(best, rel=1e-3, abs=1e-9)
            there = float(np.interp(at, np.degrees(contour.angle), values, period=360.0))
            assert there == pytest.approx(best, rel=1e-3, abs=1e-9)


def test_a_straight_flank_is_marked(cams: dict[str, CamConfig], laws: dict[str, Law]) -> None:
    curved = figure(cams["arcs_convex"], laws["arcs_convex"], []).axes[1]
    assert not curved.texts
    (contour,) = contours(cams["arcs_straight"].follower, laws["arcs_straight"], 3600)
    cam, law = cams["arcs_straight"], laws["arcs_straight"]
    curvature = figure(cam, law, []).axes[1]
    assert [text.get_text() for text in curvature.texts] == 2 * ["flat:\nρ = ∞"]
    lines = [one for one in curvature.lines if one.get_transform() != curvature.transData]
    drawn = [one.get_xdata() for one in lines if one.get_linewidth() == 2.0]
    straight = np.degrees(contour.angle[np.isinf(contour.radius)])
    assert np.min(drawn) == straight.min() and np.max(drawn) == straight.max()


def test_rise_and_dwell_are_shaded(cams: dict[str, CamConfig], laws: dict[str, Law]) -> None:
    cam, law = cams["poly345"], laws["poly345"]
    pressure = figure(cam, law, check_cam(cam, law)).axes[2]
    spans: dict[str, float] = {}
    for patch in pressure.patches:
        key = f"{patch.get_facecolor()[0]:.2f}"
        spans[key] = spans.get(key, 0.0) + patch.get_width()
    dwells = sum(np.degrees(s.span.si) for s in cam.segments if s.law == "dwell")
    assert sorted(spans.values()) == pytest.approx(
        sorted([dwells, 0.5 * (360.0 - dwells)]), abs=0.5
    )


def test_the_discs_of_a_pair_have_two_fills(
    cams: dict[str, CamConfig], laws: dict[str, Law]
) -> None:
    cam, law = cams["conjugate"], laws["conjugate"]
    first, second = figure(cam, law, check_cam(cam, law)).axes[0].patches
    assert first.get_facecolor()[:3] != second.get_facecolor()[:3]
    assert not first.get_hatch() and second.get_hatch()

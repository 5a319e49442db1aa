"""The drawing on paper is true: the follower's positions touch the contour all around."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shapely import LinearRing, LineString

from cam_rig.laws import Law
from cam_rig.plots.follower_positions import positions
from cam_rig.plots.profile import draw, figure
from cam_rig.profile import contours, turn_angles
from cam_rig.profile.checks.all_checks import check_cam
from cam_rig.schema import CamConfig


def test_positions_touch_the_contour(law: Law, cams: dict[str, CamConfig]) -> None:
    """Every roller, face and point drawn is on the contour, mm, to the picture's chords."""
    for contour in contours(cams[law.name].follower, law, 7200):
        ring = LinearRing(contour.points.T * 1e3)
        for strips in positions(contour.disc.element, law, turn_angles(12)):
            touching = [strip for strip in strips if len(strip) > 1 and np.ptp(strip) > 0.0]
            gap = min(LineString(strip).distance(ring) for strip in touching)
            assert gap < 0.02


@pytest.mark.parametrize(
    "name", ["flat", "oscillating_point", "conjugate", "oscillating_conjugate"]
)
def test_each_kind_is_drawn(
    name: str, cams: dict[str, CamConfig], laws: dict[str, Law], tmp_path: Path
) -> None:
    """A picture of some size for faces, arms, pairs and frames."""
    cam, law = cams[name], laws[name]
    draw(cam, law, check_cam(cam, law), tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 50_000


@pytest.mark.parametrize("count", [3, 10, 37])
def test_as_many_positions_as_asked_for(
    count: int, cams: dict[str, CamConfig], laws: dict[str, Law]
) -> None:
    """The graphical method divides the turn into any number of equal steps; few are all named."""
    cam, law = cams["oscillating_roller"], laws["oscillating_roller"]
    plan = figure(cam, law, check_cam(cam, law), count).axes[0]
    rest, first = (collection.get_segments() for collection in plan.collections[:2])
    assert len(rest) == (count - 1) * len(first)
    named = {text.get_text() for text in plan.texts}
    assert len(named) == (count if count <= 12 else 6)
    assert f"follower every {360 / count:.4g}°" in plan.get_title()

"""Tests of figures of cams: the drawn follower positions touch the contour."""

import re

import numpy as np
import pytest
from shapely import LinearRing, LineString

from cam_rig.profile import contours, turn_angles
from cam_rig.profile.cam_checks import check_cam
from cam_rig.studies.profile.figures import figure, positions


@pytest.fixture(scope="module")
def draw(cams, laws):
    """Function that returns the figure of a shipped cam.

    A further argument is the number of follower positions.
    """
    return lambda name, *count: figure(
        cams[name], laws[name], check_cam(cams[name], laws[name]), *count
    )


def test_positions_touch_the_contour(followable_laws, cams):
    """Each drawn position of the follower touches the cam's contour within 0.02 mm."""
    for name, law in followable_laws.items():
        for contour in contours(cams[name].follower, law, 7200):
            ring = LinearRing(contour.points.T * 1e3)
            for strips in positions(contour.disc.element, law, turn_angles(5)):
                touching = [strip for strip in strips if len(strip) > 1 and np.ptp(strip) > 0.0]
                assert min(LineString(strip).distance(ring) for strip in touching) < 0.02


def test_discs_of_a_pair_are_distinguishable(draw):
    """The two discs of a conjugate cam differ in colour, and the second is hatched."""
    first, second = draw("oscillating_conjugate").axes[0].patches
    assert first.get_facecolor()[:3] != second.get_facecolor()[:3]
    assert not first.get_hatch() and second.get_hatch()


def test_number_of_positions(draw):
    """A figure of a cam has the requested number of follower positions.

    They are at equal angles. If there are few, all are labelled.
    """
    for count in (3, 37):
        plan = draw("oscillating_roller", count).axes[0]
        others, first = (collection.get_segments() for collection in plan.collections[:2])
        assert len(others) == (count - 1) * len(first)
        named = {text.get_text() for text in plan.texts}
        assert len(named) == (count if count <= 12 else 6)
        assert f"follower every {360 / count:.4g}°" in plan.get_legend_handles_labels()[1]


def test_displayed_numbers_are_those_of_the_contour(draw, cams, laws):
    """The smallest radius and the largest pressure angle in a figure are correct.

    They and their cam angles agree with 36 000 contour points to the displayed digits.
    """
    for name in ("flat", "conjugate", "oscillating_roller"):
        _, curvature, pressure = draw(name).axes
        for i, contour in enumerate(contours(cams[name].follower, laws[name], 36_000)):
            convex = np.where(contour.radius > 0.0, contour.radius, np.inf) * 1e3
            steep = np.degrees(np.abs(contour.pressure))
            for axes, values, best in (
                (curvature, convex, convex.min()),
                (pressure, steep, steep.max()),
            ):
                text = axes.get_legend().get_texts()[i].get_text()
                value, degrees = (float(n) for n in re.findall(r"[=t] ([\d.]+)", text)[-2:])
                assert value == pytest.approx(best, rel=1e-3, abs=1e-9)
                value_there = float(
                    np.interp(degrees, np.degrees(contour.angle), values, period=360.0)
                )
                assert value_there == pytest.approx(best, rel=1e-3, abs=1e-9)


def test_straight_flank_is_marked(cams, laws):
    """Straight parts of a contour are marked at the top of the curvature chart.

    Other contours have no such mark.
    """
    assert not figure(cams["arcs_convex"], laws["arcs_convex"], []).axes[1].texts
    cam, law = cams["arcs_straight"], laws["arcs_straight"]
    (contour,) = contours(cam.follower, law, 3600)
    curvature = figure(cam, law, []).axes[1]
    assert [text.get_text() for text in curvature.texts] == 2 * ["flat:\nρ = ∞"]
    lines = [line for line in curvature.lines if line.get_transform() != curvature.transData]
    drawn = [line.get_xdata() for line in lines if line.get_linewidth() == 2.0]
    straight = np.degrees(contour.angle[np.isinf(contour.radius)])
    assert np.min(drawn) == straight.min() and np.max(drawn) == straight.max()

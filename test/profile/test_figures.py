"""The drawing on paper is true: the follower's positions touch the contour all around."""

import re

import numpy as np
import pytest
from shapely import LinearRing, LineString

from cam_rig.profile import contours, turn_angles
from cam_rig.profile.cam_checks import check_cam
from cam_rig.studies.profile.figures import figure, positions


@pytest.fixture(scope="module")
def draw(cams, laws):
    """The figure of a shipped cam, with as many positions as asked for."""
    return lambda name, *count: figure(
        cams[name], laws[name], check_cam(cams[name], laws[name]), *count
    )


def test_positions_touch_the_contour(followed, cams):
    """Every roller, face and point drawn is on the contour, mm, to the picture's chords."""
    for name, law in followed.items():
        for contour in contours(cams[name].follower, law, 7200):
            ring = LinearRing(contour.points.T * 1e3)
            for strips in positions(contour.disc.element, law, turn_angles(5)):
                touching = [strip for strip in strips if len(strip) > 1 and np.ptp(strip) > 0.0]
                assert min(LineString(strip).distance(ring) for strip in touching) < 0.02


def test_a_pair_is_told_apart(draw):
    """The discs of a pair in two colours, the second hatched."""
    first, second = draw("oscillating_conjugate").axes[0].patches
    assert first.get_facecolor()[:3] != second.get_facecolor()[:3]
    assert not first.get_hatch() and second.get_hatch()


def test_as_many_positions_as_asked_for(draw):
    """The graphical method divides the turn into any number of equal steps; few are all named."""
    for count in (3, 37):
        plan = draw("oscillating_roller", count).axes[0]
        rest, first = (collection.get_segments() for collection in plan.collections[:2])
        assert len(rest) == (count - 1) * len(first)
        named = {text.get_text() for text in plan.texts}
        assert len(named) == (count if count <= 12 else 6)
        assert f"follower every {360 / count:.4g}°" in plan.get_legend_handles_labels()[1]


def test_the_numbers_are_those_of_the_contour(draw, cams, laws):
    """Least radius and greatest pressure angle of 36 000 points, and where; to the digits shown."""
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
                value, at = (float(n) for n in re.findall(r"[=t] ([\d.]+)", text)[-2:])
                assert value == pytest.approx(best, rel=1e-3, abs=1e-9)
                there = float(np.interp(at, np.degrees(contour.angle), values, period=360.0))
                assert there == pytest.approx(best, rel=1e-3, abs=1e-9)


def test_a_straight_flank_is_marked(cams, laws):
    """Where the contour is straight, a line along the top says so; nowhere else."""
    assert not figure(cams["arcs_convex"], laws["arcs_convex"], []).axes[1].texts
    cam, law = cams["arcs_straight"], laws["arcs_straight"]
    (contour,) = contours(cam.follower, law, 3600)
    curvature = figure(cam, law, []).axes[1]
    assert [text.get_text() for text in curvature.texts] == 2 * ["flat:\nρ = ∞"]
    lines = [one for one in curvature.lines if one.get_transform() != curvature.transData]
    drawn = [one.get_xdata() for one in lines if one.get_linewidth() == 2.0]
    straight = np.degrees(contour.angle[np.isinf(contour.radius)])
    assert np.min(drawn) == straight.min() and np.max(drawn) == straight.max()


def test_rise_and_dwell_are_shaded(draw, cams):
    """What is shaded adds up to the spans of the cam's dwells and of its rise."""
    spans = {}
    for patch in draw("poly345").axes[2].patches:
        key = f"{patch.get_facecolor()[0]:.2f}"
        spans[key] = spans.get(key, 0.0) + patch.get_width()
    dwells = sum(np.degrees(s.span.si) for s in cams["poly345"].segments if s.law == "dwell")
    expected = sorted([dwells, 0.5 * (360.0 - dwells)])
    assert sorted(spans.values()) == pytest.approx(expected, abs=0.5)

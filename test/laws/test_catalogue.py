"""The list of laws, and their curves: their own derivatives, with both limits where they jump."""

from typing import get_args

import numpy as np
import pytest

from cam_rig.laws import catalogue
from cam_rig.laws.figures import cams_figure, rises_figure
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.schema.segments import Rise, Segment
from cam_rig.show.figure import line as look
from cam_rig.show.looks import in_words


def test_every_law_of_a_file_is_listed():
    models = get_args(get_args(Segment)[0])
    tags = {tag for model in models for tag in get_args(model.model_fields["law"].annotation)}
    free = set(catalogue.free_laws())
    assert tags == free | set(NAMED_RISES)
    assert set(get_args(Rise.model_fields["law"].annotation)) == set(NAMED_RISES)


def test_every_rise_is_in_one_family():
    found = catalogue.families()
    assert sorted(name for one in found.values() for name in one.rises) == sorted(NAMED_RISES)
    slopes = {key: {NAMED_RISES[n].slopes for n in family.rises} for key, family in found.items()}
    full = {(0.0, 0.0)}
    assert slopes == {
        "polynomial": full,
        "start": {(0.0, 2.0)},
        "end": {(2.0, 0.0)},
        "classical": full,
    }


def test_curves_of_each_rise():
    """From 0 to 1 with its slopes and peaks; each curve is by Simpson that of the one above."""
    u = np.linspace(0.0, 1.0, 4001)
    for name, rise in NAMED_RISES.items():
        curves, known = catalogue.rise_curves(name), catalogue.figures(name)
        assert curves.x[[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-15)
        assert curves.motion[0, [0, -1]] == pytest.approx((0.0, 1.0), abs=1e-14)
        if known.continuity >= 1:
            assert curves.infinite == ()
            assert curves.motion[1, [0, -1]] == pytest.approx(rise.slopes, abs=1e-11)
        else:
            gained = [jump for _, jump in curves.infinite]
            assert gained == pytest.approx([1.0 - rise.slopes[0], rise.slopes[1] - 1.0])
        peaks = (known.peak_velocity, known.peak_acceleration, known.peak_jerk)
        assert np.abs(curves.motion[1:]).max(axis=1) == pytest.approx(peaks, rel=1e-3, abs=1e-9)
        motion = catalogue.rise_values(name, u)
        for order in (0, 1, 2):
            low, middle, high = (motion[order + 1, i : 4001 - 2 + i : 2] for i in range(3))
            area = (low + 4.0 * middle + high) * (u[1] / 3.0)
            off = np.abs(area - np.diff(motion[order, ::2]))
            assert off.max() < 1e-2 * u[1]  # s''' may jump inside an interval
            assert np.median(off) < 1e-9


def test_a_cams_curves_are_its_law(laws):
    """Off the joints the law's derivatives; s'' of constant velocity is infinite at four."""
    for cam in ("poly345", "bezier15", "tm21"):
        curves = catalogue.cam_curves(cam, laws[cam])
        assert (curves.x[0], curves.x[-1]) == pytest.approx((0.0, 360.0))
        knots = np.degrees(laws[cam].breaks)
        inside = np.abs(curves.x[:, None] - knots).min(axis=1) > 1e-6
        for order in catalogue.ORDERS:
            value = laws[cam](np.radians(curves.x[inside]), order)
            limit = 1e-9 * np.abs(value).max()
            np.testing.assert_allclose(curves.motion[order, inside], value, rtol=0, atol=limit)
    curves = catalogue.cam_curves("velocity", laws["worked_example_constant_velocity"])
    assert [x for x, _ in curves.infinite] == pytest.approx([0.0, 90.0, 180.0, 270.0])
    slope = 0.0254 / (np.pi / 2.0)
    gained = [jump for _, jump in curves.infinite]
    assert gained == pytest.approx([slope, slope, -slope, -slope], rel=1e-9)


def test_cams_of_several_units_are_drawn_in_mm(cams):
    inch, metre = cams["worked_example_quintic"], cams["poly345"]
    assert catalogue.common_unit([inch, inch]) == ("in", 0.0254)
    assert catalogue.common_unit([inch, metre]) == ("mm", 1e-3)


# The figures: every law is there, is its own derivative, and keeps its style.


def test_a_figure_of_all_families_has_every_rise_once():
    """3-4-5 is the Bézier curve of degree 5, 4-5-6-7 that of degree 7: drawn as one."""
    figure = rises_figure(catalogue.families().values())
    assert len(figure.axes) == len(catalogue.ORDERS) * len(catalogue.families())
    legends = filter(None, (axes.get_legend() for axes in figure.axes))
    texts = [text.get_text() for legend in legends for text in legend.get_texts()]
    named = [name for text in texts for name in text.split("\n= ")]
    assert sorted(named) == sorted(map(in_words, NAMED_RISES))
    first = ("Polynomial 3-4-5\n= Bézier degree 5", "Polynomial 4-5-6-7\n= Bézier degree 7")
    drawn = [line.get_label() for line in figure.axes[0].lines]
    assert drawn == [*first, "Bézier degree 9"]
    assert look("bezier5") == look("poly345") and look("bezier7") == look("poly4567")


def test_the_lines_of_a_rise_are_its_derivatives_in_its_own_style():
    names = ("poly345", "cycloidal", "bezier9", "bezier6_start")
    figure = rises_figure([catalogue.RiseFamily("some", names)])
    for order, axes in enumerate(figure.axes):
        assert [line.get_label() for line in axes.lines] == list(map(in_words, names))
        assert axes.lines[1].get_color() == look("cycloidal")["color"]
        for name, line in zip(names, axes.lines, strict=True):
            u, drawn = (np.asarray(part)[1:-1] for part in line.get_data())
            value = catalogue.rise_values(name, u)[order]
            np.testing.assert_allclose(drawn, value, rtol=0, atol=1e-8 * np.abs(value).max())


def test_cams_are_drawn_in_mm(cams, laws):
    """s to s''' over the turn; an arrow wherever a velocity jumps."""
    names = ("worked_example_quintic", "worked_example_constant_velocity")
    figure = cams_figure([(cams[name], laws[name]) for name in names])
    labels = [axes.get_ylabel().partition("[")[2] for axes in figure.axes]
    assert labels == ["mm]", "mm/rad]", "mm/rad²]", "mm/rad³]"]
    assert [len(axes.lines) for axes in figure.axes] == [2] * 4
    highest = np.asarray(figure.axes[0].lines[0].get_ydata()).max()
    np.testing.assert_allclose(highest, 25.4, rtol=1e-12)  # an inch
    assert [len(axes.texts) for axes in figure.axes] == [0, 0, 4, 0]

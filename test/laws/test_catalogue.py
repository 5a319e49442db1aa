"""Catalogue of laws: curves and figures, joined segments, and conversion to scipy."""

from typing import get_args

import numpy as np
import pytest
from scipy.interpolate import BPoly

import cam_rig
from cam_rig.errors import LawError
from cam_rig.laws import build_law, catalogue
from cam_rig.laws.segments import NAMED_RISES, RISES
from cam_rig.schema.segments import Segment
from cam_rig.show.figure import line as look
from cam_rig.show.looks import in_words
from cam_rig.studies.laws.figures import cams_figure, rises_figure
from cam_rig.units import TURN

from ..conftest import dwell, rise


def test_the_catalogue_lists_every_law_of_a_cam_file():
    models = get_args(get_args(Segment)[0])
    tags = {tag for model in models for tag in get_args(model.model_fields["law"].annotation)}
    assert tags == {*catalogue.list_parametric_laws(), *RISES}


def test_every_rise_is_in_one_family():
    families = catalogue.rise_families()
    rises = {key: family.rises for key, family in families.items()}
    assert sorted(name for names in rises.values() for name in names) == sorted(NAMED_RISES)
    slopes = {key: {NAMED_RISES[n].slopes for n in names} for key, names in rises.items()}
    full = {(0.0, 0.0)}
    assert slopes == {
        "polynomial": full,
        "start": {(0.0, 2.0)},
        "end": {(2.0, 0.0)},
        "classical": full,
    }


def test_curves_of_a_rise_have_its_slopes_and_peaks():
    """The curves of a rise run from 0 to 1 with its slopes and peaks.

    By Simpson's rule each curve is the integral of the next one.
    """
    u = np.linspace(0.0, 1.0, 4001)
    for name, named_rise in NAMED_RISES.items():
        curves, expected = catalogue.rise_curves(name), catalogue.rise_figures(name)
        assert curves.x[[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-15)
        assert curves.motion[0, [0, -1]] == pytest.approx((0.0, 1.0), abs=1e-14)
        if expected.continuity >= 1:
            assert curves.infinite == ()
            assert curves.motion[1, [0, -1]] == pytest.approx(named_rise.slopes, abs=1e-11)
        else:
            jumps = [jump for _, jump in curves.infinite]
            assert jumps == pytest.approx([1.0 - named_rise.slopes[0], named_rise.slopes[1] - 1.0])
        peaks = (expected.peak_velocity, expected.peak_acceleration, expected.peak_jerk)
        assert np.abs(curves.motion[1:]).max(axis=1) == pytest.approx(peaks, rel=1e-3, abs=1e-9)
        motion = catalogue.rise_values(name, u)
        for order in (0, 1, 2):
            low, middle, high = (motion[order + 1, i : 4001 - 2 + i : 2] for i in range(3))
            area = (low + 4.0 * middle + high) * (u[1] / 3.0)
            off = np.abs(area - np.diff(motion[order, ::2]))
            assert off.max() < 1e-2 * u[1]  # s''' may jump inside an interval
            assert np.median(off) < 1e-9


def test_curves_of_a_cam_are_its_law(laws):
    """The curves of a cam are the derivatives of its law, except at the joints.

    s'' of a constant-velocity cam is infinite at four angles.
    """
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
    jumps = [jump for _, jump in curves.infinite]
    assert jumps == pytest.approx([slope, slope, -slope, -slope], rel=1e-9)


def test_cams_of_several_units_are_drawn_in_mm(cams):
    """Cams of one unit are drawn in this unit, and cams of several units in mm."""
    inch, metre = cams["worked_example_quintic"], cams["poly345"]
    assert catalogue.common_unit([inch, inch]) == ("in", 0.0254)
    assert catalogue.common_unit([inch, metre]) == ("mm", 1e-3)


# Figures: every law is in them, with its derivatives and its style.


def test_a_figure_of_all_families_has_every_rise_once():
    """A figure of all families has one curve for each different rise.

    Equal rises are one curve: 3-4-5 and Bézier 5, 4-5-6-7 and Bézier 7.
    """
    figure = rises_figure(catalogue.rise_families().values())
    assert len(figure.axes) == len(catalogue.ORDERS) * len(catalogue.rise_families())
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
    """The figure of a cam has s to s''' in mm, with an arrow at each velocity jump."""
    names = ("worked_example_quintic", "worked_example_constant_velocity")
    figure = cams_figure([(cams[name], laws[name]) for name in names])
    labels = [axes.get_ylabel().partition("[")[2] for axes in figure.axes]
    assert labels == ["mm]", "mm/rad]", "mm/rad²]", "mm/rad³]"]
    assert [len(axes.lines) for axes in figure.axes] == [2] * 4
    highest = np.asarray(figure.axes[0].lines[0].get_ydata()).max()
    np.testing.assert_allclose(highest, 25.4, rtol=1e-12)  # an inch
    assert [len(axes.texts) for axes in figure.axes] == [0, 0, 4, 0]


# Segments joined into a law, with known values of shipped cams.


def bezier(span, *ordinates):
    return {"law": "bezier", "span": span, "ordinates": list(ordinates)}


def test_segments_continue_from_the_level_before_them(make_cam):
    """Each segment of a cam starts at the level at which the previous one ends.

    The turn closes. Levels are fractions of the lift.
    """
    law = build_law(make_cam(rise(90, 0.25), dwell(90), rise(90, 1), rise(90, 0), lift=0.2))
    assert law(np.radians([135.0, 270.0])) == pytest.approx([0.05, 0.2], rel=1e-15)
    assert float(law(0.0)) == 0.0
    law = build_law(make_cam(dwell(90), rise(135, 0, "cycloidal"), rise(135, 1, "cycloidal")))
    assert float(law(0.5)) == pytest.approx(0.05, rel=1e-15)
    top = 64.0 / 35.0  # so that the curve rises to 1
    law = build_law(make_cam(bezier(360, 0, 0, 0.5 * top, top, 0.5 * top, 0, 0), lift=0.035))
    ordinates = [0, 0, 0.032, 0.064, 0.032, 0, 0]
    np.testing.assert_allclose(law.ordinates[:, 0], ordinates, rtol=1e-15)
    assert law.lift == pytest.approx(0.035, rel=1e-15)


def test_a_law_without_the_lift_of_its_file_is_refused(make_cam):
    """A cam whose law has another lift than its file is refused with both lifts.

    The reason is a missing fall, or a fall that ends half-way.
    """
    for segments, message in (
        ((rise(300, 1), dwell(60)), "starts at 1, the end level of segments.1.: .* by 0 mm, lift"),
        ((dwell(90), rise(90, 1), rise(180, 0.5)), "starts at 0.5, .* rises by 25 mm, lift is 50"),
        (
            (bezier(360, 0, 1, 0),),
            "made': the law rises by 25 mm, lift is 50 mm; allowed: the same",
        ),
    ):
        with pytest.raises(LawError, match=message):
            build_law(make_cam(*segments))


def test_joints_are_at_the_sums_of_the_spans(make_cam):
    """The joints of a law are at the sums of the spans, the last one at exactly 2π.

    All pieces have the same degree.
    """
    law = build_law(make_cam(dwell(30), rise(100, 1, "poly4567"), dwell(130), rise(100, 0)))
    np.testing.assert_allclose(law.breaks, np.radians([0, 30, 130, 260, 360]), rtol=1e-15)
    assert law.breaks[-1] == TURN
    alone = build_law(make_cam(rise(180, 1), rise(180, 0)))
    mixed = build_law(make_cam(rise(180, 1), rise(180, 0, "poly4567")))
    angles = np.linspace(0.0, np.pi, 101)
    assert (alone.degree, mixed.degree) == (5, 7)
    np.testing.assert_allclose(mixed(angles), alone(angles), rtol=0, atol=1e-16)


def test_a_step_is_refused(make_cam):
    """A law with a step is refused with the cam, the segment and the height."""
    arcs = {"law": "tangent_arcs", "span": 180, "nose_span": 130}
    for segments, message in (
        ([dwell(180), bezier(180, 0.5, 0, 0)], r"segments\[1\]"),
        ([bezier(360, 0, 0, 1)], r"steps by -1 of the lift"),
        ([rise(180, 1), arcs], r"segments\[1\] steps by -1 of"),
    ):
        with pytest.raises(LawError, match=rf"'steppy'.*{message}.*allowed: no step"):
            build_law(make_cam(*segments, name="steppy"))


def test_lift_is_the_largest_displacement(cams, laws):
    """The lift of a law is that of the file, for a table that of its points.

    Bézier 15 exceeds it by 0.896 %.
    """
    for name, law in laws.items():
        overshoot = 1.0089649 if name == "bezier15" else 1.0
        tolerance = 2e-3 if cams[name].files else 5e-8
        assert law.lift == pytest.approx(overshoot * cams[name].lift.si, rel=tolerance)


# Conversion to scipy's Bernstein polynomials and back, and derivatives as laws.


def test_conversion_to_scipy_and_back_is_exact(laws):
    """A law that is converted to scipy and back has equal ordinates, bit for bit.

    Values are equal to rounding, also beyond the turn.
    """
    angle = np.random.default_rng(1).uniform(-10.0, 20.0, 500)
    for law in laws.values():
        bpoly = law.to_bpoly()
        converted = cam_rig.Law.from_bpoly(bpoly, law.name)
        assert converted.name == law.name
        assert np.array_equal(converted.breaks, law.breaks)
        assert np.array_equal(converted.ordinates, law.ordinates)
        scale = np.abs(law.ordinates).max()
        steepest = law.bounds[1] + scale
        np.testing.assert_allclose(bpoly(angle), law(angle), rtol=0, atol=1e-13 * steepest)


def test_the_derivative_is_a_law(laws):
    """The derivative of a law is a law that agrees with scipy."""
    angle = np.linspace(0.0, 6.28, 400)
    for law in laws.values():
        for order in (1, 2, 3):
            derived = law.derivative(order)
            scale = max(np.abs(derived.ordinates).max(), 1e-300)
            np.testing.assert_allclose(derived(angle), law(angle, order), rtol=0, atol=1e-9 * scale)
            theirs = law.to_bpoly().derivative(order)(angle)
            np.testing.assert_allclose(theirs, law(angle, order), rtol=0, atol=1e-8 * scale)
        assert law.derivative(0).name == law.name


def test_invalid_scipy_polynomials_are_refused():
    """A scipy polynomial that is not a law of one turn is refused."""
    turn = [0.0, np.pi, 2.0 * np.pi]
    with pytest.raises(TypeError, match=r"bpoly: is .* allowed: a scipy.interpolate.BPoly"):
        cam_rig.Law.from_bpoly([[0.0]])
    with pytest.raises(LawError, match="complex ordinates"):
        cam_rig.Law.from_bpoly(BPoly(np.ones((2, 2)) * 1j, turn))
    with pytest.raises(LawError, match="must rise from 0 to 2π"):
        cam_rig.Law.from_bpoly(BPoly(np.ones((2, 1)), [0.0, 1.0]))
    with pytest.raises(LawError, match="do not fit"):
        cam_rig.Law.from_bpoly(BPoly(np.ones((2, 2, 3)), turn))


def test_the_repr_is_one_short_line_and_the_plot_has_four_panels(laws):
    for law in laws.values():
        assert len(repr(law)) < 120 and "\n" not in repr(law)
    assert len(cam_rig.plot_law(law).axes) >= 4


def test_the_figure_of_all_laws_has_the_families_of_the_sources():
    """The figure of all laws has four columns, and that of another family has one."""
    for family, columns in ((None, 4), ("handbook", 1), ("motion", 1)):
        result = cam_rig.list_laws(family)
        assert len(result.plot().axes) == 4 * columns
    listed = {name for family in catalogue.all_families().values() for name in family.rises}
    assert listed == set(RISES)

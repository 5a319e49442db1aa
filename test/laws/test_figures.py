"""Laws over each other: every law is there, is its own derivative, and keeps its style."""

from __future__ import annotations

import numpy as np

from cam_rig.laws import Law
from cam_rig.laws.catalogue import ORDERS, RiseFamily, families, rise_values
from cam_rig.laws.figures import cams_figure, rises_figure
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.schema import CamConfig
from cam_rig.show.figure import line as look
from cam_rig.show.looks import in_words


def test_a_figure_of_all_families_has_every_rise_once() -> None:
    """Four rows of panels, a family in each column; the legend has each name."""
    figure = rises_figure(families().values())
    assert len(figure.axes) == len(ORDERS) * len(families())
    texts = [
        text.get_text() for a in figure.axes if (leg := a.get_legend()) for text in leg.get_texts()
    ]
    named = [name for text in texts for name in text.split("\n= ")]
    assert sorted(named) == sorted(map(in_words, NAMED_RISES))


def test_the_lines_of_a_rise_are_its_derivatives() -> None:
    """What is drawn is `rise_values` off the joints, for laws of several families."""
    names = ("poly345", "cycloidal", "bezier9", "bezier6_start")
    figure = rises_figure([RiseFamily("some", names)])
    for order, axes in enumerate(figure.axes):
        assert [line.get_label() for line in axes.lines] == list(map(in_words, names))
        for name, line in zip(names, axes.lines, strict=True):
            u, drawn = (np.asarray(part)[1:-1] for part in line.get_data())
            value = rise_values(name, u)[order]
            np.testing.assert_allclose(drawn, value, rtol=0, atol=1e-8 * np.abs(value).max())


def test_rises_that_are_one_curve_are_drawn_as_one() -> None:
    """3-4-5 is the Bézier curve of degree 5, 4-5-6-7 that of degree 7; no others coincide."""
    polynomial = rises_figure([families()["polynomial"]]).axes[0]
    drawn = [line.get_label() for line in polynomial.lines]
    assert drawn == [
        *("Polynomial 3-4-5\n= Bézier degree 5", "Polynomial 4-5-6-7\n= Bézier degree 7"),
        "Bézier degree 9",
    ]
    assert look("bezier5") == look("poly345") and look("bezier7") == look("poly4567")


def test_a_rise_keeps_its_style() -> None:
    """Beside other rises a rise looks the same, and as the cam of its name."""
    for names in (("cycloidal",), ("poly345", "cycloidal")):
        line = rises_figure([RiseFamily("some", names)]).axes[0].lines[-1]
        assert line.get_color() == look("cycloidal")["color"]


def test_cams_are_drawn_in_mm(cams: dict[str, CamConfig], laws: dict[str, Law]) -> None:
    """s to s''' of each cam over the turn; an arrow wherever a velocity jumps."""
    names = ("worked_example_quintic", "worked_example_constant_velocity")
    figure = cams_figure([(cams[name], laws[name]) for name in names])
    labels = [axes.get_ylabel().partition("[")[2] for axes in figure.axes]
    assert labels == ["mm]", "mm/rad]", "mm/rad²]", "mm/rad³]"]
    assert [len(axes.lines) for axes in figure.axes] == [2] * 4
    highest = np.asarray(figure.axes[0].lines[0].get_ydata()).max()
    np.testing.assert_allclose(highest, 25.4, rtol=1e-12)  # an inch
    assert [len(axes.texts) for axes in figure.axes] == [0, 0, 4, 0]

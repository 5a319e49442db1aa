"""Tests of printed figures: labels, contents, style, and the look of each cam.

The look of a cam is its colour, dash pattern and marker, which are the same in all figures. The
tests of the commands (test/cli) also check the figures of every command for faults of style.
"""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.markers import CARETUP
from PIL import Image

import cam_rig
from cam_rig.laws.cam import CamSet
from cam_rig.laws.catalogue import rise_curves
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.profile.cam_checks import check_cam
from cam_rig.profile.shapes import distances
from cam_rig.schema import load_rig, load_scene, load_tables
from cam_rig.schema.load import config_root
from cam_rig.show import looks
from cam_rig.show.figure import WIDTH, empty, logarithmic, series, styled, write
from cam_rig.show.looks import (
    COLOURS,
    DASHES,
    EQUAL_RISES,
    LISTED_NAMES,
    CamLook,
    cam_look,
    of_cam,
    web,
)
from cam_rig.simulation.inputs import resolve_cams
from cam_rig.simulation.regression import compare
from cam_rig.simulation.scene import open_scene
from cam_rig.studies.jump import figures as jump
from cam_rig.studies.jump.comparison import JumpResult, find_jumps
from cam_rig.studies.jump.jump_speed import JumpSpeed
from cam_rig.studies.laws import figures as law
from cam_rig.studies.profile import figures as profile
from cam_rig.studies.simulate import figures as motion
from cam_rig.studies.simulate.sound import SoundLevel
from cam_rig.studies.vibration import figures as vibration
from cam_rig.studies.vibration.study import measure
from cam_rig.units import RPM

from ..figure_faults import faults
from ..processes import ended

#: Pattern of an axis label with a unit, such as "cam angle θ [°]".
LABEL = re.compile(r"\w.* \[[^\[\]]+\]", re.DOTALL)
DURATION, SPEED = 0.5, 460.0


@pytest.fixture(scope="module")
def cam_set() -> CamSet:
    """Two cams of the paper, on the rig identified from its Table 2.

    The paper is listed in docs/glossary.md.
    """
    return resolve_cams(["bezier15", "poly345"], "paper_table2")


@pytest.fixture(scope="module")
def jumps(cam_set: CamSet) -> JumpResult:
    """Jump speeds of the two cams for runs of 0.5 s from rest.

    The jump speed is the lowest cam speed with a loss of contact.
    """
    return find_jumps(cam_set, {}, DURATION)


@pytest.fixture(scope="module")
def figures(cam_set: CamSet, jumps: JumpResult) -> dict[str, Figure]:
    """Figures that are computed quickly, one of each type, by type."""
    cam, curve = cam_set.cams["poly345"], cam_set.laws["poly345"]
    return {
        "law": law.figure(cam, curve),
        "profile": profile.figure(cam, curve, check_cam(cam, curve)),
        "jump": jump.figure(jumps),
        "lift-off": jump.lift_off_figure(cam_set, SPEED),
        "vibration": vibration.figure(measure(cam_set, (300.0,))),
    }


def test_every_axis_is_labelled_with_quantity_and_unit(figures: dict[str, Figure]) -> None:
    """Each axis has a label with quantity and unit.

    Exceptions are the inner panels of a grid and upper x axes.
    """
    for name, figure in figures.items():
        for axes in figure.axes:
            shared = name == "vibration" and not axes.get_subplotspec().is_first_col()
            assert shared or LABEL.fullmatch(axes.get_ylabel()), name
        assert any(LABEL.fullmatch(axes.get_xlabel()) for axes in figure.axes), name


def test_a_law_figure_shows_s_and_three_derivatives(figures, cam_set):
    """The figure of a motion law has panels for the lift s and its three derivatives.

    They are in mm per power of rad. At most two points of the curve between two knots may differ
    from the law, on both sides of a jump at a knot.
    """
    curve = cam_set.laws["poly345"]
    for order, axes in enumerate(figures["law"].axes):
        angle, plotted = axes.lines[0].get_data()
        inside = np.isfinite(plotted) & (np.asarray(angle) < 360.0)
        value = curve(np.radians(np.asarray(angle)[inside]), order) * 1e3
        size = np.abs(value).max()
        differs = ~np.isclose(np.asarray(plotted)[inside], value, rtol=0, atol=1e-9 * size)
        assert differs.sum() <= 2 * curve.spans.size  # both sides of a jump at a knot


def test_jump_speeds_are_marked_at_zero_force(figures, jumps):
    """The figure of jump speeds has a marker for each cam at force 0.

    It is at the jump speed of the cam. The jump speed is the lowest cam speed with a loss of
    contact.
    """
    axes = figures["jump"].axes[0]
    marked = [line.get_xydata() for line in axes.lines if line.get_marker() == "o"]
    expected = [[row.jump.rpm, 0.0] for row in jumps.rows]
    np.testing.assert_array_equal(np.concatenate(marked), expected)


def test_the_gap_is_never_negative(figures: dict[str, Figure], cam_set: CamSet) -> None:
    """In the figure of lift-offs the gap between cam and follower is never negative.

    The tolerance is 1e-9 mm. Only cams that lose contact have a gap above zero.
    """
    lift, gap = figures["lift-off"].axes
    assert len(gap.lines) == len(cam_set.laws)
    for line, text in zip(gap.lines, lift.get_legend().get_texts(), strict=True):
        values = np.asarray(line.get_ydata())
        assert values.min() > -1e-9
        assert (values.max() > 1e-6) == text.get_text().endswith("contact lost")


def test_vibration_is_plotted_at_the_requested_speed(figures: dict[str, Figure]) -> None:
    """The figure of vibration has the requested cam speed in its title.

    Each column of panels belongs to a cam, and the curves of other cams in it are grey.
    """
    figure = figures["vibration"]
    assert figure.get_suptitle().startswith("Steady state at 300 rpm\n")
    assert len(figure.axes) == 4 * 2
    for axes in figure.axes:
        assert [line.get_color() == "0.8" for line in axes.lines] == [True, False]


def test_a_cam_has_one_look_in_every_figure(figures: dict[str, Figure], cam_set: CamSet) -> None:
    """A cam has the same colour in every figure, for any order of the cams."""
    for ordered in (
        cam_set,
        CamSet(dict(reversed(cam_set.cams.items())), cam_set.laws, cam_set.rig),
    ):
        all_figures = {
            "overlay": law.cams_figure([(c, cam_set.laws[n]) for n, c in ordered.cams.items()]),
            **{name: figures[name] for name in ("jump", "lift-off", "vibration")},
        }
        for name, cam in ordered.cams.items():
            expected = web(cam_look(name).colour)
            for key, figure in all_figures.items():
                lines = [line for axes in figure.axes for line in axes.lines]
                colours = {x.get_color() for x in lines if cam.title in str(x.get_label())}
                assert colours == {expected}, key


@pytest.mark.parametrize(("count", "curves"), [(5, 0), (6, 1)])
def test_a_cubic_is_plotted_through_six_speeds_or_more(count: int, curves: int) -> None:
    """A cubic of sound level over speed is drawn only through six speeds or more.

    A cubic through fewer points would show features that were not measured.
    """
    loaded = open_scene(config_root() / "scenes" / "quick.yaml")
    levels = {"tm21": {rpm * RPM: 60.0 + 0.1 * rpm for rpm in np.linspace(200.0, 400.0, count)}}
    (axes,) = motion.noise_figure(compare(levels, {"tm21": "identified"}, None), loaded).axes
    ink = web(cam_look("tm21").colour)
    solid = [line for line in axes.lines if line.get_color() == ink and line.get_ls() == "-"]
    assert len(solid) == curves
    legend = [text.get_text() for text in axes.get_legend().get_texts()]
    assert ("cubic regression, simulated" in legend) == bool(curves)


def test_published_jump_speeds_are_marked_on_the_axis(jumps: JumpResult) -> None:
    """Each published jump speed has a marker on the speed axis of the figure.

    If two speeds are within 380 to 420 rpm, an inset enlarges that range.
    """
    rows = [replace(row, published_rpm=row.jump.rpm + 5.0) for row in jumps.rows]
    (axes,) = jump.figure(replace(jumps, rows=tuple(rows))).axes
    markers = [x for x in axes.lines if x.get_marker() == CARETUP and len(x.get_xdata())]
    assert [float(x.get_xdata()[0]) for x in markers] == [row.published_rpm for row in rows]
    for marker in markers:
        assert marker.get_transform() == axes.get_xaxis_transform()
    assert not axes.child_axes  # only one of the two is in 380 to 420 rpm
    twice = rows[1], replace(rows[1], cam="bezier15")
    (inset,) = jump.figure(replace(jumps, rows=twice)).axes[0].child_axes
    assert inset.get_xlim() == (380.0, 420.0)


def test_series_do_not_have_colours_of_cams() -> None:
    """Seven series that are not cams have different colours and dashes.

    No colour is that of a cam.
    """
    styles = [series(i) for i in range(7)]
    assert len({s["color"] for s in styles}) == len({str(s["ls"]) for s in styles}) == 7
    assert not {s["color"] for s in styles} & set(map(web, COLOURS))


def test_the_package_does_not_import_pyplot() -> None:
    """The modules of cam_rig.show do not import pyplot.

    Pyplot would need a screen, and change the global state of matplotlib.
    """
    code = (
        "import sys, pkgutil, cam_rig.show as plots\n"
        "for module in pkgutil.iter_modules(plots.__path__, 'cam_rig.show.'):\n"
        "    __import__(module.name)\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    assert ended(sys.executable, "-c", code).returncode == 0


# -- style: faults that a journal would not print


@pytest.fixture(scope="module")
def other_figures() -> dict[str, Figure]:
    """Figures that only Python users draw, by type.

    The tests of commands do not draw them.
    """
    curve = cam_rig.build_law(cam_rig.load_cam("poly345"))
    rig = load_rig(config_root() / "rigs" / "paper_table2.yaml")
    run = cam_rig.simulate(curve, rig, model="two_mass", rpm=450, turns=2, sample_rate=4800)
    angles = np.linspace(0.0, 360.0, 100)
    forces = [(rpm, angles, rpm * np.cos(np.radians(angles))) for rpm in (200.0, 300.0)]
    return {
        "motion": motion.motion_figure(run),
        "over the turn": motion.over_turn({"One": forces, "Another": forces}),
        "one cam": jump.jump_speed_figure(JumpSpeed(413.44 * RPM, 5.8, 0.1, curve, rig, 0.5)),
        "turn by turn": motion.turn_by_turn(SoundLevel(200.0, 85.0, 80.0 + np.arange(12.0), 2, "")),
    }


@pytest.mark.long
def test_figures_have_no_faults_of_style(other_figures: dict[str, Figure]) -> None:
    """Figures of `import cam_rig` have no cut, overlapping, small or untypeset text."""
    assert {name: f for name, figure in other_figures.items() if (f := faults(figure))} == {}


@styled
def _bad() -> Figure:
    out = empty(2.0)
    left, right = out.subplots(1, 2)
    left.set(title="a title that is much too long for the half of a page " * 2)
    left.set_xticks([0.5, 0.51], ["first tick", "second tick"])
    right.set_xlabel("-1 and 1e6", fontsize=6.0)
    right.plot([], [], label="a legend wider than its panel, " * 3)
    right.legend(loc="upper right")
    return out


def test_faults_lists_each_fault() -> None:
    """`faults` returns a line for each fault of a figure.

    The faults are text that is cut, overlaps, is too small or is not typeset.
    """
    lines = "\n".join(faults(_bad()))
    for fault in (
        ": cut",
        "'first tick' on 'second tick'",
        ": 6 pt",
        ": not typeset",
        "legend on another",
    ):
        assert fault in lines


def test_a_png_has_200_dots_per_inch(tmp_path: Path) -> None:
    """A PNG of full text width has 200 dots per inch."""
    write(_bad(), tmp_path / "a.png")
    assert Image.open(tmp_path / "a.png").width >= 200 * WIDTH - 1.0


def test_an_svg_is_reproducible_and_contains_no_pixels(tmp_path: Path) -> None:
    """Two SVG files of one figure are equal, and contain no image."""
    for name in "ab":
        write(_bad(), tmp_path / f"{name}.svg")
    first, second = ((tmp_path / f"{name}.svg").read_text().split("<defs>", 1)[1] for name in "ab")
    assert first == second
    assert "<image" not in first


def test_the_parameters_of_matplotlib_are_restored() -> None:
    """The style of cam_rig does not change matplotlib's parameters after a figure."""
    assert _bad() and mpl.rcParams["pdf.fonttype"] == 3 and not mpl.rcParams["axes.grid"]


def test_logarithmic_ticks() -> None:
    """A short logarithmic axis has ticks at 1, 3 and 10, and a long axis at decades.

    Large powers of ten are typeset.
    """
    figure = empty(2.0)
    for top, expected in ((100.0, ["1", "3", "10", "30", "100"]), (1e6, ["1", "100", "10⁴"])):
        axes = figure.add_subplot()
        axes.set(yscale="log", ylim=(1.0, top))
        logarithmic(axes.yaxis)
        labels = [axes.yaxis.get_major_formatter()(y) for y in axes.get_yticks() if 1 <= y <= top]
        assert set(expected) <= set(labels)
        assert ("3" in labels) == (top == 100.0)
        axes.remove()


# -- look of a cam: constant for a name, and distinct in grey and for colour-blind readers


#: Cams of Table 2 of the paper (see docs/glossary.md), which the report compares.
TABLE_2 = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")
#: Cams whose contact stress the report compares.
CONTACT = (*TABLE_2, "flat", "oscillating_flat", "point")


def test_every_shipped_cam_and_rise_is_listed_once() -> None:
    """Each shipped cam and rise has exactly one entry in the list of looks.

    A look is colour, dash pattern and marker. That of another name is derived from a hash of the
    name.
    """
    cams = {path.stem for path in (config_root() / "cams").glob("*.yaml")}
    assert len(LISTED_NAMES) == len(set(LISTED_NAMES))
    assert set(LISTED_NAMES) == (cams | set(NAMED_RISES)) - set(EQUAL_RISES)


def test_cams_shown_together_have_different_colours() -> None:
    """Cams that are drawn together have different colours.

    These are the cams of a scene, of Table 2 of the paper, or of the contact comparison.
    """
    scenes = [load_scene(path).cams for path in (config_root() / "scenes").glob("*.yaml")]
    tables = load_tables(config_root() / "published" / "tables" / "paper.yaml")
    assert list(tables.table_2_jump) == list(TABLE_2)
    for cams in (*scenes, CONTACT):
        assert len({of_cam(cam) for cam in cams}) == len(cams), cams


def test_lines_are_distinct_in_grey() -> None:
    """The lines of any two shipped cams or rises are distinct in grey.

    They differ in dash pattern or in marker.
    """
    listed = [cam_look(name) for name in LISTED_NAMES]
    pairs = {(str(look.dash), look.marker if look.marked else "") for look in listed}
    assert len(pairs) == len(LISTED_NAMES)
    assert len(set(map(str, DASHES))) == len(set(looks.MARKERS)) == len(COLOURS)


def test_points_are_distinct_in_grey() -> None:
    """Two cams that are compared and have the same marker differ in luminance.

    The difference is at least 0.1, so that they are distinct in grey.
    """
    compared = [cam_look(name) for name in ("tm21", *CONTACT)]
    for first, second in combinations(compared, 2):
        differ = abs(_luminance(first.colour) - _luminance(second.colour)) >= 0.1
        assert first.marker != second.marker or differ


def test_the_look_of_another_name_is_not_that_of_a_shipped_cam() -> None:
    """A name that is not shipped gets a look unlike those of the shipped cams.

    It has another pair of dash pattern and marker, and is the same in each process.
    """
    rng = np.random.default_rng(18)
    listed = {(str(look.dash), look.marker) for look in map(cam_look, LISTED_NAMES)}
    names = ["".join(rng.choice(list("abcdefgh_123"), 8)) for _ in range(300)]
    hashed = [cam_look(name) for name in names]
    assert not listed & {(str(look.dash), look.marker) for look in hashed}
    assert {look.colour for look in hashed} == set(COLOURS)
    assert cam_look("mine") == CamLook(0xEE6677FF, DASHES[3], "s", marked=True)


def test_equal_rises_have_one_look() -> None:
    """Rises with equal curves have the same look, and `EQUAL_RISES` lists them."""
    motions = {name: rise_curves(name).motion for name in NAMED_RISES}
    equal = [
        pair for pair in combinations(motions, 2) if np.array_equal(*(motions[n] for n in pair))
    ]
    assert sorted(tuple(sorted(pair)) for pair in equal) == sorted(EQUAL_RISES.items())
    assert all(cam_look(first) == cam_look(second) for first, second in equal)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (looks.web(cam_look("bezier15").colour), "#4477aa"),
        (looks.web(looks.tint(looks.BLUE)), "#bfdcec"),
        (looks.in_words("poly345"), "Polynomial 3-4-5"),
        (looks.in_words("bezier15"), "Bézier degree 15"),
        (looks.in_words("bezier4_start"), "Bézier degree 4, start"),
        (looks.in_words("tm21"), "TM21"),
        (looks.in_words("my_cam"), "My cam"),
        (looks.shortened("Polynomial 3-4-5", 16), "Polynomial 3-4-5"),
        (looks.shortened("Cam of the left inlet valve, v2", 16), "Cam of t…lve, v2"),
        (looks.four_digits(28706.4), "28710"),
        (looks.four_digits(-0.25), "−0.25"),
        (looks.log_tick(300.0), "300"),
        (looks.log_tick(3e-9), "3·10⁻⁹"),
    ],
)
def test_texts_of_pictures(text: str, expected: str) -> None:
    """Colour codes, titles, shortened titles and numbers are formatted as expected."""
    assert text == expected


def test_reach_and_distances() -> None:
    """`reach` is the half-width of an axis for a largest difference, with 15 % margin.

    It is 1 for a difference at the level of rounding. `distances` returns the distance of each
    point from a polyline.
    """
    assert (looks.reach(20.0), looks.reach(5e-9)) == (pytest.approx(23.0), 1.0)
    points, strip = np.array([[0.5, 2.0], [4.0, 4.0]]), np.array([[0.0, 0.0], [1.0, 0.0]])
    assert distances(points, strip).tolist() == [2.0, 5.0]


def _luminance(colour: int) -> float:
    """Return the relative luminance of an sRGB colour, from 0 to 1 (IEC 61966-2-1)."""
    channels = np.array([colour >> shift & 255 for shift in (24, 16, 8)]) / 255.0
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])

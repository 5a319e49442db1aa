"""Figures on paper say what they show, need no screen, and tell cams apart, in one style.

Every command's figures are checked for faults of that style where the command is tested (test/cli).
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
from cam_rig.show import looks as pictures
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
from cam_rig.simulation.asked import asked_cams
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

#: A quantity and its unit, as in "cam angle θ [°]".
LABEL = re.compile(r"\w.* \[[^\[\]]+\]", re.DOTALL)
DURATION, SPEED = 0.5, 460.0


@pytest.fixture(scope="module")
def cam_set() -> CamSet:
    """Two of the paper's cams on the rig of its Table 2."""
    return asked_cams(["bezier15", "poly345"], "paper_table2")


@pytest.fixture(scope="module")
def jumps(cam_set: CamSet) -> JumpResult:
    """Their jump speeds in half a second from rest."""
    return find_jumps(cam_set, {}, DURATION)


@pytest.fixture(scope="module")
def figures(cam_set: CamSet, jumps: JumpResult) -> dict[str, Figure]:
    """One of each kind that needs no long study."""
    cam, curve = cam_set.cams["poly345"], cam_set.laws["poly345"]
    return {
        "law": law.figure(cam, curve),
        "profile": profile.figure(cam, curve, check_cam(cam, curve)),
        "jump": jump.figure(jumps),
        "lift-off": jump.lift_off_figure(cam_set, SPEED),
        "vibration": vibration.figure(measure(cam_set, (300.0,))),
    }


def test_every_axis_has_its_quantity_and_unit(figures: dict[str, Figure]) -> None:
    """Every y, in small multiples at the left, and the x of the lowest panel at least."""
    for name, figure in figures.items():
        for axes in figure.axes:
            shared = name == "vibration" and not axes.get_subplotspec().is_first_col()
            assert shared or LABEL.fullmatch(axes.get_ylabel()), name
        assert any(LABEL.fullmatch(axes.get_xlabel()) for axes in figure.axes), name


def test_a_law_is_drawn_to_its_third_derivative(figures, cam_set):
    """Each panel's curve is the law's derivative in mm a power of rad."""
    curve = cam_set.laws["poly345"]
    for order, axes in enumerate(figures["law"].axes):
        angle, drawn = axes.lines[0].get_data()
        inside = np.isfinite(drawn) & (np.asarray(angle) < 360.0)
        value = curve(np.radians(np.asarray(angle)[inside]), order) * 1e3
        size = np.abs(value).max()
        away = ~np.isclose(np.asarray(drawn)[inside], value, rtol=0, atol=1e-9 * size)
        assert away.sum() <= 2 * curve.spans.size  # either side of a jump at a knot


def test_the_jump_speed_is_where_the_force_is_zero(figures, jumps):
    """A marker on the zero line for each cam, at the speed that was found."""
    axes = figures["jump"].axes[0]
    marked = [one.get_xydata() for one in axes.lines if one.get_marker() == "o"]
    expected = [[row.found.rpm, 0.0] for row in jumps.rows]
    np.testing.assert_array_equal(np.concatenate(marked), expected)


def test_the_gap_is_never_below_the_cam(figures: dict[str, Figure], cam_set: CamSet) -> None:
    """Whoever loses contact has a gap, whoever keeps it has none, to 1e-9 mm."""
    place, gap = figures["lift-off"].axes
    assert len(gap.lines) == len(cam_set.laws)
    for one, text in zip(gap.lines, place.get_legend().get_texts(), strict=True):
        values = np.asarray(one.get_ydata())
        assert values.min() > -1e-9
        assert (values.max() > 1e-6) == text.get_text().endswith("contact lost")


def test_vibration_is_at_the_speed_that_was_asked_for(figures: dict[str, Figure]) -> None:
    """The title says so; a column a cam, with four rows on a rig with a shaft, the others grey."""
    figure = figures["vibration"]
    assert figure.get_suptitle().startswith("Steady state at 300 rpm\n")
    assert len(figure.axes) == 4 * 2
    for axes in figure.axes:
        assert [one.get_color() == "0.8" for one in axes.lines] == [True, False]


def test_a_cam_looks_the_same_in_every_figure(figures: dict[str, Figure], cam_set: CamSet) -> None:
    """Colour and dash follow from the name, whatever the order; so does the viewer's colour."""
    for turned in (
        cam_set,
        CamSet(dict(reversed(cam_set.cams.items())), cam_set.laws, cam_set.rig),
    ):
        shown = {
            "overlay": law.cams_figure([(c, cam_set.laws[n]) for n, c in turned.cams.items()]),
            **{name: figures[name] for name in ("jump", "lift-off", "vibration")},
        }
        for name, cam in turned.cams.items():
            wanted = web(cam_look(name).colour)
            for key, figure in shown.items():
                curves = [one for axes in figure.axes for one in axes.lines]
                drawn = {one.get_color() for one in curves if cam.title in str(one.get_label())}
                assert drawn == {wanted}, key


@pytest.mark.parametrize(("count", "drawn"), [(5, 0), (6, 1)])
def test_no_cubic_through_fewer_than_six_speeds(count: int, drawn: int) -> None:
    """Four points determine one; it would show what nobody measured."""
    loaded = open_scene(config_root() / "scenes" / "quick.yaml")
    levels = {"tm21": {rpm * RPM: 60.0 + 0.1 * rpm for rpm in np.linspace(200.0, 400.0, count)}}
    (axes,) = motion.noise_figure(compare(levels, {"tm21": "identified"}, None), loaded).axes
    ink = web(cam_look("tm21").colour)
    solid = [one for one in axes.lines if one.get_color() == ink and one.get_ls() == "-"]
    assert len(solid) == drawn
    legend = [text.get_text() for text in axes.get_legend().get_texts()]
    assert ("cubic regression, simulated" in legend) == bool(drawn)


def test_published_jump_speeds_stand_below_the_axis(jumps: JumpResult) -> None:
    """Not on the speeds found: each at the foot, in its cam's colour; an inset where both lie."""
    rows = [replace(row, published_rpm=row.found.rpm + 5.0) for row in jumps.rows]
    (axes,) = jump.figure(replace(jumps, rows=tuple(rows))).axes
    foot = [one for one in axes.lines if one.get_marker() == CARETUP and len(one.get_xdata())]
    assert [float(one.get_xdata()[0]) for one in foot] == [row.published_rpm for row in rows]
    for one in foot:
        assert one.get_transform() == axes.get_xaxis_transform()
    assert not axes.child_axes  # only one of the two is in 380 to 420 rpm
    twice = rows[1], replace(rows[1], cam="bezier15")
    (inset,) = jump.figure(replace(jumps, rows=twice)).axes[0].child_axes
    assert inset.get_xlim() == (380.0, 420.0)


def test_curves_that_are_no_cams_have_no_cams_colour() -> None:
    """One cam at several speeds, masses of a stem: else a colour would be another cam's."""
    looks = [series(i) for i in range(7)]
    assert len({one["color"] for one in looks}) == len({str(one["ls"]) for one in looks}) == 7
    assert not {one["color"] for one in looks} & set(map(web, COLOURS))


def test_conjugate_discs_have_their_own_colours(cams, laws):
    """Both contours, each in the colour of its curvature."""
    cam, curve = cams["conjugate"], laws["conjugate"]
    figure = profile.figure(cam, curve, check_cam(cam, curve))
    plan, curvature, _ = figure.axes
    for axes in (plan, curvature):
        colours = {one.get_color() for one in axes.lines}
        assert set(map(web, pictures.DISCS)) <= colours


def test_no_screen_and_no_global_state_of_matplotlib() -> None:
    """None of the plots imports pyplot, which would choose how figures are shown."""
    code = (
        "import sys, pkgutil, cam_rig.show as plots\n"
        "for found in pkgutil.iter_modules(plots.__path__, 'cam_rig.show.'):\n"
        "    __import__(found.name)\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    assert ended(sys.executable, "-c", code).returncode == 0


# -- one style: what a journal prints, and nothing that a reader would stumble over --------------


@pytest.fixture(scope="module")
def drawn() -> dict[str, Figure]:
    """Figures of the library, one of each kind that no command's test writes, and some more."""
    curve = cam_rig.build_law(cam_rig.load_cam("poly345"))
    rig = load_rig(config_root() / "rigs" / "paper_table2.yaml")
    run = cam_rig.simulate(curve, rig, model="two_mass", rpm=450, turns=2, sample_rate=4800)
    times = np.linspace(0.0, 360.0, 100)
    forces = [(rpm, times, rpm * np.cos(np.radians(times))) for rpm in (200.0, 300.0)]
    return {
        "motion": motion.motion_figure(run),
        "over the turn": motion.over_turn({"One": forces, "Another": forces}),
        "one cam": jump.jump_speed_figure(JumpSpeed(413.44 * RPM, 5.8, 0.1, curve, rig, 0.5)),
        "turn by turn": motion.turn_by_turn(SoundLevel(200.0, 85.0, 80.0 + np.arange(12.0), 2, "")),
    }


@pytest.mark.long
def test_no_text_is_cut_or_small_or_on_another(drawn: dict[str, Figure]) -> None:
    """At 170 mm width all type is of 7 points or more, with a true minus and typeset powers."""
    assert {name: found for name, figure in drawn.items() if (found := faults(figure))} == {}


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


def test_a_faulty_figure_is_found() -> None:
    """Cut, overlapping, small, and what is not typeset: one line each."""
    found = "\n".join(faults(_bad()))
    for fault in (
        ": cut",
        "'first tick' on 'second tick'",
        ": 6 pt",
        ": not typeset",
        "legend on another",
    ):
        assert fault in found


def test_a_png_has_200_dots_per_inch(tmp_path: Path) -> None:
    """At the width of the page's text."""
    write(_bad(), tmp_path / "a.png")
    assert Image.open(tmp_path / "a.png").width >= 200 * WIDTH - 1.0


def test_an_svg_repeats_and_is_of_lines(tmp_path: Path) -> None:
    """The same identifiers in it each time, and no picture of pixels."""
    for name in "ab":
        write(_bad(), tmp_path / f"{name}.svg")
    one, other = ((tmp_path / f"{name}.svg").read_text().split("<defs>", 1)[1] for name in "ab")
    assert one == other
    assert "<image" not in one


def test_what_matplotlib_is_set_to_stays() -> None:
    """The style holds while a figure is drawn or written, and nowhere else."""
    assert _bad() and mpl.rcParams["pdf.fonttype"] == 3 and not mpl.rcParams["axes.grid"]


def test_logarithmic_ticks() -> None:
    """At 1, 3, 10 over few decades, at decades over many; powers beyond 1000 are typeset."""
    figure = empty(2.0)
    for top, shown in ((100.0, ["1", "3", "10", "30", "100"]), (1e6, ["1", "100", "10⁴"])):
        axes = figure.add_subplot()
        axes.set(yscale="log", ylim=(1.0, top))
        logarithmic(axes.yaxis)
        words = [axes.yaxis.get_major_formatter()(at) for at in axes.get_yticks() if 1 <= at <= top]
        assert set(shown) <= set(words)
        assert ("3" in words) == (top == 100.0)
        axes.remove()


# -- a cam has one look for ever: by its name, told apart by the colour-blind and in grey


#: Cams that the report draws on each other: of Table 2, and those whose contact is compared.
TABLE_2 = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")
CONTACT = (*TABLE_2, "flat", "oscillating_flat", "point")


def test_every_shipped_cam_and_rise_has_its_place_once() -> None:
    """The table is complete, so that no shipped name is hashed."""
    cams = {path.stem for path in (config_root() / "cams").glob("*.yaml")}
    assert len(NAMES) == len(set(NAMES)) and set(NAMES) == (cams | set(NAMED_RISES)) - set(SAME)


def test_cams_shown_together_have_different_colours() -> None:
    """Those of each shipped scene, of Table 2 and of the comparison of contacts."""
    scenes = [load_scene(path).cams for path in (config_root() / "scenes").glob("*.yaml")]
    tables = load_tables(config_root() / "published" / "tables" / "paper.yaml")
    assert list(tables.table_2_jump) == list(TABLE_2)
    for cams in (*scenes, CONTACT):
        assert len({of_cam(cam) for cam in cams}) == len(cams), cams


def test_lines_are_told_apart_in_grey() -> None:
    """Dash and, where it is drawn, marker: a pair of its own for every shipped name."""
    looks = [cam_look(name) for name in NAMES]
    assert len({(str(one.dash), one.marker if one.marked else "") for one in looks}) == len(NAMES)
    assert len(set(map(str, DASHES))) == len(set(pictures.MARKERS)) == len(COLOURS)


def test_points_are_told_apart_in_grey() -> None:
    """Two cams of one marker differ in colour, and their luminances by 10 % of white at least."""
    shown = [cam_look(name) for name in ("tm21", *CONTACT)]
    for one, other in combinations(shown, 2):
        differ = abs(_luminance(one.colour) - _luminance(other.colour)) >= 0.1
        assert one.marker != other.marker or differ


def test_a_name_of_ones_own_looks_like_no_shipped_cam() -> None:
    """Its pair of dash and marker is in no table; the look of a name is a constant, in any run."""
    rng = np.random.default_rng(18)
    shipped = {(str(look.dash), look.marker) for look in map(cam_look, NAMES)}
    names = ["".join(rng.choice(list("abcdefgh_123"), 8)) for _ in range(300)]
    looks = [cam_look(name) for name in names]
    assert not shipped & {(str(one.dash), one.marker) for one in looks}
    assert {one.colour for one in looks} == set(COLOURS)
    assert cam_look("mine") == CamLook(0xEE6677FF, DASHES[3], "s", marked=True)


def test_rises_that_are_one_curve_look_the_same() -> None:
    """The table of equal curves is true, and complete."""
    motions = {name: rise_curves(name).motion for name in NAMED_RISES}
    equal = [
        pair for pair in combinations(motions, 2) if np.array_equal(*(motions[n] for n in pair))
    ]
    assert sorted(tuple(sorted(pair)) for pair in equal) == sorted(SAME.items())
    assert all(cam_look(one) == cam_look(other) for one, other in equal)


@pytest.mark.parametrize(
    ("found", "shown"),
    [
        (pictures.web(cam_look("bezier15").colour), "#4477aa"),
        (pictures.web(pictures.tint(pictures.BLUE)), "#bfdcec"),
        (pictures.in_words("poly345"), "Polynomial 3-4-5"),
        (pictures.in_words("bezier15"), "Bézier degree 15"),
        (pictures.in_words("bezier4_start"), "Bézier degree 4, start"),
        (pictures.in_words("tm21"), "TM21"),
        (pictures.in_words("my_cam"), "My cam"),
        (pictures.shortened("Polynomial 3-4-5", 16), "Polynomial 3-4-5"),
        (pictures.shortened("Cam of the left inlet valve, v2", 16), "Cam of t…lve, v2"),
        (pictures.four_digits(28706.4), "28710"),
        (pictures.four_digits(-0.25), "−0.25"),
        (pictures.log_tick(300.0), "300"),
        (pictures.log_tick(3e-9), "3·10⁻⁹"),
    ],
)
def test_words_of_pictures(found: str, shown: str) -> None:
    """Names in words, titles that a legend holds, numbers as they are printed."""
    assert found == shown


def test_reach_and_distances() -> None:
    """An axis has room beyond a difference, and 1 where it is rounding; distances from a strip."""
    assert (pictures.reach(20.0), pictures.reach(5e-9)) == (pytest.approx(23.0), 1.0)
    points, strip = np.array([[0.5, 2.0], [4.0, 4.0]]), np.array([[0.0, 0.0], [1.0, 0.0]])
    assert distances(points, strip).tolist() == [2.0, 5.0]


def _luminance(colour: int) -> float:
    """Relative luminance of sRGB from 0 to 1 (IEC 61966-2-1)."""
    channels = np.array([colour >> shift & 255 for shift in (24, 16, 8)]) / 255.0
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])

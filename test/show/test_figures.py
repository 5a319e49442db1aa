"""Figures on paper say what they show, need no screen, and tell cams apart."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.markers import CARETUP

from cam_rig.laws import Law
from cam_rig.laws import figures as law
from cam_rig.laws import figures as law_overlay
from cam_rig.laws.cam import CamSet, open_cam_set
from cam_rig.paper.jump import figures as jump
from cam_rig.paper.jump.comparison import JumpResult, find_jumps
from cam_rig.paper.vibration import figures as vibration
from cam_rig.paper.vibration.study import measure
from cam_rig.profile import figures as profile
from cam_rig.profile.check_table import check_cam
from cam_rig.schema import CamConfig
from cam_rig.schema.load import config_root
from cam_rig.show.figure import series
from cam_rig.show.looks import COLOURS, DISCS, cam_look, web
from cam_rig.simulation import figures as noise
from cam_rig.simulation.regression import compare
from cam_rig.simulation.scene import open_scene
from cam_rig.units import RPM

#: A quantity and its unit, as in "cam angle θ [°]".
LABEL = re.compile(r"\w.* \[[^\[\]]+\]", re.DOTALL)
DURATION, SPEED = 0.5, 460.0


@pytest.fixture(scope="module")
def cam_set() -> CamSet:
    """Two of the paper's cams on the rig of its Table 2."""
    names = ("bezier15", "poly345")
    paths = [config_root() / "cams" / f"{name}.yaml" for name in names]
    return open_cam_set(paths, config_root() / "rigs" / "paper_table2.yaml")


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


def test_a_law_is_drawn_to_its_third_derivative(
    figures: dict[str, Figure], cam_set: CamSet
) -> None:
    """Each panel's curve is the law's derivative in mm a power of rad."""
    curve = cam_set.laws["poly345"]
    for order, axes in enumerate(figures["law"].axes):
        angle, drawn = axes.lines[0].get_data()
        inside = np.isfinite(drawn) & (np.asarray(angle) < 360.0)
        value = curve(np.radians(np.asarray(angle)[inside]), order) * 1e3
        size = np.abs(value).max()
        away = ~np.isclose(np.asarray(drawn)[inside], value, rtol=0, atol=1e-9 * size)
        assert away.sum() <= 2 * curve.spans.size  # either side of a jump at a knot


def test_the_jump_speed_is_where_the_force_is_zero(
    figures: dict[str, Figure], jumps: JumpResult
) -> None:
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
            "overlay": law_overlay.cams_figure(
                [(c, cam_set.laws[n]) for n, c in turned.cams.items()]
            ),
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
    (axes,) = noise.noise_figure(compare(levels, {"tm21": "identified"}, None), loaded).axes
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


def test_conjugate_discs_have_their_own_colours(
    cams: dict[str, CamConfig], laws: dict[str, Law]
) -> None:
    """Both contours, each in the colour of its curvature."""
    cam, curve = cams["conjugate"], laws["conjugate"]
    figure = profile.figure(cam, curve, check_cam(cam, curve))
    plan, curvature, _ = figure.axes
    for axes in (plan, curvature):
        colours = {one.get_color() for one in axes.lines}
        assert set(map(web, DISCS)) <= colours


def test_no_screen_and_no_global_state_of_matplotlib() -> None:
    """None of the plots imports pyplot, which would choose how figures are shown."""
    code = (
        "import sys, pkgutil, cam_rig.show as plots\n"
        "for found in pkgutil.iter_modules(plots.__path__, 'cam_rig.show.'):\n"
        "    __import__(found.name)\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=100)

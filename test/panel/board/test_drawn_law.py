"""A law as a linear function of its ordinates: it is the core's own, for any ordinates."""

from __future__ import annotations

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError
from cam_rig.law_design.space import events
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import joints
from cam_rig.panel.board.drawable import _nearest, as_b_splines, with_own_ordinates
from cam_rig.panel.board.drawn_law import ORDERS, DrawnLaw, table_angles
from cam_rig.schema import CamConfig, load_cam
from cam_rig.schema.segments import MAX_B_SPLINE_DEGREE

from ...conftest import CAM_NAMES, CONFIG

#: Laws in s and its derivatives agree within this part of their largest value.
SAME = 1e-12
OWN = ["bezier15", "designed"]


def load(name: str) -> CamConfig:
    return load_cam(CONFIG / "cams" / f"{name}.yaml")


def moved(drawn: DrawnLaw, by: float = 0.05) -> np.ndarray:
    """Every ordinate that may be moved somewhere else."""
    ordinates = drawn.ordinates.copy()
    free = [handle.index for handle in drawn.handles]
    ordinates[free] += by * np.random.default_rng(3).standard_normal(len(free))
    return ordinates


def from_table(drawn: DrawnLaw, ordinates: np.ndarray) -> np.ndarray:
    """``(4, n)`` as a page multiplies it."""
    table = drawn.table
    columns = table.first[:, None].astype(int) + np.arange(table.table.shape[2])
    return table.constant + np.einsum("okw,kw->ok", table.table, ordinates[columns])


@pytest.fixture(scope="module", params=CAM_NAMES)
def drawn(request: pytest.FixtureRequest) -> DrawnLaw:
    return DrawnLaw.of(load_cam(CONFIG / "cams" / f"{request.param}.yaml"))


@pytest.mark.variants(8)
def test_the_start_is_the_cams_law(drawn: DrawnLaw) -> None:
    """With its own ordinates the drawn law is the one that the core builds."""
    law = build_law(drawn.start.cam)
    found = drawn.law(drawn.ordinates, law.name)
    assert np.array_equal(found.breaks, law.breaks)
    assert np.abs(found.ordinates - law.ordinates).max() <= SAME * law.lift


@pytest.mark.variants(8)
def test_the_table_gives_the_law_at_any_ordinates(drawn: DrawnLaw) -> None:
    """s to s''' by the table are the core's; one ordinate off by 1e-6 shows."""
    ordinates = moved(drawn)
    law = drawn.law(ordinates, "moved")
    wanted = np.stack([law(table_angles(), order) for order in range(ORDERS)])
    largest = np.abs(wanted).max(axis=1, keepdims=True)
    assert (np.abs(from_table(drawn, ordinates) - wanted) / largest).max() <= SAME
    ordinates[drawn.handles[0].index] += 1e-6
    off = (np.abs(from_table(drawn, ordinates) - wanted) / largest).max(axis=1)
    assert (off > 1e3 * SAME).all()


@pytest.mark.variants(8)
def test_moved_ordinates_leave_dwells_and_joints_as_smooth_as_they_were(drawn: DrawnLaw) -> None:
    """What a page may move cannot tear the law, nor make its velocity jump."""
    before = {joint.angle: joint.continuity for joint in joints(drawn.start.law)}
    after = {j.angle: j.continuity for j in joints(drawn.law(moved(drawn), "moved"))}
    assert after.keys() == before.keys()
    assert all(after[angle] >= min(before[angle], 3) for angle in before)


@pytest.mark.variants(8)
def test_a_handle_is_where_its_ordinate_pulls(drawn: DrawnLaw) -> None:
    """Moving an ordinate moves the lift at its handle, the same way."""
    step = np.round(np.array([h.angle for h in drawn.handles]) / table_angles()[1]).astype(int)
    for handle, k in zip(drawn.handles, step % table_angles().size, strict=True):
        more = drawn.ordinates.copy()
        more[handle.index] += 1.0
        gained = from_table(drawn, more)[0] - from_table(drawn, drawn.ordinates)[0]
        assert gained[k] >= 0.5 * gained.max() > 0.0


@pytest.mark.parametrize("name", OWN)
def test_a_law_of_ordinates_has_its_own(name: str) -> None:
    """A Bézier or B-spline law is drawn as it is in its file, not another near it."""
    config = load_cam(CONFIG / "cams" / f"{name}.yaml")
    drawn = DrawnLaw.of(config)
    assert drawn.start.cam is config
    assert drawn.start.own
    assert drawn.start.distance == 0.0


def test_a_law_whose_ordinates_are_all_fixed_has_more_of_them() -> None:
    """Four ordinates at rest at each end of eight leave none to be moved."""
    config = load_cam(CONFIG / "cams" / "b_spline.yaml")
    own = with_own_ordinates(config)
    assert own is not None
    assert DrawnLaw(own).handles == []
    start = DrawnLaw.of(config).start
    assert not start.own
    assert start.exact


POLYNOMIAL = [name for name in CAM_NAMES if build_law(load(name)).degree <= MAX_B_SPLINE_DEGREE]


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", POLYNOMIAL)
def test_a_law_of_polynomials_is_drawn_exactly(name: str) -> None:
    """Knots between take nothing from a polynomial: its derivatives are the file's to rounding."""
    start, law = as_b_splines(load(name)), build_law(load(name))
    angles = np.linspace(0.0, 2.0 * np.pi, 1801)
    assert start.exact
    for order in range(3):
        wanted = law(angles, order)
        off = np.abs(start.law(angles, order) - wanted).max()
        assert off <= SAME * 10.0**order * law.lift


@pytest.mark.parametrize(
    ("name", "most"), [("cycloidal", 1e-6), ("tm21", 1e-6), ("trigonometric", 2e-5)]
)
def test_any_other_law_is_drawn_as_the_nearest(name: str, most: float) -> None:
    """How far it is from the file's law is what the page says, in lifts here."""
    start, law = DrawnLaw.of(load(name)).start, build_law(load(name))
    angles = np.linspace(0.0, 2.0 * np.pi, 1000)
    distance = np.abs(start.law(angles) - law(angles)).max()
    assert start.distance == pytest.approx(distance, rel=0.2)
    assert 0.0 < start.distance < most * law.lift
    assert not start.exact


@pytest.mark.parametrize("name", ["poly345", "cycloidal", "tm21", "modified_trapezoid"])
def test_what_is_drawn_jumps_at_the_speed_of_the_files_law(name: str) -> None:
    """Two masses feel the jerk at an event's ends: a law that rests there too is another."""
    rig = cam_rig.load_rig("paper_table2")
    drawn = cam_rig.jump_speed(DrawnLaw.of(load(name)).start.law, rig).rpm
    assert drawn == pytest.approx(cam_rig.jump_speed(build_law(load(name)), rig).rpm, rel=1e-4)


@pytest.mark.parametrize("name", ["poly345", "cycloidal", "measured", "half_rises"])
def test_joints_of_what_is_drawn_are_the_laws_own(name: str) -> None:
    """Neither rougher nor smoother where the law's pieces meet, and smooth between."""
    wanted = {round(j.angle, 9): j.continuity for j in joints(build_law(load(name)))}
    found = {round(j.angle, 9): j.continuity for j in joints(as_b_splines(load(name)).law)}
    assert {angle: found[angle] for angle in wanted} == wanted
    assert all(found[angle] == 4 for angle in found.keys() - wanted.keys())


def test_a_law_of_too_many_pieces_is_refused() -> None:
    """More ordinates than a file takes, with the remedy."""
    angles = np.linspace(0.0, 2.0 * np.pi, 601)
    rises = 1e-3 * (1.0 - np.cos(angles)) * (1.0 + 0.1 * np.cos(angles))
    law = Law("many", angles, np.stack([rises[:-1], rises[1:]]))
    (event,) = events(law, 0)
    with pytest.raises(ConfigError, match=r"too many pieces from 0° on.*allowed: 500"):
        _nearest(law, event)


def test_a_corner_of_a_law_stays_one() -> None:
    """Two straight flanks without a dwell between: the knot there is as many times as it can be."""
    cam = load("worked_example_constant_velocity").model_dump(exclude_none=True)
    half = {"assumed": 180.0, "unit": "deg", "source": "test"}
    rise = {"law": "constant_velocity", "span": half}
    cam["segments"] = [rise | {"to": 1.0}, rise | {"to": 0.0}]
    start = as_b_splines(CamConfig.model_validate(cam))
    assert start.exact
    assert {j.angle: j.continuity for j in joints(start.law)}[np.pi] == 0


def test_a_cam_that_rests_all_around_is_refused() -> None:
    """There is nothing to draw."""
    data = load_cam(CONFIG / "cams" / "poly345.yaml").model_dump(exclude_none=True)
    span = {"assumed": 360.0, "unit": "deg", "source": "all"}
    data |= {"segments": [{"law": "dwell", "span": span}]}
    with pytest.raises(ConfigError, match="rests all around"):
        DrawnLaw.of(CamConfig.model_validate(data))

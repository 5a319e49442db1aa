"""A law as a linear function of its ordinates: it is the core's own, for any ordinates."""

import numpy as np
import pytest

import cam_rig
from cam_rig import load_cam
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import joints
from cam_rig.panel.board.drawable import _nearest, to_b_splines, with_file_ordinates
from cam_rig.panel.board.drawn_law import ORDERS, DrawnLaw, table_angles
from cam_rig.schema.segments import MAX_B_SPLINE_DEGREE
from cam_rig.studies.design.space import events

from ..conftest import CAM_NAMES

#: Laws in s and its derivatives agree within this part of their largest value.
SAME = 1e-12


def moved(drawn, by=0.05):
    """Every ordinate that may be moved somewhere else."""
    ordinates = drawn.ordinates.copy()
    free = [handle.index for handle in drawn.handles]
    ordinates[free] += by * np.random.default_rng(3).standard_normal(len(free))
    return ordinates


def from_table(drawn, ordinates):
    """``(4, n)`` as a page multiplies it."""
    table = drawn.table
    columns = table.first[:, None].astype(int) + np.arange(table.table.shape[2])
    return table.constant + np.einsum("okw,kw->ok", table.table, ordinates[columns])


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", CAM_NAMES)
def test_what_is_drawn_is_a_law_at_any_ordinates(name):
    """By the page's table s to s''' are the core's; no handle tears it, each pulls at its own."""
    drawn = DrawnLaw.of(load_cam(name))
    law = build_law(drawn.start.cam)
    found = drawn.law(drawn.ordinates, law.name)
    assert np.array_equal(found.breaks, law.breaks)
    assert np.abs(found.ordinates - law.ordinates).max() <= SAME * law.lift

    ordinates = moved(drawn)
    law = drawn.law(ordinates, "moved")
    wanted = np.stack([law(table_angles(), order) for order in range(ORDERS)])
    largest = np.abs(wanted).max(axis=1, keepdims=True)
    assert (np.abs(from_table(drawn, ordinates) - wanted) / largest).max() <= SAME
    ordinates[drawn.handles[0].index] += 1e-6
    off = (np.abs(from_table(drawn, ordinates) - wanted) / largest).max(axis=1)
    assert (off > 1e3 * SAME).all()

    before = {joint.angle: joint.continuity for joint in joints(drawn.start.law)}
    after = {joint.angle: joint.continuity for joint in joints(law)}
    assert after.keys() == before.keys()
    assert all(after[angle] >= min(before[angle], 3) for angle in before)

    step = np.round(np.array([h.angle for h in drawn.handles]) / table_angles()[1]).astype(int)
    start = from_table(drawn, drawn.ordinates)[0]
    for handle, k in zip(drawn.handles, step % table_angles().size, strict=True):
        more = drawn.ordinates.copy()
        more[handle.index] += 1.0
        gained = from_table(drawn, more)[0] - start
        assert gained[k] >= 0.5 * gained.max() > 0.0


def test_a_law_of_ordinates_has_its_own_where_some_may_be_moved():
    """Four ordinates at rest at each end of eight leave none to be moved: such a law has more."""
    for name in ("bezier15", "designed"):
        config = load_cam(name)
        start = DrawnLaw.of(config).start
        assert start.cam is config and start.has_file_ordinates
        assert start.distance == 0.0
    own = with_file_ordinates(load_cam("b_spline"))
    assert DrawnLaw(own).handles == []
    start = DrawnLaw.of(load_cam("b_spline")).start
    assert not start.has_file_ordinates and start.exact


def test_a_law_of_polynomials_is_drawn_exactly():
    """Knots between take nothing from a polynomial: its derivatives are the file's to rounding."""
    angles, drawn = np.linspace(0.0, 2.0 * np.pi, 1801), 0
    for name in CAM_NAMES[::3]:
        law = build_law(load_cam(name))
        if law.degree > MAX_B_SPLINE_DEGREE:
            continue
        start, drawn = to_b_splines(load_cam(name)), drawn + 1
        assert start.exact, name
        for order in range(3):
            off = np.abs(start.law(angles, order) - law(angles, order)).max()
            assert off <= SAME * 10.0**order * law.lift, name
    assert drawn > 5


def test_any_other_law_is_drawn_as_the_nearest():
    """How far it is from the file's law is what the page says, in lifts here."""
    for name, most in (("cycloidal", 1e-6), ("tm21", 1e-6), ("trigonometric", 2e-5)):
        start, law = DrawnLaw.of(load_cam(name)).start, build_law(load_cam(name))
        angles = np.linspace(0.0, 2.0 * np.pi, 1000)
        distance = np.abs(start.law(angles) - law(angles)).max()
        assert start.distance == pytest.approx(distance, rel=0.2)
        assert 0.0 < start.distance < most * law.lift
        assert not start.exact


def test_what_is_drawn_jumps_at_the_speed_of_the_files_law():
    """Two masses feel the jerk at an event's ends: a law that rests there too is another."""
    rig = cam_rig.load_rig("paper_table2")
    for name in ("poly345", "cycloidal", "tm21", "modified_trapezoid"):
        drawn = cam_rig.jump_speed(DrawnLaw.of(load_cam(name)).start.law, rig).rpm
        own = cam_rig.jump_speed(build_law(load_cam(name)), rig).rpm
        assert drawn == pytest.approx(own, rel=1e-4), name


def test_joints_of_what_is_drawn_are_the_laws_own():
    """Neither rougher nor smoother where pieces meet, corners included, and smooth between."""
    corners = "worked_example_constant_velocity"
    for name in ("poly345", "cycloidal", "measured", "half_rises", corners):
        wanted = {round(j.angle, 9): j.continuity for j in joints(build_law(load_cam(name)))}
        found = {round(j.angle, 9): j.continuity for j in joints(to_b_splines(load_cam(name)).law)}
        assert {angle: found[angle] for angle in wanted} == wanted, name
        assert all(found[angle] == 4 for angle in found.keys() - wanted.keys())


def test_what_cannot_be_drawn_is_refused():
    """More ordinates than a file takes, with the remedy."""
    angles = np.linspace(0.0, 2.0 * np.pi, 601)
    rises = 1e-3 * (1.0 - np.cos(angles)) * (1.0 + 0.1 * np.cos(angles))
    law = Law("many", angles, np.stack([rises[:-1], rises[1:]]))
    (event,) = events(law, 0)
    with pytest.raises(ConfigError, match=r"too many pieces from 0° on.*allowed: 500"):
        _nearest(law, event)

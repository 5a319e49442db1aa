"""Law of the drawing board: linear in its ordinates, compared with the library."""

import numpy as np
import pytest

import cam_rig
from cam_rig import load_cam
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import joints
from cam_rig.panel.board.drawable import _nearest, to_b_splines, with_file_ordinates
from cam_rig.panel.board.drawn_law import DrawnLaw
from cam_rig.schema.segments import MAX_B_SPLINE_DEGREE
from cam_rig.studies.design.space import events

from ..conftest import CAM_NAMES

#: Tolerance of s and its derivatives, relative to their largest value.
RTOL = 1e-12


def moved(drawn, amount=0.05):
    """Return the ordinates with every free ordinate moved at random."""
    ordinates = drawn.ordinates.copy()
    free = [handle.index for handle in drawn.handles]
    ordinates[free] += amount * np.random.default_rng(3).standard_normal(len(free))
    return ordinates


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", CAM_NAMES)
def test_the_drawn_law_stays_smooth(name):
    """The start ordinates give the law of the file, and moved ones a law that is as smooth.

    Moving a handle makes no joint less smooth than it was, or than C3. At its own angle a handle
    has at least half of its largest effect.
    """
    drawn = DrawnLaw.of(load_cam(name))
    law = build_law(drawn.start.cam)
    start_law = drawn.law(drawn.ordinates, law.name)
    assert np.array_equal(start_law.breaks, law.breaks)
    assert np.abs(start_law.ordinates - law.ordinates).max() <= RTOL * law.lift

    law = drawn.law(moved(drawn), "moved")
    before = {joint.angle: joint.continuity for joint in joints(drawn.start.law)}
    after = {joint.angle: joint.continuity for joint in joints(law)}
    assert after.keys() == before.keys()
    assert all(after[angle] >= min(before[angle], 3) for angle in before)

    angles = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    step = np.round(np.array([h.angle for h in drawn.handles]) / angles[1]).astype(int)
    start = start_law(angles)
    for handle, k in zip(drawn.handles, step % angles.size, strict=True):
        more = drawn.ordinates.copy()
        more[handle.index] += 1.0
        effect = drawn.law(more, "more")(angles) - start
        assert effect[k] >= 0.5 * effect.max() > 0.0


def test_a_law_keeps_its_ordinates_if_some_may_be_moved():
    """A law given by ordinates is drawn with these if some of them are free.

    If no ordinate is free, B-splines replace them. An example is a law of eight ordinates, four of
    which are fixed at each end.
    """
    for name in ("bezier15", "designed"):
        config = load_cam(name)
        start = DrawnLaw.of(config).start
        assert start.cam is config and start.has_file_ordinates
        assert start.distance == 0.0
    file_cam = with_file_ordinates(load_cam("b_spline"))
    assert DrawnLaw(file_cam).handles == []
    start = DrawnLaw.of(load_cam("b_spline")).start
    assert not start.has_file_ordinates and start.exact


def test_a_law_of_polynomials_is_drawn_exactly():
    """A law of polynomials is converted to B-splines with equal derivatives.

    The tolerance is rounding.
    """
    angles, count = np.linspace(0.0, 2.0 * np.pi, 1801), 0
    for name in CAM_NAMES[::3]:
        law = build_law(load_cam(name))
        if law.degree > MAX_B_SPLINE_DEGREE:
            continue
        start, count = to_b_splines(load_cam(name)), count + 1
        assert start.exact, name
        for order in range(3):
            error = np.abs(start.law(angles, order) - law(angles, order)).max()
            assert error <= RTOL * 10.0**order * law.lift, name
    assert count > 5


def test_any_other_law_is_drawn_as_the_nearest_b_spline():
    """Another law is approximated by B-splines, and the largest error is reported.

    The error is below 2e-5 of the lift.
    """
    for name, limit in (("cycloidal", 1e-6), ("tm21", 1e-6), ("trigonometric", 2e-5)):
        start, law = DrawnLaw.of(load_cam(name)).start, build_law(load_cam(name))
        angles = np.linspace(0.0, 2.0 * np.pi, 1000)
        distance = np.abs(start.law(angles) - law(angles)).max()
        assert start.distance == pytest.approx(distance, rel=0.2)
        assert 0.0 < start.distance < limit * law.lift
        assert not start.exact


def test_the_drawn_law_has_the_jump_speed_of_the_files_law():
    """The jump speed of the drawn law is that of the law in the file, to 1e-4.

    Two masses are sensitive to the jerk at the ends of a rise or fall.
    """
    rig = cam_rig.load_rig("paper_table2")
    for name in ("poly345", "cycloidal", "tm21", "modified_trapezoid"):
        drawn_rpm = cam_rig.jump_speed(DrawnLaw.of(load_cam(name)).start.law, rig).rpm
        file_rpm = cam_rig.jump_speed(build_law(load_cam(name)), rig).rpm
        assert drawn_rpm == pytest.approx(file_rpm, rel=1e-4), name


def test_the_drawn_law_has_the_joints_of_the_files_law():
    """Each joint of the law in the file has the same continuity in the drawn law.

    All additional joints are C4.
    """
    corners = "worked_example_constant_velocity"
    for name in ("poly345", "cycloidal", "measured", "half_rises", corners):
        file_joints = {round(j.angle, 9): j.continuity for j in joints(build_law(load_cam(name)))}
        drawn_joints = {
            round(j.angle, 9): j.continuity for j in joints(to_b_splines(load_cam(name)).law)
        }
        assert {angle: drawn_joints[angle] for angle in file_joints} == file_joints, name
        assert all(drawn_joints[angle] == 4 for angle in drawn_joints.keys() - file_joints.keys())


def test_a_law_with_too_many_pieces_is_refused():
    """A law that needs more than 500 ordinates is refused, and the error states this."""
    angles = np.linspace(0.0, 2.0 * np.pi, 601)
    rises = 1e-3 * (1.0 - np.cos(angles)) * (1.0 + 0.1 * np.cos(angles))
    law = Law("many", angles, np.stack([rises[:-1], rises[1:]]))
    (event,) = events(law, 0)
    with pytest.raises(ConfigError, match=r"too many pieces from 0° on.*allowed: 500"):
        _nearest(law, event)

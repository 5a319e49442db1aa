"""What an ordinate moves: finite differences through the cam's file, closed forms of the reach."""

import numpy as np
import pytest

from cam_rig import load_cam
from cam_rig.laws import build_law
from cam_rig.paper.timing.events import DEGREE, PIECES, REACHED, held, shift_matrix
from cam_rig.paper.timing.study import CamTiming, EventControl, beside_b_spline


def timing_of(cam):
    return CamTiming.of(cam, build_law(cam))


def changed(cam, segment, change):
    """The cam with other ordinates in a segment, ``change`` in fractions of the lift."""
    values = (np.array(cam.segments[segment].ordinates.numbers) + change).tolist()
    quantity = {"assumed": values, "unit": "1", "source": "a test"}
    old = cam.segments[segment]
    new = type(old).model_validate({**old.model_dump(), "ordinates": quantity})
    segments = [*cam.segments[:segment], new, *cam.segments[segment + 1 :]]
    return cam.model_copy(update={"segments": segments})


@pytest.fixture(scope="module")
def bezier():
    return timing_of(load_cam("bezier15"))


@pytest.fixture(scope="module")
def beside(bezier):
    return beside_b_spline(bezier)


@pytest.mark.parametrize(("name", "segment"), [("bezier15", 0), ("b_spline", 1), ("b_spline", 3)])
def test_shifts_are_derivatives(name, segment):
    """Differences of the angles of the cam built anew; upwards, so that the lowest place stays."""
    cam, step = load_cam(name), 1e-5
    timing = timing_of(cam)
    ordinates = next(o for o in timing.ordinates if o.segment == segment)
    exact = shift_matrix(ordinates, timing.events, cam.lift.si)

    def angles(change):
        return np.array([event.angle for event in timing_of(changed(cam, segment, change)).events])

    for j in range(1, ordinates.values.size - 1):  # the first and last would step at the joint
        unit = np.eye(ordinates.values.size)[j] * step
        slope = (4.0 * angles(unit) - 3.0 * angles(0.0 * unit) - angles(2.0 * unit)) / (2.0 * step)
        assert np.abs(exact[:, j] - slope).max() < 1e-5 * np.abs(exact).max()


@pytest.mark.parametrize("name", ["bezier15", "b_spline", "poly4567"])
def test_all_together_lift_the_law(name):
    """Basis functions add up to one: all ordinates together move an event by −h/s'."""
    timing = timing_of(load_cam(name))
    for ordinates in timing.ordinates:
        for event in timing.events:
            if ordinates.breaks[0] < event.angle < ordinates.breaks[-1]:
                total = ordinates.shifts(event, 0.05).sum()
                assert total == pytest.approx(-0.05 / event.slope, rel=1e-12)


def test_reach_of_the_first(bezier):
    """(1 − u)^15 > r up to u = 1 − r^(1/15)."""
    (ordinates,) = bezier.ordinates
    exact = 2.0 * np.pi * (1.0 - REACHED ** (1.0 / 15.0))
    assert ordinates.reaches()[[0, -1]] == pytest.approx([exact, exact], rel=1e-12)


def test_reach_by_sampling(beside):
    """The part of the turn in which samples of the basis are above the bound."""
    for control in beside:
        (ordinates,) = control.timing.ordinates
        angles = np.linspace(0.0, 2.0 * np.pi, 4001)[:-1]
        above = np.stack([ordinates.at(angle) for angle in angles]) > REACHED
        sampled = 2.0 * np.pi * above.mean(axis=0)
        assert np.abs(ordinates.reaches() - sampled).max() < 2.0 * np.pi * 2.0 / 4000


def test_ordinates_that_joints_hold():
    """Equal ones hold a dwell, three on a line a slope, and the first always the level."""
    assert held([0.0, 0.0, 0.0, 1.0]) == 3
    assert held([0.0, 0.25, 0.5, 0.75, 0.75]) == 4
    assert held([0.0, 1.0, 3.0]) == 1
    free = {name: _free(load_cam(name)) for name in ("bezier15", "poly345", "half_rises")}
    assert free == {"bezier15": 8, "poly345": 0, "half_rises": 0}


def _free(cam):
    return sum(o.values[o.free].size for o in timing_of(cam).ordinates)


def test_the_b_spline_has_lift_and_events_of_the_curve(beside):
    """Its greatest lift, six angles, and the ends at rest; the laws are 1e-3 of the lift apart."""
    curve, spline = (control.timing for control in beside)
    for one, other in zip(curve.events, spline.events, strict=True):
        assert (one.level, one.rising) == (other.level, other.rising)
        assert one.angle == pytest.approx(other.angle, abs=1e-11)
    assert spline.law.lift == pytest.approx(curve.law.lift, rel=1e-12)
    angles = np.linspace(0.0, 2.0 * np.pi, 1001)
    assert np.abs(spline.law(angles) - curve.law(angles)).max() < 1e-3 * curve.law.lift
    assert all(abs(float(spline.law(0.0, order))) < 1e-9 for order in range(4))


def test_control_is_local(beside):
    """A B-spline's ordinate reaches no farther than n + 1 knot spans; a Bézier curve's do."""
    curve, spline = beside
    support = (DEGREE + 1) * 2.0 * np.pi / PIECES
    assert spline.reaches.max() <= support < curve.reaches.min()
    assert spline.within.mean() < curve.within.mean()


@pytest.mark.parametrize("which", [0, 1])
def test_one_event_alone(beside, which):
    """A thousandth of the change moves that event by a thousandth of a degree, the others not."""
    control: EventControl = beside[which]
    timing, (ordinates,) = control.timing, control.timing.ordinates
    shifts = shift_matrix(ordinates, timing.events, timing.cam.lift.si)[:, ordinates.free]
    for k, alone in enumerate(control.alone):
        change = np.zeros(ordinates.values.size)
        change[ordinates.free] = np.radians(1.0) * np.linalg.pinv(shifts)[:, k]
        assert np.abs(change).max() == pytest.approx(alone.ordinate, rel=1e-9)
        moved = timing_of(changed(timing.cam, 0, 1e-3 * change)).events
        found = [np.degrees(b.angle - a.angle) for a, b in zip(timing.events, moved, strict=True)]
        assert np.abs(np.array(found) - 1e-3 * np.eye(6)[k]).max() < 2e-5


def test_only_one_curve_has_a_spline_beside():
    """A cam of several segments has none."""
    assert beside_b_spline(timing_of(load_cam("poly345"))) == []

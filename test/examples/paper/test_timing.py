"""Tests of how the ordinates of a law shift the angles of its events.

Ordinates are the coefficients of the curve. An event here is the cam angle at which the lift passes
a given value, as in valve timing.
"""

import numpy as np
import pytest

from examples.paper import timing as script
from examples.paper.timing import REACHED, Curve, control_table, study


@pytest.fixture(scope="module")
def curves():
    """The Bézier curve of the paper, and a B-spline with the same events.

    An event is the angle at which the lift passes a given value.
    """
    return study()


def changed(curve, change):
    """Return a curve with changed ordinates. `change` is in multiples of the lift."""
    ordinates = (curve.ordinates + change).tolist()
    segment = curve.cam.segments[0].model_dump(exclude_none=True)
    segment["ordinates"] = ordinates
    return Curve(curve.cam.replace(segments=[segment]), curve.basis, np.array(ordinates))


@pytest.mark.parametrize("which", [0, 1])
def test_shifts_are_derivatives(curves, which):
    """The computed shift of each event per ordinate agrees with differences.

    An event is the angle at which the lift passes a given value. The differences are those of two
    changed cams. The tolerance is 1e-5 of the largest shift.
    """
    curve, step = curves[which], 1e-5
    for j in range(1, curve.ordinates.size - 1):  # the ends would step at the joint
        unit = np.eye(curve.ordinates.size)[j] * step
        one, two = (changed(curve, n * unit).angles for n in (1.0, 2.0))
        slope = (4.0 * one - 3.0 * curve.angles - two) / (2.0 * step)
        assert np.abs(curve.shifts[:, j] - slope).max() < 1e-5 * np.abs(curve.shifts).max()


@pytest.mark.parametrize("which", [0, 1])
def test_all_together_lift_the_law(curves, which):
    """If all ordinates rise together, an event moves by −h/s' per unit.

    An event is the angle at which the lift passes a given value. The basis functions add up to one,
    so the lift changes by h everywhere.
    """
    curve = curves[which]
    total = curve.shifts.sum(axis=1)
    assert total == pytest.approx(-curve.cam.lift.si / curve.law(curve.angles, 1), rel=1e-12)


def test_reach_of_the_first(curves):
    """The first ordinate of the Bézier 15 curve has an effect up to u = 1 − r^(1/15).

    There its basis function (1 − u)^15 falls to the threshold r. The computed end of the effect is
    sampled every 0.005°.
    """
    exact = 360.0 * (1.0 - REACHED ** (1.0 / 15.0))
    assert curves[0].reaches[[0, -1]] == pytest.approx([exact, exact], abs=0.005)


def test_the_b_spline_has_lift_and_events_of_the_curve(curves):
    """The B-spline has the lift and the six events of the Bézier curve.

    An event is the angle at which the lift passes a given value. The B-spline is at rest at its
    ends, and the laws differ by less than 1e-3 of the lift.
    """
    curve, spline = curves
    assert spline.angles == pytest.approx(curve.angles, abs=1e-11)
    assert spline.law.lift == pytest.approx(curve.law.lift, rel=1e-12)
    angles = np.linspace(0.0, 2.0 * np.pi, 1001)
    assert np.abs(spline.law(angles) - curve.law(angles)).max() < 1e-3 * curve.law.lift
    assert all(abs(float(spline.law(0.0, order))) < 1e-9 for order in range(4))


@pytest.mark.parametrize("which", [0, 1])
def test_one_event_alone(curves, which):
    """The computed change of ordinates moves a single event by 1°, and no other event.

    An event is the angle at which the lift passes a given value. A thousandth of the change moves
    it by 0.001° and all others by less than 2e-5°.
    """
    curve = curves[which]
    for k, (largest, _) in enumerate(curve.alone):
        change = np.zeros(curve.ordinates.size)
        change[curve.free] = np.radians(1.0) * np.linalg.pinv(curve.shifts[:, curve.free])[:, k]
        assert np.abs(change).max() == pytest.approx(largest, rel=1e-9)
        moved = np.degrees(changed(curve, 1e-3 * change).angles - curve.angles)
        assert np.abs(moved - 1e-3 * np.eye(6)[k]).max() < 2e-5


def test_numbers_of_the_report(curves):
    """The report's table on the control of events by ordinates is reproduced."""
    rows = [row[1:] for row in control_table(curves).for_report.text_rows]
    assert rows == [
        ["8", "234", "256", "3.5", "99.50", "330", "26.83", "314", "1.30", "307"],
        ["21", "61", "70", "1.1", "0.80", "92", "1.82", "103", "0.29", "107"],
    ]
    middle = script.ordinates_table(curves[0]).for_report.text_rows[7]
    assert middle == [
        *("7", "0.868", "yes", "256.0", "", "-0.0109", "-0.7072", "0.4119", "0.0028", "")
    ]


def test_the_script(printed_by):
    """The script prints the events of each cam of the paper's Table 2, and a summary.

    An event is the angle at which the lift passes a given value.
    """
    printed = printed_by(script)
    assert "the 1 % event alone by 1° takes ordinates changed by 99.5 % of the lift" in printed
    assert "43.663" in printed

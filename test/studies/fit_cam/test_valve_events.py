"""Valve events (opening, closing, duration) of a fitted law, and unusual lifts."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.studies.fit_cam.spline_fit import fit_spline
from cam_rig.studies.fit_cam.valve_events import ValveTrain, valve_events
from cam_rig.units import TURN

from .conftest import all_around, in_order


@pytest.mark.parametrize(("ratio", "lash"), [(1.0, 0.0), (1.5, 0.25e-3), (1.7, 0.0)])
@pytest.mark.parametrize("height", [0.15e-3, 1e-3, 1.27e-3, 5e-3])
def test_events_of_a_harmonic_law_in_closed_form(ratio, lash, height):
    """The valve events of a harmonic law equal their closed form within 1e-4 rad.

    The lift of the valve is ratio · s - lash with s = 4 mm (1 - cos θ), solved for θ.
    """
    fit = fit_spline(in_order(all_around(360), 0.004 * (1.0 - np.cos(all_around(360)))))
    (event,) = valve_events(fit.law, ValveTrain(ratio, lash, (height,)))
    opening = math.acos(1.0 - (height + lash) / (0.004 * ratio))
    assert event.opening == pytest.approx(opening, abs=1e-4)
    assert event.closing == pytest.approx(TURN - opening, abs=1e-4)
    assert event.duration == pytest.approx(TURN - 2.0 * opening, abs=1e-4)
    assert event.lobe_centre == pytest.approx(0.5 * TURN, abs=1e-6)


def test_a_height_that_the_valve_does_not_reach_has_no_event():
    """A valve lift that is not reached has no valve event, and the reason is reported.

    A lash that is larger than the lift is reported too.
    """
    fit = fit_spline(in_order(all_around(360), 0.004 * (1.0 - np.cos(all_around(360)))))
    for train, reason in (
        (ValveTrain(1.5, 1e-3, (0.012, 0.0121)), "No valve event at 12 mm and 12.1 mm: the valve"),
        (ValveTrain(lash=0.02), "the lash of 20 mm is not less than the lift of 8 mm."),
    ):
        assert valve_events(fit.law, train) == ()
        assert reason in " ".join(replace(fit, valve_train=train).conclusions())
    assert "No valve event" not in " ".join(fit.conclusions())


@pytest.mark.parametrize(("lift", "is_unusual"), [(0.254, True), (5e-5, True), (0.01, False)])
def test_an_unusual_lift_is_reported(lift, is_unusual):
    """A lift of 254 mm is reported as unusual, because its unit may be wrong.

    It may be 10 inches, for example.
    """
    fit = fit_spline(in_order(all_around(120), 0.5 * lift * (1.0 - np.cos(all_around(120)))))
    assert any("outside the usual size" in line for line in fit.conclusions()) == is_unusual

"""Segments joined into a law: levels carried on, steps refused, known values of shipped cams."""

import math

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, Interval
from cam_rig.errors import DynamicsError, LawError
from cam_rig.laws import bernstein, build_law
from cam_rig.units import TURN

from ..conftest import dwell, rise


def bezier(span, *ordinates):
    return {"law": "bezier", "span": span, "ordinates": list(ordinates)}


def test_levels_are_carried_on(make_cam):
    """A dwell rests where the rise before it ended; fractions are of the lift; the turn closes."""
    law = build_law(make_cam(rise(90, 0.25), dwell(90), rise(90, 1), rise(90, 0), lift=0.2))
    assert law(np.radians([135.0, 270.0])) == pytest.approx([0.05, 0.2], rel=1e-15)
    assert float(law(0.0)) == 0.0
    law = build_law(make_cam(dwell(90), rise(135, 0, "cycloidal"), rise(135, 1, "cycloidal")))
    assert float(law(0.5)) == pytest.approx(0.05, rel=1e-15)
    law = build_law(make_cam(bezier(360, 0, 0, 0.5, 1, 0.5, 0, 0), lift=0.1))
    np.testing.assert_allclose(law.ordinates[:, 0], [0, 0, 0.05, 0.1, 0.05, 0, 0], rtol=1e-15)


def test_spans_and_degrees(make_cam):
    """Joints stand where the spans sum up to, the last at 2π exactly; one degree holds them all."""
    law = build_law(make_cam(dwell(30), rise(100, 1, "poly4567"), dwell(130), rise(100, 0)))
    np.testing.assert_allclose(law.breaks, np.radians([0, 30, 130, 260, 360]), rtol=1e-15)
    assert law.breaks[-1] == TURN
    alone = build_law(make_cam(rise(180, 1), rise(180, 0)))
    beside = build_law(make_cam(rise(180, 1), rise(180, 0, "poly4567")))
    angles = np.linspace(0.0, np.pi, 101)
    assert (alone.degree, beside.degree) == (5, 7)
    np.testing.assert_allclose(beside(angles), alone(angles), rtol=0, atol=1e-16)


def test_a_step_is_refused(make_cam):
    """The error names cam, place and height."""
    arcs = {"law": "tangent_arcs", "span": 180, "nose_span": 130}
    for segments, where in (
        ([dwell(180), bezier(180, 0.5, 0, 0)], r"segments\[1\]"),
        ([bezier(360, 0, 0, 1)], r"steps by -1 of the lift"),
        ([rise(180, 1), arcs], r"segments\[1\] steps by -1 of"),
    ):
        with pytest.raises(LawError, match=rf"'steppy'.*{where}.*allowed: no step"):
            build_law(make_cam(*segments, name="steppy"))


def test_velocity_steps_and_discs_under_the_models(make_cam, follower):
    """An infinite force is refused by name; on a disc the contact force is the preload."""
    law = build_law(make_cam(bezier(180, 0, 1), bezier(180, 1, 0)))
    assert list(law.velocity_jumps.values()) == pytest.approx([0.1 / math.pi, -0.1 / math.pi])
    with pytest.raises(DynamicsError, match="velocity jumps by"):
        MODELS["kinetostatic"].advance(law, follower, None, Interval(0, 10**9, 0.0, 6.0), 1000)
    disc = build_law(make_cam(dwell(360)))
    assert disc.lift == 0.0
    for model in ("kinetostatic", "one_mass", "elastic_stem"):
        advance = MODELS[model].advance
        rows = advance(disc, follower, None, Interval(0, 10**9, 0.0, 40.0), 20_000)[1].rows
        np.testing.assert_allclose(rows[4], follower.preload, rtol=1e-12)


def test_the_ripple_of_bezier15(cams, laws):
    """Its high dwell is a ripple: 1.0059766 of the lift, Σ C(15,i) bᵢ / 2¹⁵, between two maxima."""
    numbers, law = cams["bezier15"].segments[0].ordinates.numbers, laws["bezier15"]
    exact = sum(math.comb(15, i) * b for i, b in enumerate(numbers)) / 2**15
    assert exact == pytest.approx(1.0059766, abs=5e-8)
    assert float(law(math.pi)) / cams["bezier15"].lift.si == pytest.approx(exact, rel=1e-14)
    places = bernstein.crossings(bernstein.derivative(law.ordinates[:, 0]))
    first = 0.43092834426506570  # root of the derivative in 40 digits
    assert places == pytest.approx([first, 0.5, 1.0 - first], abs=1e-12)


def test_lift_is_the_largest_displacement(cams, laws):
    """The config's lift, for Bézier 15 with its overshoot of 0.896 %; of a table its points'."""
    for name, law in laws.items():
        overshoot = 1.0089649 if name == "bezier15" else 1.0
        tolerance = 2e-3 if cams[name].files else 5e-8
        assert law.lift == pytest.approx(overshoot * cams[name].lift.si, rel=tolerance)

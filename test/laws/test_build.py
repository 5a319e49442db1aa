"""Segments joined into a law: levels carried on, and steps refused."""

import math

import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws import build_law
from cam_rig.units import TURN


def dwell(span):
    return {"law": "dwell", "span": span}


def rise(span, to, law="poly345"):
    return {"law": law, "span": span, "to": to}


def test_levels_are_carried_on(make_cam):
    """A dwell rests where the rise before it ended; fractions are of the lift."""
    law = build_law(make_cam(rise(90, 0.25), dwell(90), rise(90, 1), rise(90, 0), lift=0.2))
    assert float(law(np.radians(135.0))) == pytest.approx(0.05, rel=1e-15)
    assert float(law(np.radians(270.0))) == pytest.approx(0.2, rel=1e-15)
    assert float(law(0.0)) == 0.0


def test_first_dwell_rests_where_the_turn_ends(make_cam):
    """The turn is closed: a dwell at θ = 0 has the level the last rise leaves."""
    law = build_law(make_cam(dwell(90), rise(135, 0, "cycloidal"), rise(135, 1, "cycloidal")))
    assert float(law(0.5)) == pytest.approx(0.05, rel=1e-15)


def test_spans_are_the_segments(make_cam):
    """Joints stand where the spans sum up to, and the last at 2π exactly."""
    law = build_law(make_cam(dwell(30), rise(100, 1, "poly4567"), dwell(130), rise(100, 0)))
    np.testing.assert_allclose(law.breaks, np.radians([0, 30, 130, 260, 360]), rtol=1e-15)
    assert law.breaks[-1] == TURN


def test_bezier_ordinates_scale_with_the_lift(make_cam):
    """A Bézier segment's ordinates are fractions of the lift."""
    ordinates = [0, 0, 0.5, 1, 0.5, 0, 0]
    law = build_law(make_cam({"law": "bezier", "span": 360, "ordinates": ordinates}, lift=0.1))
    np.testing.assert_allclose(law.ordinates[:, 0], 0.1 * np.array(ordinates), rtol=1e-15)


def test_mixed_degrees_share_one(make_cam):
    """A rise keeps its values when a segment of higher degree stands beside it."""
    alone = build_law(make_cam(rise(180, 1), rise(180, 0)))
    beside = build_law(make_cam(rise(180, 1), rise(180, 0, "poly4567")))
    angles = np.linspace(0.0, np.pi, 101)
    assert (alone.degree, beside.degree) == (5, 7)
    np.testing.assert_allclose(beside(angles), alone(angles), rtol=0, atol=1e-16)


@pytest.mark.parametrize(
    ("segments", "where"),
    [
        ([dwell(180), {"law": "bezier", "span": 180, "ordinates": [0.5, 0, 0]}], r"segments\[1\]"),
        ([{"law": "bezier", "span": 360, "ordinates": [0, 0, 1]}], r"steps by -1 of the lift"),
        (
            [rise(180, 1), {"law": "tangent_arcs", "span": 180, "nose_span": 130}],
            r"segments\[1\] steps by -1 of",
        ),
    ],
)
def test_step_is_refused(make_cam, segments, where):
    """A displacement that jumps cannot be followed: the error names cam, place and height."""
    with pytest.raises(LawError, match=where) as caught:
        build_law(make_cam(*segments, name="steppy"))
    assert "'steppy'" in str(caught.value)
    assert "allowed: no step" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_velocity_step_is_refused_where_it_is_an_infinite_force(make_cam, follower):
    """Constant velocity up and down: the model without masses that give cannot take it."""
    from cam_rig.dynamics import MODELS, Interval
    from cam_rig.errors import DynamicsError

    up = {"law": "bezier", "span": 180, "ordinates": [0, 1]}
    down = {"law": "bezier", "span": 180, "ordinates": [1, 0]}
    law = build_law(make_cam(up, down))
    assert list(law.velocity_jumps.values()) == pytest.approx([0.1 / math.pi, -0.1 / math.pi])
    with pytest.raises(DynamicsError, match="velocity jumps by"):
        MODELS["kinetostatic"].advance(law, follower, None, Interval(0, 10**9, 0.0, 6.0), 1000)


def test_a_dwell_of_a_whole_turn_is_a_cam(make_cam, follower):
    """A disc: no lift, and the contact force is the preload at any speed."""
    from cam_rig.dynamics import MODELS, Interval

    law = build_law(make_cam({"law": "dwell", "span": 360}))
    assert law.lift == 0.0
    for model in ("kinetostatic", "one_mass", "elastic_stem"):
        advance = MODELS[model].advance
        rows = advance(law, follower, None, Interval(0, 10**9, 0.0, 40.0), 20_000)[1].rows
        np.testing.assert_allclose(rows[4], follower.preload, rtol=1e-12)

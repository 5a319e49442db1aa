"""Extremes of derivatives: closed forms, jumps from either side, and no sample beyond them."""

import numpy as np
import pytest

from cam_rig.laws import build_law
from cam_rig.laws.law import extremes, peak
from cam_rig.units import TURN


def test_no_sample_is_beyond_the_extremes(law):
    """The roots miss nothing: 20 000 samples stay between, for s to s'''."""
    angles = np.linspace(0.0, TURN, 20_001)
    for order in range(4):
        low, high = extremes(law, order)
        values, slack = law(angles, order), 1e-9 * max(abs(low.value), abs(high.value))
        assert values.max() <= high.value + slack
        assert values.min() >= low.value - slack


def test_extremes_are_reached(law):
    """At the angle of an extreme the law has that value, from one side of a joint at least."""
    for order in range(3):
        for extreme in extremes(law, order):
            hair = 1e-9
            sides = law(
                np.array([extreme.angle - hair, extreme.angle, extreme.angle + hair]), order
            )
            size = np.abs(law.derivative_ordinates(order)).max()
            assert np.abs(sides - extreme.value).min() <= 1e-6 * size


def test_peak_of_a_sine(make_cam):
    """Simple harmonic over 180° twice: s' is h/2·sin θ, s'' h/2·cos θ."""
    up, down = ({"law": "simple_harmonic", "span": 180, "to": to} for to in (1, 0))
    law = build_law(make_cam(up, down))
    low, high = extremes(law, 1)
    assert (low.value, high.value) == pytest.approx((-0.025, 0.025), rel=1e-13)
    assert (low.angle, high.angle) == pytest.approx((1.5 * np.pi, 0.5 * np.pi), abs=1e-6)
    assert abs(peak(law, 2).value) == pytest.approx(0.025, rel=1e-12)


def test_both_sides_of_a_jump_count(make_cam):
    """Constant velocity up quickly and down slowly: the larger slope is the peak."""
    law = build_law(
        make_cam(
            {"law": "constant_velocity", "span": 90, "to": 1},
            {"law": "constant_velocity", "span": 270, "to": 0},
        )
    )
    low, high = extremes(law, 1)
    assert high.value == pytest.approx(0.05 / (np.pi / 2), rel=1e-15)
    assert low.value == pytest.approx(-0.05 / (1.5 * np.pi), rel=1e-15)
    assert peak(law, 1) == high

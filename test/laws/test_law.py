"""The Law type: periodic, smooth as its family promises, symmetric, and strict about its arrays."""

import math

import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws import Law
from cam_rig.units import TURN

ANGLES = np.linspace(0.0, TURN, 1237, endpoint=False) + 1e-3
#: Highest derivative without a jump anywhere. Four ordinates of zero make Bézier 15 begin and end
#: C³; it is symmetric, so the fourth derivative agrees as well.
SMOOTHNESS = {"poly345": 2, "poly4567": 3, "cycloidal": 2, "bezier15": 4, "tm21": 1}


def size(law, order):
    """Largest value of a derivative, the scale its rounding is measured by."""
    return float(np.abs(law.derivative_ordinates(order)).max())


def test_periodic(law):
    """s(θ + 2π) = s(θ); the angle itself is rounded, so to its rounding times the slope."""
    tolerance = 50.0 * np.finfo(float).eps * (size(law, 0) + TURN * size(law, 1))
    np.testing.assert_allclose(law(ANGLES + TURN), law(ANGLES), rtol=0, atol=tolerance)
    np.testing.assert_allclose(law(ANGLES - 3 * TURN), law(ANGLES), rtol=0, atol=4 * tolerance)


@pytest.mark.variants(20)
@pytest.mark.parametrize("order", [1, 2, 3])
def test_derivatives_against_differences(law, order):
    """Each derivative is the central difference of the one before it, away from joints."""
    h = 1e-5
    near = np.abs(ANGLES[:, None] - law.breaks[None, :]).min(axis=1) < 2 * h
    inside = ANGLES[~near]
    difference = (law(inside + h, order - 1) - law(inside - h, order - 1)) / (2.0 * h)
    # truncation h²/6 of two orders up, and rounding eps/h of the order below
    tolerance = h**2 / 6 * size(law, order + 2) + 1e-14 / h * size(law, order - 1) * 10
    np.testing.assert_allclose(law(inside, order), difference, rtol=0, atol=tolerance)


def test_continuity_class(laws):
    """A law is smooth to the order its family promises (1e-9 of the size) and no further."""
    for name, promised in SMOOTHNESS.items():
        law = laws[name]
        for order in range(promised + 1):
            assert np.abs(law.jumps(order)).max() <= 1e-9 * size(law, order), (name, order)
        assert np.abs(law.jumps(promised + 1)).max() > 0.01 * size(law, promised + 1), name


def test_jerk_jump_of_345(cams, laws):
    """Where the 3-4-5 rise leaves the dwell the jerk jumps by 60 h/β³."""
    segment = cams["poly345"].segments[1]
    expected = 60.0 * cams["poly345"].lift.si / segment.span.si**3
    assert laws["poly345"].jumps(3)[1] == pytest.approx(expected, rel=1e-12)


#: Shipped cams that rise as they fall, about the middle of the low dwell.
SYMMETRIC = (
    *SMOOTHNESS,
    "arcs_convex",
    "arcs_straight",
    "b_spline",
    "bezier_segments",
    "half_rises",
    "modified_sine",
    "modified_trapezoid",
    "trigonometric",
)


@pytest.mark.parametrize("name", SYMMETRIC)
def test_symmetric(laws, name):
    """A cam that rises as it falls: s(−θ) = s(θ)."""
    law = laws[name]
    tolerance = 50.0 * np.finfo(float).eps * (size(law, 0) + TURN * size(law, 1))
    np.testing.assert_allclose(law(TURN - ANGLES), law(ANGLES), rtol=0, atol=tolerance)


def test_right_limit_at_a_joint(laws):
    """At a joint the piece that begins there is taken."""
    law = laws["poly345"]
    assert law(law.breaks[1], 3) == pytest.approx(law.derivative_ordinates(3)[0, 1], rel=1e-12)


def test_lift_bounds_all_samples(law):
    """No sample lies outside the lift, and some come near its ends."""
    values = law(np.linspace(0.0, TURN, 20001))
    assert values.max() - values.min() <= law.lift * (1.0 + 1e-14)
    assert values.max() - values.min() > law.lift * (1.0 - 1e-6)


def test_motion_holds_three_derivatives(law):
    """`motion` are the ordinates of s, s', s'' of each piece."""
    for order in range(3):
        np.testing.assert_array_equal(law.motion[order], law.derivative_ordinates(order))


def test_arrays_are_frozen_copies():
    """A law cannot be changed through its arrays, nor through those it was made of."""
    ordinates = np.zeros((4, 1))
    law = Law("flat", np.array([0.0, TURN]), ordinates)
    ordinates[0] = 1.0
    assert law.ordinates[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        law.ordinates[0] = 1.0


GOOD = np.array([0.0, 1.0, TURN])


@pytest.mark.parametrize(
    ("breaks", "ordinates", "words"),
    [
        (GOOD, np.zeros((4, 3)), "n pieces need n \\+ 1 breakpoints"),
        (GOOD, np.zeros(3), "do not fit"),
        (GOOD, np.full((4, 2), np.nan), "must be finite"),
        (np.array([0.0, np.inf, TURN]), np.zeros((4, 2)), "must be finite"),
        (np.array([0.0, 1.0, 6.0]), np.zeros((4, 2)), "rise from 0 to 2π, got .*6"),
        (np.array([0.0, 7.0, TURN]), np.zeros((4, 2)), "rise from 0 to 2π"),
        (np.array([0.0, 0.0, TURN]), np.zeros((4, 2)), "rise from 0 to 2π"),
        (np.array([0.1, 1.0, TURN]), np.zeros((4, 2)), "rise from 0 to 2π, got .*0\\.1"),
    ],
)
def test_bad_arrays_are_refused(breaks, ordinates, words):
    """Arrays that are no law raise an error that names the law and the fault."""
    with pytest.raises(LawError, match=words) as caught:
        Law("crooked", breaks, ordinates)
    assert "'crooked'" in str(caught.value)


@pytest.mark.parametrize(
    ("angle", "words"),
    [
        (math.nan, "angle is nan"),
        (-math.inf, "angle is -inf"),
        ([0.0, 1.0, math.nan], r"angle\[2\] is nan"),
        ([[0.0, math.inf], [0.0, 0.0]], r"angle\[0, 1\] is inf"),
        (None, "angle is nan"),
        (10**400, r"no number a float holds.*\(int\)"),
        ("a turn", r"no number a float holds.*\(str\)"),
        ([0.0, "a"], r"no number a float holds.*\(list\)"),
    ],
)
def test_an_angle_that_is_no_number_is_refused(laws, angle, words):
    """In a line with its place: no NaN goes through, and no warning of numpy's."""
    with pytest.raises(LawError, match=f"{words}.*allowed: finite angles in rad"):
        laws["poly345"](angle)


@pytest.mark.parametrize("order", [-1, 0.5, math.nan, math.inf, None, "1"])
def test_an_order_that_is_none_is_refused(laws, order):
    """In a line."""
    with pytest.raises(LawError, match="allowed: 0, 1, 2"):
        laws["poly345"](0.0, order)


def test_beyond_the_degree_all_derivatives_are_zero(laws):
    """Of any order, however large."""
    for order in (laws["poly345"].degree + 1, 50, 10**9):
        assert not laws["poly345"](np.linspace(0.0, 6.0, 9), order).any()

"""The type Law: periodicity, extremes, classes of joints, and validation."""

import math

import numpy as np
import pytest
from scipy.interpolate import BPoly, PPoly

from cam_rig.errors import LawError
from cam_rig.laws import Law, bernstein, build_law
from cam_rig.laws.law import MAX_CONTINUITY, continuity, extremes, joints
from cam_rig.units import TURN

from ..conftest import dwell, rise

ANGLES = np.linspace(0.0, TURN, 1237, endpoint=False) + 1e-3
EPS = np.finfo(float).eps
#: Class of the roughest joint of each shipped cam. With four ordinates of zero at each end Bézier
#: 15 is C³ at θ = 0. It is symmetric, so the fourth derivative is continuous as well.
CLASSES = {
    0: "worked_example_constant_velocity",
    1: "arcs_centres arcs_convex arcs_straight tm21 worked_example_harmonic",
    2: "cycloidal modified_sine modified_trapezoid poly345 worked_example_quintic",
    3: "b_spline bezier_segments poly4567",
    4: "bezier15 half_rises measured trigonometric",
}
#: Shipped cams that are symmetric about the middle of the low dwell.
SYMMETRIC = {
    *("poly345", "poly4567", "cycloidal", "bezier15", "tm21", "arcs_convex", "arcs_straight"),
    *("b_spline", "bezier_segments", "half_rises", "modified_sine", "modified_trapezoid"),
    "trigonometric",
}


def size(law, order):
    """Return the largest value of a derivative, to which its rounding is relative."""
    return float(np.abs(law.derivative_ordinates(order)).max())


def test_laws_are_periodic_and_symmetric(followable_laws):
    """A law has s(θ + 2π) = s(θ), and a symmetric law s(−θ) = s(θ).

    The tolerance is the rounding of the angle times the slope.
    """
    for name, law in followable_laws.items():
        tolerance = 50.0 * EPS * (size(law, 0) + TURN * size(law, 1))
        np.testing.assert_allclose(law(ANGLES + TURN), law(ANGLES), rtol=0, atol=tolerance)
        np.testing.assert_allclose(law(ANGLES - 3 * TURN), law(ANGLES), rtol=0, atol=4 * tolerance)
        if name in SYMMETRIC:
            np.testing.assert_allclose(law(TURN - ANGLES), law(ANGLES), rtol=0, atol=tolerance)


def test_derivatives_are_central_differences(followable_laws):
    """Each derivative is the central difference of the one before it, off the joints."""
    h = 1e-5
    for law in followable_laws.values():
        inside = ANGLES[np.abs(ANGLES[:, None] - law.breaks).min(axis=1) >= 2 * h]
        for order in (1, 2, 3):
            difference = (law(inside + h, order - 1) - law(inside - h, order - 1)) / (2.0 * h)
            # truncation h²/6 of two orders up, and rounding eps/h of the order below
            tolerance = h**2 / 6 * size(law, order + 2) + 1e-13 / h * size(law, order - 1)
            np.testing.assert_allclose(law(inside, order), difference, rtol=0, atol=tolerance)
        assert not any(law(inside, order).any() for order in (law.degree + 1, 50, 10**9))


def test_shipped_laws_have_the_class_of_their_family(laws):
    """Each shipped law has exactly the class of its family."""
    for promised, names in CLASSES.items():
        for name in names.split():
            assert continuity(laws[name]) == promised, name


def test_extremes_bound_all_samples_and_are_reached(followable_laws):
    """The extremes of a law bound 20 000 samples and are reached at their angles."""
    angles, offsets = np.linspace(0.0, TURN, 20_001), np.array([-1e-9, 0.0, 1e-9])
    for law in followable_laws.values():
        for order in range(4):
            ends, values = extremes(law, order), law(angles, order)
            slack = 1e-9 * max(abs(end.value) for end in ends)
            assert ends[0].value - slack <= values.min() <= values.max() <= ends[1].value + slack
            if order == 0:
                assert 1.0 - 1e-6 < np.ptp(values) / law.lift <= 1.0 + 1e-14
            for end in ends if order < 3 else ():
                error = np.abs(law(end.angle + offsets, order) - end.value).min()
                assert error <= 1e-6 * size(law, order)
            if order < 3:
                np.testing.assert_array_equal(law.motion[order], law.derivative_ordinates(order))


def test_arrays_are_frozen_copies():
    ordinates = np.zeros((4, 1))
    law = Law("flat", np.array([0.0, TURN]), ordinates)
    ordinates[0] = 1.0
    assert law.ordinates[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        law.ordinates[0] = 1.0


def test_invalid_arrays_angles_and_orders_are_refused(laws):
    """Invalid arrays, angles and orders raise an error with the law and the index.

    No NaN is accepted, and numpy does not warn.
    """
    valid, two = [0.0, 1.0, TURN], np.zeros((4, 2))
    for breaks, ordinates, message in (
        (valid, np.zeros((4, 3)), "n pieces need n \\+ 1 breakpoints"),
        (valid, np.zeros(3), "do not fit"),
        (valid, np.full((4, 2), np.nan), "must be finite"),
        ([0.0, np.inf, TURN], two, "must be finite"),
        ([0.0, 1.0, 6.0], two, "rise from 0 to 2π, got .*6"),
        ([0.0, 0.0, TURN], two, "rise from 0 to 2π"),
        ([0.1, 1.0, TURN], two, "rise from 0 to 2π, got .*0\\.1"),
    ):
        with pytest.raises(LawError, match=f"'crooked'.*{message}"):
            Law("crooked", breaks, ordinates)
    for angle, message in (
        (math.nan, "angle is nan"),
        ([0.0, 1.0, math.nan], r"angle\[2\] is nan"),
        ([[0.0, math.inf], [0.0, 0.0]], r"angle\[0, 1\] is inf"),
        (None, "angle is nan"),
        (-1e17, "angle is -1e\\+17"),
        (10**400, r"not a number that a float can represent.*\(int\)"),
        ("a turn", r"not a number that a float can represent.*\(str\)"),
    ):
        with pytest.raises(LawError, match=f"{message}.*allowed: finite angles in rad"):
            laws["poly345"](angle)
    for order in (-1, 0.5, math.nan, math.inf, None, "1"):
        with pytest.raises(LawError, match="allowed: 0, 1, 2"):
            laws["poly345"](0.0, order)


def test_a_jump_of_one_derivative_is_found(laws):
    """The continuity of a joint is that of its lowest derivative that jumps.

    t^r/r! at a joint jumps by 1 in the r-th derivative, and a split is smooth.
    """
    breaks, degree = np.array([0.0, np.pi, TURN]), 6
    for order in range(5):
        powers = np.zeros((degree + 1, 2))
        powers[degree - order, 1] = 1.0 / math.factorial(order)
        kinked = Law("kinked", breaks, BPoly.from_power_basis(PPoly(powers, breaks)).c)
        joint = joints(kinked)[1]
        assert (joint.continuity, joint.angle) == (order - 1, np.pi)
        assert joint.jump == pytest.approx(1.0, rel=1e-9)
    left, right = bernstein.split(laws["bezier15"].ordinates[:, 0], 0.3)
    cut = Law("cut", np.array([0.0, 0.3 * TURN, TURN]), np.stack([left, right], axis=1))
    assert joints(cut)[1].continuity == MAX_CONTINUITY


def test_a_sharp_piece_hides_no_joint_of_another(make_cam):
    """A rise over 1° does not change the continuity class of other joints.

    Its derivatives are a million times those of the others.
    """
    for law, order in (("cycloidal", 2), ("poly4567", 3)):
        sharp = (dwell(30), rise(1, 0.9, law), dwell(29), rise(120, 0, law))
        all_joints = joints(build_law(make_cam(dwell(60), rise(120, 1, law), *sharp)))
        classes = {round(np.degrees(joint.angle), 6): joint.continuity for joint in all_joints}
        ends = (0.0, 60.0, 180.0, 210.0, 211.0, 240.0)
        assert [classes.pop(angle) for angle in ends] == 6 * [order]
        assert set(classes.values()) <= {MAX_CONTINUITY}
    segments = (rise(120, 1), dwell(30), dwell(0.5), rise(120, 0), dwell(89.5))
    all_joints = joints(build_law(make_cam(*segments)))
    assert [joint.continuity for joint in all_joints] == [2, 2, MAX_CONTINUITY, 2, 2]


def test_the_turns_end_joins_its_start(make_cam):
    """The joint at θ = 0 is between the last and the first piece.

    Its jump of slope is in m/rad.
    """
    law = build_law(make_cam({"law": "bezier", "span": 360, "ordinates": [0, 2, 0]}))
    (joint,) = joints(law)
    assert (joint.angle, joint.continuity) == (0.0, 0)
    assert joint.jump == pytest.approx(2 * 4 * 0.05 / TURN, rel=1e-12)

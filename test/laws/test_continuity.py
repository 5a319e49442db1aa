"""The class at each joint: what the families promise, and jumps of a known size."""

import numpy as np
import pytest

from cam_rig.laws import Law, build_law
from cam_rig.laws.law import SMOOTHEST, continuity, joints
from cam_rig.units import TURN

#: Class of each shipped cam's roughest joint.
SHIPPED = {
    "arcs_centres": 1,
    "arcs_convex": 1,
    "arcs_straight": 1,
    "b_spline": 3,
    "bezier15": 4,
    "bezier_segments": 3,
    "cycloidal": 2,
    "half_rises": 4,
    "measured": 4,
    "modified_sine": 2,
    "modified_trapezoid": 2,
    "poly345": 2,
    "poly4567": 3,
    "tm21": 1,
    "trigonometric": 4,
    "worked_example_constant_velocity": 0,
    "worked_example_harmonic": 1,
    "worked_example_quintic": 2,
}


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_laws_are_of_their_class(laws, name):
    """No smoother and no rougher than the family promises."""
    assert continuity(laws[name]) == SHIPPED[name]


@pytest.mark.parametrize("order", range(5))
def test_a_jump_of_one_derivative_is_found(order):
    """t^r/r! on one side of a joint jumps by one in the r-th derivative, and nowhere else."""
    degree = 6
    from scipy.interpolate import BPoly, PPoly

    powers = np.zeros((degree + 1, 2))
    powers[degree - order, 1] = 1.0 / np.prod(np.arange(1, order + 1))
    breaks = np.array([0.0, np.pi, TURN])
    bernstein = BPoly.from_power_basis(PPoly(powers, breaks))
    joint = joints(Law("kinked", breaks, bernstein.c))[1]
    assert joint.continuity == order - 1
    assert joint.angle == np.pi
    assert joint.jump == pytest.approx(1.0, rel=1e-9)


def test_halves_of_one_curve_do_not_jump(laws):
    """A curve cut in two is as smooth at the cut as anywhere, at any degree."""
    from cam_rig.laws import bernstein

    column = laws["bezier15"].ordinates[:, 0]
    left, right = bernstein.split(column, 0.3)
    cut = Law("cut", np.array([0.0, 0.3 * TURN, TURN]), np.stack([left, right], axis=1))
    assert joints(cut)[1].continuity == SMOOTHEST


@pytest.mark.parametrize("law", ["cycloidal", "poly4567"])
def test_a_sharp_piece_hides_no_joint_of_another(make_cam, law):
    """A rise over 1°, whose derivatives are a million times the others', changes no class."""
    segments = [
        {"law": "dwell", "span": 60},
        {"law": law, "span": 120, "to": 1},
        {"law": "dwell", "span": 30},
        {"law": law, "span": 1, "to": 0.9},
        {"law": "dwell", "span": 29},
        {"law": law, "span": 120, "to": 0},
    ]
    found = {
        round(np.degrees(j.angle), 6): j.continuity for j in joints(build_law(make_cam(*segments)))
    }
    own = {"cycloidal": 2, "poly4567": 3}[law]
    assert [found[angle] for angle in (0.0, 60.0, 180.0, 210.0, 211.0, 240.0)] == 6 * [own]
    inside = set(found) - {0.0, 60.0, 180.0, 210.0, 211.0, 240.0}
    assert all(found[angle] == SMOOTHEST for angle in inside)


def test_dwells_that_meet_are_smooth(make_cam):
    """Nothing moves on either side, so nothing but rounding could jump."""
    law = build_law(
        make_cam(
            {"law": "poly345", "span": 120, "to": 1},
            {"law": "dwell", "span": 30},
            {"law": "dwell", "span": 0.5},
            {"law": "poly345", "span": 120, "to": 0},
            {"law": "dwell", "span": 89.5},
        )
    )
    assert [joint.continuity for joint in joints(law)] == [2, 2, SMOOTHEST, 2, 2]


def test_the_end_of_the_turn_is_a_joint(make_cam):
    """At θ = 0 the last piece meets the first."""
    law = build_law(make_cam({"law": "bezier", "span": 360, "ordinates": [0, 1, 0]}))
    (joint,) = joints(law)
    assert (joint.angle, joint.continuity) == (0.0, 0)
    assert joint.jump == pytest.approx(2 * 2 * 0.05 / TURN, rel=1e-12)


def test_a_mismatch_of_slope_is_told_with_its_size(make_cam):
    """A half-rise beside a straight part of another slope: C0, and the jump in m/rad."""
    law = build_law(
        make_cam(
            {"law": "bezier4_start", "span": 60, "to": 0.5},  # leaves at 2·0.5 of the lift per 60°
            {"law": "constant_velocity", "span": 60, "to": 0.75},
            {"law": "bezier4_end", "span": 60, "to": 1},
            {"law": "poly345", "span": 180, "to": 0},
        )
    )
    joint = joints(law)[1]
    assert joint.continuity == 0
    assert joint.jump == pytest.approx((0.25 - 1.0) * 0.05 / np.radians(60.0), rel=1e-12)

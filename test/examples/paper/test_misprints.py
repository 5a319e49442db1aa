"""Tests of misprints in the sources (the paper, two theses, a worked example).

Each function computes an identity that a formula must satisfy. It returns the error of the identity
with the printed formula, the error with the corrected formula, and the largest error that a correct
formula may have.
"""

from math import comb

import numpy as np
import pytest
from scipy.interpolate import BPoly, BSpline

import cam_rig
from cam_rig.laws.segments import unit_rise
from cam_rig.schema.load import config_root, load_published
from examples.paper.misprints import MISPRINTS

U = np.linspace(0.0, 1.0, 201)
THETA = np.linspace(0.1, 6.0, 60)
STEP = 1e-5
#: Error of a central difference of second order, for values of the order of 1.
DIFFERENCE = 1e-8
PRINTED_JUMPS = (570, 415, 390, 410, 400)  # rpm, Table 2 of the paper


def difference(function, at):
    """Return the derivative of a function by a central difference."""
    return (function(at + STEP) - function(at - STEP)) / (2.0 * STEP)


def largest(error):
    return np.abs(error).max()


def eq_2():
    """Return the errors of eq. 2 of the paper, the polynomial of the Bézier 15 law.

    Identity: its coefficients are the ordinates times the binomials.
    """
    law = cam_rig.build_law(cam_rig.load_cam("bezier15"))
    ordinates = np.zeros(16)
    for number, value in ((4, 1.5), (5, 1.5), (6, 0.868), (7, 0.868)):
        ordinates[[number, 15 - number]] = value

    def error(fifth, sixth):
        found = [0, 0, 0, 0, 2047.5, fifth, sixth, 5585.58]
        found = np.array(found + found[::-1])
        return largest(found - ordinates * [comb(15, k) for k in range(16)])

    curve = BPoly(ordinates[:, None], [0.0, 1.0])
    lift = law(2.0 * np.pi * U) / law(2.0 * np.pi * 0.5) * curve(0.5)
    assert largest(curve(U) - lift) < 1e-12
    return error(45045, 434434), error(4504.5, 4344.34), 1e-9


def eq_20():
    """Return the errors (dB) of eq. 20 of the paper, the sound level of Bézier 15.

    Identity: Bézier 15 and TM21 are equally loud at 335 rpm, as the paper states.
    """
    published = load_published(config_root() / "published" / "tm21_noise.yaml")
    apart = published.level("bezier15", 335) - published.level("tm21", 335)
    return abs(apart + 2593808 - 25.93808), abs(apart), 0.05  # dB: printed digits


def ordinates_of_bezier_15():
    """Return the errors of the ordinates of Bézier 15 that the paper prints.

    Identity: they are symmetric, because in eq. 2 the coefficients of u⁴ and u¹¹ are equal, and so
    are those of u⁵ and u¹⁰.
    """

    def asymmetry(fifth):
        ordinates = [0, 0, 0, 0, 1.5, fifth, 0.868, 0.868, 0.868, 0.868, 1.5, 1.5, 0, 0, 0, 0]
        return largest(np.subtract(ordinates, ordinates[::-1]))

    return asymmetry(15.0), asymmetry(1.5), 0.0


def table_1():
    """Return the errors (rpm) of the mass in Table 1 of the paper, 13 or 1.3 kg.

    Identity: the highest computed jump speed reaches the lowest speed printed in Table 2.
    """
    laws = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")

    def missing(mass):
        speeds = []
        for name in laws:
            law, theta = cam_rig.build_law(cam_rig.load_cam(name)), np.linspace(0, 2 * np.pi, 20001)
            lift, acceleration = law(theta), law(theta, 2)
            falls = acceleration < 0.0
            closing = 4030.0 * lift[falls] + 9.81 * mass
            least = np.sqrt(np.min(closing / (-mass * acceleration[falls])))
            speeds.append(least * 30.0 / np.pi)
        return max(0.0, min(PRINTED_JUMPS) - max(speeds))

    return missing(13.0), missing(1.3), 0.0


def eq_3_6():
    """Return the errors of eq. 3.6 of the laws thesis, a half-rise of degree 8.

    Identity: the curve ends with the constant velocity 2 h/β, so the slope is 2.
    """

    def error(ordinates):
        degree = len(ordinates) - 1
        slope = degree * (ordinates[-1] - ordinates[-2])
        return abs(slope - 2.0) + abs(degree - 8)

    right = [0, 0, 0, 0, 0, 1 / 4, 1 / 2, 3 / 4, 1]
    assert largest(BPoly(np.array(right)[:, None], [0, 1])(U) - shape("bezier8_start")(U)) < 1e-13
    return error([0, 0, 0, 0, 0, 1 / 3, 2 / 3, 1]), error(right), 1e-12


def shape(name):
    """Return a rise of unit lift, by its name, as a curve over u from 0 to 1."""
    breaks, pieces = unit_rise(name)
    return BPoly(np.array(pieces).T, breaks)


def eq_3_7():
    """Return the errors of eq. 3.7 of the laws thesis, the half-rise 2u − 2u³ + u⁴.

    Identity: the printed second and third derivatives are those of the law.
    """
    law = shape("bezier4_end")
    assert largest(law(U) - (2 * U - 2 * U**3 + U**4)) < 1e-13

    def error(sign):
        second, third = sign * 12 * U + 12 * U**2, sign * 12 + 24 * U
        return largest(law(U, 2) - second) + largest(law(U, 3) - third)

    return error(1), error(-1), 1e-11


def eq_2_1():
    """Return the errors of eq. 2.1 and 2.10 of the profile thesis, on B-splines.

    Identities: the basis functions add up to one at a knot too, and without a₀ a law that starts at
    1 would start at 0.
    """
    knots = np.arange(5.0)

    def sums(closed):
        inside = [
            (knots[i] <= 2.0) & ((knots[i + 1] >= 2.0) if closed else (knots[i + 1] > 2.0))
            for i in range(4)
        ]
        return abs(sum(inside) - 1)

    constant = np.array([1.0, 0.5, 0.25])
    start = abs(np.polynomial.polynomial.polyval(0.0, constant) - 1.0)
    without = abs(np.polynomial.polynomial.polyval(0.0, constant * [0, 1, 1]) - 1.0)
    return min(sums(closed=True), without), sums(closed=False) + start, 0.0


def eq_2_13():
    """Return the errors of eq. 2.13 of the profile thesis.

    The equation is the derivative of a B-spline. Identity: its ordinates give the derivative. The
    knots at the ends are n-fold as in the thesis.
    """
    degree, random = 3, np.random.default_rng(1)
    inner = np.sort(random.uniform(0.1, 0.9, 4))
    knots = np.r_[np.zeros(degree), inner, np.ones(degree)]
    ordinates = random.normal(size=knots.size - degree + 1)
    spline = BSpline(np.r_[0.0, knots, 1.0], ordinates, degree)

    def error(span):
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = [knots[i + span] - knots[i] for i in range(ordinates.size - 1)]
            found = BSpline(knots, degree * np.diff(ordinates) / apart, degree - 1)
            return largest(np.nan_to_num(found(U[1:-1]) - spline(U[1:-1], 1), nan=np.inf))

    return error(1), error(degree), 1e-11


def distance(angle):
    """Return a test follower's distance (m) from the axis at cam angles (rad)."""
    return 0.05 + 0.01 * np.sin(angle) + 0.003 * np.cos(2.0 * angle)


def slope(angle):
    return 0.01 * np.cos(angle) - 0.006 * np.sin(2.0 * angle)


def second(angle):
    return -0.01 * np.sin(angle) - 0.012 * np.cos(2.0 * angle)


TILT, OFFSET = 0.3, 0.004
FACE = np.array([-np.sin(TILT), np.cos(TILT)])  # normal of the inclined face, base 1, 2


def eq_2_17():
    """Return the errors (m) of eq. 2.17 of the profile thesis.

    The equation is the contact point on an inclined face. Identity: the contact lies on the face,
    which passes through (ε, d).
    """
    along = slope(THETA) * np.cos(TILT)
    across = distance(THETA) * np.cos(TILT) - OFFSET * np.sin(TILT)
    turned = np.array([[np.cos(TILT), -np.sin(TILT)], [np.sin(TILT), np.cos(TILT)]])

    def error(base):
        point = base @ np.array([along, across])
        on_face = np.array([np.full_like(THETA, OFFSET), distance(THETA)])
        return largest(FACE @ (point - on_face))

    return error(np.eye(2)), error(turned), 1e-15


def eq_2_33():
    """Return the errors (m/rad) of eq. 2.33 of the profile thesis.

    The equation is the tangent of the pitch curve. Identity: the tangent is the derivative of eq.
    2.30 and 2.31.
    """
    pivot, arm = 0.12, 0.1

    def pitch(angle):
        swing = 5.0 * distance(angle)
        one, two = pivot - arm * np.cos(swing), arm * np.sin(swing)
        return np.array(
            [np.cos(angle) * one + np.sin(angle) * two, -np.sin(angle) * one + np.cos(angle) * two]
        )

    def error(sign):
        total, rate = THETA + 5.0 * distance(THETA), 1.0 + 5.0 * slope(THETA)
        tangent = [
            -pivot * np.sin(THETA) + arm * np.sin(total) * rate,
            -pivot * np.cos(THETA) + sign * arm * np.cos(total) * rate,
        ]
        return largest(difference(pitch, THETA) - tangent)

    return error(-1), error(1), DIFFERENCE


def eq_2_39():
    """Return the errors (m/rad²) of eq. 2.39 of the profile thesis.

    The equation is a second derivative of the contour. Identity: in the rotating base, d/dθ of (x,
    y) is (x' + y, y' − x).
    """
    printed = -(distance(THETA) + second(THETA)) * np.cos(TILT) - OFFSET * np.sin(TILT)
    right = -((distance(THETA) + second(THETA)) * np.cos(TILT) - OFFSET * np.sin(TILT))

    def contour(angle):  # cam base, up to a rotation
        one = slope(angle) * np.cos(TILT)
        two = distance(angle) * np.cos(TILT) - OFFSET * np.sin(TILT)
        return (one + 1j * two) * np.exp(-1j * angle)

    def velocity(angle):
        return (contour(angle + STEP) - contour(angle - STEP)) / (2.0 * STEP)

    last = (difference(velocity, THETA) * np.exp(1j * THETA)).imag
    return largest(last - printed), largest(last - right), 1e-6


def part_a():
    """Return the errors of part a of the worked example, S = a θ/β + b at θ = π/2.

    The equation is an identity, true for any a and b.
    """
    a, b, at, beta = 2.0, 3.0, np.pi / 2, np.pi / 2
    value = a * at / beta + b
    return abs(value - (at / beta + b)), abs(value - (a * at / beta + b)), 0.0


def part_b():
    """Return the errors of part b of the worked example, a harmonic motion.

    Identity: it rises from 0 at θ/β = 1 to 1 at θ/β = 2, as its boundary conditions state.
    """

    def error(sign):
        rise = 0.5 * (1.0 + sign * np.cos(np.pi * np.array([1.0, 2.0])))
        return largest(rise - [0.0, 1.0])

    return error(-1), error(1), 1e-15


#: Checks in the order of the printed list `MISPRINTS`.
CHECKS = (
    *(eq_2, eq_20, ordinates_of_bezier_15, table_1, eq_3_6, eq_3_7),
    *(eq_2_1, eq_2_13, eq_2_17, eq_2_33, eq_2_39, part_a, part_b),
)


@pytest.mark.parametrize("check", CHECKS)
def test_printed_text_is_wrong_and_correct_text_is_right(check):
    """A printed formula violates its identity by far more than the corrected formula.

    The corrected formula satisfies it within rounding or the error of a difference.
    """
    printed, right, tolerance = check()
    assert right <= tolerance
    assert printed > 1e3 * right
    assert printed > 1e-3


def test_the_page_on_theory_lists_them_all():
    """The page on theory lists the same misprints, each of which has a check here."""
    assert len(CHECKS) == len(MISPRINTS)
    page = (config_root().parent / "docs" / "theory.md").read_text(encoding="utf-8")
    rows = ["| " + " | ".join(misprint) + " |" for misprint in MISPRINTS]
    assert "\n".join(rows) in page

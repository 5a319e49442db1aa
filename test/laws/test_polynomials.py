"""Polynomials through conditions, the worked example's printed numbers, and B-splines."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BSpline

from cam_rig.errors import LawError
from cam_rig.laws import bernstein, build_law
from cam_rig.laws.law import joints
from cam_rig.laws.segments import polynomial_through
from cam_rig.laws.spline import greville, pieces

INCH = 0.0254


def test_lacunary_conditions():
    """Those that fix the polynomial are as good as any: s(0), s''(½), s(1)."""
    ordinates = polynomial_through([0.0, 0.5, 1.0], [0, 2, 0], [0.0, -2.0, 0.0])
    np.testing.assert_allclose(ordinates, [0.0, 0.5, 0.0], rtol=0, atol=1e-16)  # u − u²


def test_meets_its_conditions():
    """Values, slopes and curvatures at random places: all met, of degree m − 1."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        u, order, value = (
            np.repeat(np.sort(rng.uniform(size=4)), 3),
            [0, 1, 2] * 4,
            rng.normal(size=12),
        )
        ordinates = polynomial_through(u.tolist(), order, value.tolist())
        assert ordinates.size == 12
        for at, r, wanted in zip(u, order, value, strict=True):
            derived = ordinates
            for _ in range(r):
                derived = bernstein.derivative(derived)
            found = bernstein.evaluate(derived, np.array([at]))[0]
            assert found == pytest.approx(wanted, abs=1e-13 * np.abs(derived).max())


def test_conditions_that_fix_nothing_are_refused(make_cam):
    """The slope in the middle of a parabola; no level at all. In a cam the error says which."""
    for u, order in (([0.0, 0.5, 1.0], [0, 1, 0]), ([0.0, 1.0], [1, 1])):
        words = rf"no single polynomial of degree.*\({u[0]:g}, {order[0]}\)"
        with pytest.raises(LawError, match=words):
            polynomial_through(u, order, [0.0] * len(u))
    segment = {"law": "polynomial", "span": 360, "at": [0, 360], "order": [1, 1], "value": [0, 0]}
    with pytest.raises(LawError, match="cam 'made': no single polynomial"):
        build_law(make_cam(segment))


# The worked example with its printed numbers.

QUINTIC = Polynomial([-31, 120, -180, 130, -45, 6])
BETA = np.pi / 2
SCHEMES = {
    "constant_velocity": lambda x: [x - 1, 1 / BETA + 0 * x, 0 * x, 0 * x],
    # printed: S = (1 − cos πθ/β)/2 and so on with θ counted from the start of the rise
    "harmonic": lambda x: [
        0.5 * (1 - np.cos(np.pi * (x - 1))),
        np.pi / (2 * BETA) * np.sin(np.pi * (x - 1)),
        np.pi**2 / (2 * BETA**2) * np.cos(np.pi * (x - 1)),
        -(np.pi**3) / (2 * BETA**3) * np.sin(np.pi * (x - 1)),
    ],
    "quintic": lambda x: [QUINTIC.deriv(r)(x) / BETA**r for r in range(4)],
}


def test_worked_example_is_its_formulas(laws, cams):
    """S, V, A, J of the rise in inches and rad; lift 1 in at the edge, 0.0254 m inside."""
    x, degrees = np.linspace(1.0, 2.0, 41)[1:-1], np.array([0, 45, 89, 180, 225, 270])
    for scheme, formula in SCHEMES.items():
        name = f"worked_example_{scheme}"
        law = laws[name]
        assert (cams[name].lift.raw, cams[name].lift.unit) == (1, "in")
        assert law.lift == pytest.approx(INCH, rel=1e-15)
        for order, expected in enumerate(formula(x)):
            np.testing.assert_allclose(
                law(BETA * x, order) / INCH, expected, rtol=1e-11, atol=1e-11
            )
        levels = law(np.radians(degrees)) / INCH
        np.testing.assert_allclose(levels, [0, 0, 0, 1, 1, 1], rtol=0, atol=1e-15)
        assert law.largest_step < 1e-15


# B-splines as Bézier pieces: the thesis's basis, its abscissae, and continuity at knots.

DEGREE = 3
KNOTS = np.array([0, 0, 0, 1, 2.5, 2.5, 4, 4, 4], dtype=float)  # ends and 2.5 repeated
ORDINATES = np.array([0, 0.1, 0.7, 0.9, 0.4, 0.2, 0.25])


def value(u, ordinates=ORDINATES):
    breaks, columns = pieces(KNOTS, ordinates, DEGREE)
    i = min(np.searchsorted(breaks, u, side="right") - 1, len(columns) - 1)
    at = np.array([(u - breaks[i]) / (breaks[i + 1] - breaks[i])])
    return bernstein.evaluate(columns[i], at)[0]


def test_values_are_the_recursion():
    """The Bézier pieces are the sum of the basis functions of eq. 2.10, through both ends."""
    spline = BSpline([KNOTS[0], *KNOTS, KNOTS[-1]], ORDINATES, DEGREE)
    for u in (0.0, 0.3, 1.0, 1.7, 2.5, 3.1, 3.999):
        assert value(u) == pytest.approx(spline(u), abs=3e-16)
    _, columns = pieces(KNOTS, ORDINATES, DEGREE)
    assert (columns[0][0], columns[-1][-1]) == (ORDINATES[0], ORDINATES[-1])


def test_greville_abscissae():
    """ξᵢ = mean of n knots: a straight line through (ξᵢ, ξᵢ) is itself (linear precision)."""
    abscissae = greville(KNOTS, DEGREE)
    np.testing.assert_allclose(abscissae[[0, 1, -1]], [0, 1 / 3, 4], rtol=1e-15)
    for u in (0.2, 1.3, 2.7, 3.9):
        assert value(u, abscissae) == pytest.approx(u, rel=1e-15)


def test_b_splines_of_a_cam(make_cam):
    """C^(n − r) at a knot of multiplicity r, C^(n − 1) at a simple one; one piece is a Bézier."""

    def spline(degree, knots, ordinates):
        rest = {"degree": degree, "knots": knots, "ordinates": ordinates}
        return build_law(make_cam({"law": "b_spline", "span": 360, **rest}))

    law = spline(3, [0, 0, 0, 1, 2, 2, 4, 4, 4], [0, 0, 0.7, 0.9, 0.4, 0, 0])
    np.testing.assert_allclose(law.breaks, np.radians([0, 90, 180, 360]), rtol=1e-15)
    assert [joint.continuity for joint in joints(law)] == [1, 2, 1]
    ordinates = [0, 0, 0.3, 1, 0.2, 0, 0]
    bezier = build_law(make_cam({"law": "bezier", "span": 360, "ordinates": ordinates}))
    one = spline(6, [0] * 6 + [1] * 6, ordinates)
    np.testing.assert_array_equal(one.ordinates, bezier.ordinates)

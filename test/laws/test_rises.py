"""Named rises, trigonometric laws, polynomials and B-splines: values and classes."""

import math
from typing import get_args

import mpmath as mp
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BSpline

from cam_rig.errors import LawError
from cam_rig.laws import bernstein, build_law
from cam_rig.laws.catalogue import rise_figures
from cam_rig.laws.law import MAX_CONTINUITY, joints, peak
from cam_rig.laws.segments import NAMED_RISES, polynomial_through, unit_rise
from cam_rig.laws.spline import greville, pieces
from cam_rig.schema.segments import RiseName
from cam_rig.units import TURN

from ..conftest import dwell, rise

#: Coefficients of u, u², … of eq. 3.1-3.9, with corrected misprints.
PRINTED = {
    "bezier5": [0, 0, 10, -15, 6],
    "bezier7": [0, 0, 0, 35, -84, 70, -20],
    "bezier9": [0, 0, 0, 0, 126, -420, 540, -315, 70],
    "bezier4_start": [0, 0, 2, -1],
    "bezier6_start": [0, 0, 0, 5, -6, 2],
    "bezier8_start": [0, 0, 0, 0, 14, -28, 20, -5],
    "bezier4_end": [2, 0, -2, 1],
    "bezier6_end": [2, 0, 0, -5, 6, -2],
    "bezier8_end": [2, 0, 0, 0, -14, 28, -20, 5],
    "constant_velocity": [1],
}
PRINTED |= {"poly345": PRINTED["bezier5"], "poly4567": PRINTED["bezier7"]}
PI = math.pi
#: Peak velocity, acceleration and jerk in closed form, and the class (science.md §1).
KNOWN = {
    "constant_velocity": (1.0, 0.0, 0.0, 0),
    "simple_harmonic": (PI / 2, PI**2 / 2, PI**3 / 2, 1),
    "cycloidal": (2.0, 2 * PI, 4 * PI**2, 2),
    "modified_sine": (4 * PI / (PI + 4), 4 * PI**2 / (PI + 4), 16 * PI**3 / (PI + 4), 2),
    "modified_trapezoid": (2.0, 8 * PI / (PI + 2), 32 * PI**2 / (PI + 2), 2),
    "poly345": (1.875, 10 / math.sqrt(3), 60.0, 2),
    "poly4567": (2.1875, 84 * math.sqrt(5) / 25, 52.5, 3),
    "bezier9": (315 / 128, 9.371976218494108, 78.75, 4),  # the peak acceleration by sampling
    **{f"bezier4_{half}": (2.0, 3.0, 12.0, 2) for half in ("start", "end")},
    **{f"bezier6_{half}": (2.0, 3.75, 20 / math.sqrt(3), 3) for half in ("start", "end")},
    **{f"bezier8_{half}": (2.0, 4.375, 168 / math.sqrt(125), 4) for half in ("start", "end")},
}
KNOWN |= {"bezier5": KNOWN["poly345"], "bezier7": KNOWN["poly4567"]}


def taylor(function, u):
    """Return the value and three derivatives at a number, with 40 digits."""
    with mp.workdps(40):
        row = mp.taylor(function, mp.mpf(u), 3)
        return [float(a * factorial) for a, factorial in zip(row, (1, 1, 2, 6), strict=True)]


def test_peaks_and_classes_are_the_closed_forms():
    """Peaks of a named rise are its closed forms, and its class is the family's.

    Peaks are per unit of lift and span.
    """
    assert set(get_args(RiseName)) == set(NAMED_RISES) == set(KNOWN)
    for name, expected in KNOWN.items():
        result = rise_figures(name)
        peaks = (result.peak_velocity, result.peak_acceleration, result.peak_jerk)
        np.testing.assert_allclose(peaks, expected[:3], rtol=5e-13, atol=1e-13)
        assert result.continuity == expected[3]


def test_bezier_rises_are_the_printed_polynomials():
    """The ordinates of Bézier rises give the printed polynomials of eq. 3.1-3.9."""
    u = np.linspace(0.0, 1.0, 33)
    for name, printed in PRINTED.items():
        _, (ordinates,) = unit_rise(name)
        curve = Polynomial([0, *printed])
        assert len(ordinates) == curve.coef.size
        close = {"rtol": 0, "atol": 1e-13}  # the powers cancel
        np.testing.assert_allclose(bernstein.evaluate(ordinates, u), curve(u), **close)


def simple_harmonic(u):
    return (1 - mp.cos(mp.pi * u)) / 2


def modified_sine(u):
    k, eighth = 1 / (4 + mp.pi), mp.mpf(1) / 8
    if u < eighth:
        return k * (mp.pi * u - mp.sin(4 * mp.pi * u) / 4)
    if u < 7 * eighth:
        return k * (2 + mp.pi * u - 9 * mp.sin(4 * mp.pi * u / 3 + mp.pi / 3) / 4)
    return k * (4 + mp.pi * u - mp.sin(4 * mp.pi * u) / 4)


def modified_trapezoid(u):
    """Return the handbooks' formula of the modified trapezoid.

    The second half is s(u) = 1 − s(1 − u).
    """
    if u > mp.mpf(1) / 2:
        return 1 - modified_trapezoid(1 - u)
    k, v = 1 / (2 + mp.pi), u - mp.mpf(1) / 8
    if v < 0:
        return k * (2 * u - mp.sin(4 * mp.pi * u) / (2 * mp.pi))
    if v < mp.mpf(1) / 4:
        return k * (mp.mpf(1) / 4 - 1 / (2 * mp.pi) + 2 * v + 4 * mp.pi * v**2)
    return k * (-mp.pi / 2 + 2 * (1 + mp.pi) * u + mp.sin(4 * mp.pi * u) / (2 * mp.pi))


def cycloidal(u):
    return u - mp.sin(2 * mp.pi * u) / (2 * mp.pi)


@pytest.mark.parametrize("formula", [simple_harmonic, cycloidal, modified_sine, modified_trapezoid])
def test_analytic_rises_agree_with_forty_digits(formula):
    """Analytic rises agree with 40 digits.

    Values agree to 1e-14 of their peak, third derivatives to 1e-11. Joints of the sections are
    not evaluated.
    """
    breaks, columns = unit_rise(formula.__name__)
    u, errors, sizes = np.linspace(0.03, 0.97, 5), [], []
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        expected = np.array([taylor(formula, start + x * (stop - start)) for x in u]).T
        for order in range(4):
            errors.append((order, np.abs(bernstein.evaluate(column, u) - expected[order]).max()))
            column = bernstein.derivative(column) / (stop - start)  # noqa: PLW2901
        sizes.append(np.abs(expected).max(axis=1))
    size = np.max(sizes, axis=0)
    for order, error in errors:
        assert error <= (1e-14, 1e-13, 1e-12, 1e-11)[order] * size[order]


def test_halves_meet_at_one_slope(make_cam):
    """A start half and an end half of equal span meet with velocity 2h/β.

    They are C4 for degree 8.
    """
    for degree, expected in ((4, 2), (6, 3), (8, 4)):
        start, end = f"bezier{degree}_start", f"bezier{degree}_end"
        up, down = ((rise(60, 0.5, start), rise(60, level, end)) for level in (1, 0))
        law = build_law(make_cam(*up, dwell(60), *down, dwell(60)))
        classes = [joint.continuity for joint in joints(law)]
        assert [classes[i] for i in (0, 2, 3, 5)] == [expected] * 4  # against the dwells
        assert min(classes) == expected
        assert law(np.radians(60.0), 1) == pytest.approx(0.05 / np.radians(60.0), rel=1e-14)


# Trigonometric polynomials: the fit is the sum of harmonics over the whole turn.

COSINE, SINE, MEAN, LIFT = [-0.47, 0.06, 0, 0.02], [0.12, -0.03, 0.01], 0.5, 0.05


def test_a_trigonometric_law_agrees_with_fifty_digits(make_cam):
    """A trigonometric law and its derivatives are those of eq. 2.2 in 50 digits.

    Every joint is C4.
    """
    segment = {"law": "trigonometric", "span": 360, "mean": MEAN, "cosine": COSINE, "sine": SINE}
    wavy, angles = build_law(make_cam(segment, lift=LIFT)), np.linspace(0.0, TURN, 49)
    assert {joint.continuity for joint in joints(wavy)} == {MAX_CONTINUITY}

    def exact(theta, order):
        total = mp.mpf(MEAN) if order == 0 else mp.mpf(0)
        for waves, phase in ((COSINE, order), (SINE, order - 1)):
            for i, size in enumerate(waves, start=1):
                total += mp.mpf(size) * mp.mpf(i) ** order * mp.cos(i * theta + phase * mp.pi / 2)
        return total

    for order, tolerance in enumerate((1e-14, 1e-13, 1e-12, 1e-11)):
        with mp.workdps(50):
            expected = LIFT * np.array([float(exact(mp.mpf(x), order)) for x in angles])
        limit = tolerance * np.abs(expected).max()
        np.testing.assert_allclose(wavy(angles, order), expected, rtol=0, atol=limit)


def test_the_fiftieth_harmonic_is_accurate(make_cam):
    """The 50th harmonic of a trigonometric law has 50 times its amplitude as slope."""
    cosine = [0.0] * 49 + [0.5]
    law = build_law(make_cam({"law": "trigonometric", "span": 360, "mean": 0.5, "cosine": cosine}))
    assert law.lift == pytest.approx(LIFT, rel=1e-12)
    assert abs(peak(law, 1).value) == pytest.approx(25.0 * LIFT, rel=1e-12)
    assert abs(peak(law, 3).value) == pytest.approx(0.5 * 50**3 * LIFT, rel=1e-10)


# Polynomials that meet conditions.


INCH = 0.0254


def test_a_polynomial_meets_its_conditions():
    """A polynomial of m conditions has degree m − 1 and meets all of them.

    The conditions are values, slopes and curvatures. Those that omit orders can also determine
    a polynomial: s(0), s''(½) and s(1).
    """
    ordinates = polynomial_through([0.0, 0.5, 1.0], [0, 2, 0], [0.0, -2.0, 0.0])
    np.testing.assert_allclose(ordinates, [0.0, 0.5, 0.0], rtol=0, atol=1e-16)  # u − u²
    for seed in range(5):
        rng = np.random.default_rng(seed)
        u, order = np.repeat(np.sort(rng.uniform(size=4)), 3), [0, 1, 2] * 4
        value = rng.normal(size=12)
        ordinates = polynomial_through(u.tolist(), order, value.tolist())
        assert ordinates.size == 12
        for x, r, expected in zip(u, order, value, strict=True):
            derived = ordinates
            for _ in range(r):
                derived = bernstein.derivative(derived)
            result = bernstein.evaluate(derived, np.array([x]))[0]
            assert result == pytest.approx(expected, abs=1e-13 * np.abs(derived).max())


def test_conditions_without_a_solution_are_refused(make_cam):
    """Conditions that determine no polynomial are refused.

    An example are the middle slope of a parabola and two slopes. In a cam the error names the
    cam.
    """
    for u, order in (([0.0, 0.5, 1.0], [0, 1, 0]), ([0.0, 1.0], [1, 1])):
        message = rf"no single polynomial of degree.*\({u[0]:g}, {order[0]}\)"
        with pytest.raises(LawError, match=message):
            polynomial_through(u, order, [0.0] * len(u))
    segment = {"law": "polynomial", "span": 360, "at": [0, 360], "order": [1, 1], "value": [0, 0]}
    with pytest.raises(LawError, match="cam 'made': no single polynomial"):
        build_law(make_cam(segment))


# Worked example with its printed numbers.

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
    """The worked example has S, V, A and J of its formulas in inches and rad.

    The lift is 1 in in the file and 0.0254 m in the law.
    """
    x, degrees = np.linspace(1.0, 2.0, 41)[1:-1], np.array([0, 45, 89, 180, 225, 270])
    for scheme, formula in SCHEMES.items():
        name = f"worked_example_{scheme}"
        law = laws[name]
        assert (cams[name].lift.raw, cams[name].lift.unit) == (1, "in")
        assert law.lift == pytest.approx(INCH, rel=1e-15)
        for order, expected in enumerate(formula(x)):
            result = law(BETA * x, order) / INCH
            np.testing.assert_allclose(result, expected, rtol=1e-11, atol=1e-11)
        levels = law(np.radians(degrees)) / INCH
        np.testing.assert_allclose(levels, [0, 0, 0, 1, 1, 1], rtol=0, atol=1e-15)
        assert law.largest_step < 1e-15


# B-splines as Bézier pieces: basis of the thesis, abscissae, and continuity at knots.

DEGREE = 3
KNOTS = np.array([0, 0, 0, 1, 2.5, 2.5, 4, 4, 4], dtype=float)  # ends and 2.5 repeated
ORDINATES = np.array([0, 0.1, 0.7, 0.9, 0.4, 0.2, 0.25])


def value(u, ordinates=ORDINATES):
    breaks, columns = pieces(KNOTS, ordinates, DEGREE)
    i = min(np.searchsorted(breaks, u, side="right") - 1, len(columns) - 1)
    local = np.array([(u - breaks[i]) / (breaks[i + 1] - breaks[i])])
    return bernstein.evaluate(columns[i], local)[0]


def test_b_spline_pieces_have_the_values_of_the_recursion():
    """The Bézier pieces of a B-spline have the values of the recursion, eq. 2.10.

    The curve passes through both end ordinates.
    """
    spline = BSpline([KNOTS[0], *KNOTS, KNOTS[-1]], ORDINATES, DEGREE)
    for u in (0.0, 0.3, 1.0, 1.7, 2.5, 3.1, 3.999):
        assert value(u) == pytest.approx(spline(u), abs=3e-16)
    _, columns = pieces(KNOTS, ORDINATES, DEGREE)
    assert (columns[0][0], columns[-1][-1]) == (ORDINATES[0], ORDINATES[-1])


def test_greville_abscissae():
    """Ordinates at the Greville abscissae give a straight line.

    ξᵢ is the mean of n knots.
    """
    abscissae = greville(KNOTS, DEGREE)
    np.testing.assert_allclose(abscissae[[0, 1, -1]], [0, 1 / 3, 4], rtol=1e-15)
    for u in (0.2, 1.3, 2.7, 3.9):
        assert value(u, abscissae) == pytest.approx(u, rel=1e-15)


def test_b_splines_of_a_cam(make_cam):
    """A B-spline segment is C^(n − r) at a knot of multiplicity r.

    A B-spline of one piece is a Bézier curve.
    """

    def spline(degree, knots, ordinates):
        rest = {"degree": degree, "knots": knots, "ordinates": ordinates}
        return build_law(make_cam({"law": "b_spline", "span": 360, **rest}))

    law = spline(3, [0, 0, 0, 1, 2, 2, 4, 4, 4], [0, 0, 0.86, 1.1, 0.49, 0, 0])
    np.testing.assert_allclose(law.breaks, np.radians([0, 90, 180, 360]), rtol=1e-15)
    assert [joint.continuity for joint in joints(law)] == [1, 2, 1]
    ordinates = [0, 0, 0.7, 2.32, 0.46, 0, 0]
    bezier = build_law(make_cam({"law": "bezier", "span": 360, "ordinates": ordinates}))
    single = spline(6, [0] * 6 + [1] * 6, ordinates)
    np.testing.assert_array_equal(single.ordinates, bezier.ordinates)

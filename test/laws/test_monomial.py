"""Why Bernstein: the same curve in powers of u loses its digits as the degree grows."""

import mpmath as mp
import numpy as np
import pytest

from benchmark.speed import exact as exact_solution
from benchmark.speed import study as rig
from benchmark.speed.exact import polynomial, powers
from benchmark.speed.models import Case, Oscillator, output_times
from cam_rig.laws import Law, bernstein
from cam_rig.laws.sampling import sample
from cam_rig.units import TURN

U = np.linspace(0.0, 1.0, 201)
EPS = float(np.finfo(float).eps)
#: Rounding of the Bernstein form: eps for each degree, of the largest ordinate.
LIMITS = {15: 15 * EPS, 30: 30 * EPS, 60: 60 * EPS}


def ordinates(degree):
    """One curve for rise, dwell and fall as Bézier 15 is: rest at the ends, 50 mm between."""
    inner = np.random.default_rng(degree).uniform(0.2, 1.5, degree - 7)
    return 0.05 * np.concatenate([np.zeros(4), inner, np.zeros(4)])


def exact(b, order=0):
    """Values of d^order/du^order in 60 digits."""
    with mp.workdps(60):
        series = powers(b.tolist())
        for _ in range(order):
            series = [i * a for i, a in enumerate(series)][1:]
        return np.array([float(polynomial(series, mp.mpf(float(u)))) for u in U])


def monomial(b):
    """Horner's rule in doubles, the coefficients rounded once from 60 digits."""
    with mp.workdps(60):
        return np.polyval([float(a) for a in powers(b.tolist())][::-1], U)


@pytest.mark.parametrize("degree", [15, 30, 60])
def test_bernstein_form_keeps_its_digits(degree):
    """Each value is a sum of positive weights that add to one: rounding does not grow."""
    b = ordinates(degree)
    error = np.abs(bernstein.evaluate(b, U) - exact(b)).max() / np.abs(b).max()
    assert error < LIMITS[degree]


def test_monomial_form_loses_them():
    """Coefficients grow by 3^p and cancel: 1e-11 of the lift at 15, nothing left at 60.

    The coefficients here are correctly rounded; nobody could do better in doubles.
    """
    errors = {}
    for degree in (15, 30, 60):
        b = ordinates(degree)
        errors[degree] = np.abs(monomial(b) - exact(b)).max() / np.abs(b).max()
    assert 1e-12 < errors[15] < 1e-9
    assert 1e4 * errors[15] < errors[30] < 1e-2
    assert errors[60] > 1.0


def law_of(degree):
    return Law(f"bezier{degree}", np.array([0.0, TURN]), ordinates(degree)[:, None])


@pytest.mark.parametrize("degree", [15, 30, 60])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_derivatives_of_a_law(degree, order):
    """s' and s'' by differences of ordinates lose no more than a digit, at any degree."""
    law = law_of(degree)
    wanted = exact(ordinates(degree), order) / TURN**order
    got = law(U[:-1] * TURN, order)
    size = np.abs(wanted).max()
    np.testing.assert_allclose(got, wanted[:-1], rtol=0, atol=1e-13 * size)


@pytest.mark.parametrize("degree", [15, 30, 60])
def test_samples_of_a_law(degree):
    """The fast path writes each chunk about its middle, and stays exact to 1e-13 at any degree."""
    law = law_of(degree)
    count = 20_000
    got = sample(law, 0.0, TURN / count, count, np.eye(3), np.zeros(3))
    for order in range(3):
        wanted = exact(ordinates(degree), order)[:-1] / TURN**order
        size = np.abs(wanted).max()
        np.testing.assert_allclose(got[order, ::100], wanted, rtol=0, atol=1e-13 * size)


@pytest.mark.parametrize("degree", [15, 30, 60])
@pytest.mark.parametrize("rpm", [3.0, 300.0, 3000.0])
def test_the_response_to_a_law(degree, rpm, monkeypatch):
    """Residual vibration stays exact to 1e-13 from slow to fast, whatever the degree.

    The reference goes by powers: at degree 60 it loses 60 digits, so it is given 140.
    """
    monkeypatch.setattr(exact_solution, "DIGITS", 140)
    speed = rpm * np.pi / 30.0
    model = Oscillator(1.3, 8.642, 4030.0, 1e5)
    times = output_times(speed, 1, 25)
    case = Case("degree", "degree", law_of(degree), model, speed, 1, 1, times)
    assert rig.solve(case).error(exact_solution.solve(case)) < 1e-13

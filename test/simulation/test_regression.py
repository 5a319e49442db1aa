"""Cubic regressions over speed, and their roots."""

import numpy as np
import pytest

from cam_rig.simulation.regression import crossings, nearest_crossing, real_roots, regression

RPM = np.arange(200.0, 401.0, 10.0)
ONE = np.array([25.93808, 0.57355, -0.002045, 2.483e-6])


def test_regression_recovers_a_cubic():
    """Levels on a cubic give its coefficients back (1e-9 of each term's size at 400 rpm)."""
    level = np.polynomial.polynomial.polyval(RPM, ONE)
    scale = 400.0 ** np.arange(4)
    np.testing.assert_allclose(regression(RPM, level) * scale, ONE * scale, rtol=1e-9)


@pytest.mark.parametrize("level", [0.0, 80.0])
def test_regression_always_has_four_numbers(level):
    """A flat curve is a cubic too: its higher coefficients are zero, not missing."""
    coefficients = regression(RPM, np.full(RPM.size, level))
    np.testing.assert_allclose(coefficients, [level, 0.0, 0.0, 0.0], rtol=0, atol=1e-10)


def test_too_few_points_have_no_cubic():
    """Three points do not make a cubic: not a number, rather than an invention."""
    coefficients = regression(RPM[:3], np.array([70.0, 71.0, 72.0]))
    assert coefficients.shape == (4,)
    assert np.isnan(coefficients).all()


def test_a_leading_number_of_rounding_has_no_root():
    """A straight line that a cubic was fitted to crosses zero where the line does."""
    assert real_roots(np.array([-1.0, 1.25, 3e-17, -2e-17])) == pytest.approx([0.8], abs=1e-12)
    assert real_roots(np.array([2.0, 0.0, 1.0, 1e-16])).size == 0


def test_all_crossings_in_their_order():
    """The roots of a cubic within the speeds, and of those the one nearest to a speed."""
    difference = np.polynomial.Polynomial.fromroots([0.7, 1.1, 1.9]).coef
    found = crossings(difference, (200.0, 400.0), scale=300.0)
    assert found == pytest.approx([210.0, 330.0])
    assert nearest_crossing(difference, (200.0, 400.0), 250.0, scale=300.0) == pytest.approx(210.0)
    assert crossings(difference, (340.0, 400.0), scale=300.0).size == 0

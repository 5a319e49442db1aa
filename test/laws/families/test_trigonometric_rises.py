"""The cycloidal rise: a polynomial fit that cannot be told from its formula."""

import mpmath as mp
import numpy as np
import pytest

from cam_rig.laws.segments import cycloidal

U = np.linspace(0.0, 1.0, 1001)


@pytest.fixture
def unit_rise(cams, laws):
    """The rise of the shipped cam as a function of u and order, for unit lift and span."""
    start, span = (segment.span.si for segment in cams["cycloidal"].segments[:2])
    lift = cams["cycloidal"].lift.si

    def rise(u, order):
        return laws["cycloidal"](start + span * u, order) * span**order / lift

    return rise


@pytest.mark.parametrize(("order", "tolerance"), [(0, 1e-13), (1, 1e-12), (2, 1e-12), (3, 1e-12)])
def test_fit_against_the_formula(unit_rise, order, tolerance):
    """s to 1e-13 and s''' to 1e-12 of their peaks, everywhere inside the rise."""
    inside = U[1:-1]
    expected = cycloidal(inside, order)
    np.testing.assert_allclose(
        unit_rise(inside, order), expected, rtol=0, atol=tolerance * np.abs(expected).max()
    )


@pytest.mark.parametrize("order", range(4))
def test_formula_against_fifty_digits(order):
    """The derivatives written out are those of u − sin(2πu)/2π."""
    with mp.workdps(50):
        expected = [
            float(mp.diff(lambda u: u - mp.sin(2 * mp.pi * u) / (2 * mp.pi), mp.mpf(u), order))
            for u in U[::100]
        ]
    np.testing.assert_allclose(cycloidal(U[::100], order), expected, rtol=0, atol=1e-13)


def test_rise_is_skew_symmetric(unit_rise):
    """s(u) + s(1 − u) = 1: as gentle at its end as at its start."""
    np.testing.assert_allclose(unit_rise(U, 0) + unit_rise(1.0 - U, 0), 1.0, rtol=0, atol=1e-13)

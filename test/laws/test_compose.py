"""Products and compositions in Bernstein form against 40-digit arithmetic."""

import itertools

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.laws.bernstein import compose, evaluate, product


def exact(ordinates, u):
    """Value by de Casteljau with 40 digits; the doubles are taken as exact."""
    row = [mp.mpf(float(b)) for b in ordinates]
    while len(row) > 1:
        row = [a * (1 - u) + b * u for a, b in itertools.pairwise(row)]
    return row[0]


def values(size):
    return st.lists(st.floats(-1.0, 1.0), min_size=size, max_size=size).map(np.array)


@given(st.integers(1, 60), st.data())
def test_composition_loses_nothing(degree, data):
    """f(u(τ)) to rounding of the largest ordinate, at every degree a law may have."""
    outer = data.draw(values(degree + 1))
    inner = np.sort(data.draw(values(3))) / 2.0 + 0.5
    got = compose(outer[:, None], inner)
    assert got.shape == (2 * degree + 1, 1)
    with mp.workdps(40):
        for tau in (0.0, 0.25, 0.6, 1.0):
            expected = exact(outer, exact(inner, mp.mpf(tau)))
            value = evaluate(got[:, 0], np.array([tau]))[0]
            assert value == pytest.approx(float(expected), abs=4e-15 * (1.0 + 0.1 * degree))


def test_ends_of_a_composition_are_those_of_the_curve():
    """A ramp over a whole piece begins and ends with the very ordinates of the piece."""
    outer = np.random.default_rng(3).normal(size=(16, 3))
    got = compose(outer, np.array([0.0, 0.2, 1.0]))
    np.testing.assert_array_equal(got[[0, -1]], outer[[0, -1]])


def test_composition_stays_within_the_ordinates():
    """Convex combinations: no ordinate leaves the range of the curve's own."""
    outer = np.random.default_rng(4).uniform(-1.0, 1.0, size=(31, 1))
    got = compose(outer, np.array([0.1, 0.15, 0.9]))
    assert outer.min() <= got.min() <= got.max() <= outer.max()


@given(st.integers(0, 4), st.integers(0, 40), st.data())
def test_product(low, high, data):
    """The product of two polynomials is a polynomial, to rounding."""
    one, other = data.draw(values(low + 1)), data.draw(values(high + 1))
    got = product(one, other[:, None])
    assert got.shape == (low + high + 1, 1)
    with mp.workdps(40):
        for u in (0.0, 0.3, 0.9, 1.0):
            expected = exact(one, mp.mpf(u)) * exact(other, mp.mpf(u))
            value = evaluate(got[:, 0], np.array([u]))[0]
            assert value == pytest.approx(float(expected), abs=1e-15 * (1.0 + high))

"""Bernstein polynomials: identities, roots, products and compositions, in exact arithmetic."""

import itertools

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import compose, crossings, evaluate, product

#: Rounding of a degree-15 sum of terms of order 1: a few dozen eps.
ROUNDING = 1e-14
POINTS, DENSE = np.linspace(0.0, 1.0, 33), np.linspace(0.0, 1.0, 4001)
DEGREES = (0, 1, 5, 7, 15)
FEW = settings(max_examples=settings.default.max_examples // 4)


def ordinates(degree):
    return np.random.default_rng(degree).uniform(-1.0, 1.0, degree + 1)


def by_de_casteljau(b, u):
    row = [mp.mpf(float(value)) for value in b]
    while len(row) > 1:
        row = [a * (1 - u) + c * u for a, c in itertools.pairwise(row)]
    return row[0]


def exact_at(b, points=POINTS, order=0):
    """Values of the derivative of an order, of 40 digits."""
    with mp.workdps(40):
        return [float(mp.diff(lambda x: by_de_casteljau(b, x), u, order)) for u in points]


def close(found, expected, tolerance=ROUNDING):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("degree", DEGREES)
def test_values_derivatives_and_integrals(degree):
    """Those of the definition, whatever is done to the ordinates; a curve stays in its hull."""
    values, b = bernstein.basis(degree, POINTS), ordinates(degree)
    close(values.sum(axis=1), 1.0)
    assert values.min() >= 0.0
    close(evaluate(b, POINTS), exact_at(b))
    higher = bernstein.elevate(b, degree + 6)
    assert higher.size == degree + 7
    close(exact_at(higher), exact_at(b))
    slope, grown = bernstein.derivative(b), max(degree, 1) * ROUNDING
    close(evaluate(slope, POINTS), exact_at(b, order=1), grown)
    integral = bernstein.antiderivative(b, start=0.75)
    assert integral[0] == 0.75
    close(bernstein.derivative(integral), b, (degree + 1) * ROUNDING)


@pytest.mark.parametrize("degree", DEGREES)
def test_parts(degree):
    """The halves of a split are the polynomial on either side, and they meet."""
    b = ordinates(degree)
    for at in (0.25, 0.5, 0.9):
        left, right = bernstein.split(b, at)
        assert left[-1] == right[0]
        close(exact_at(left), exact_at(b, at * POINTS))
        close(exact_at(right), exact_at(b, at + (1.0 - at) * POINTS))
    for start, stop in ((0.0, 1.0), (0.0, 0.3), (0.25, 0.75), (0.7, 1.0)):
        expected = exact_at(b, start + (stop - start) * POINTS)
        close(exact_at(bernstein.restrict(b, start, stop)), expected)


def test_shared_tables_are_frozen():
    for table in (bernstein.binomials(7), bernstein.elevation_matrix(3, 5)):
        with pytest.raises(ValueError, match="read-only"):
            table[0] = 2.0


# The root between two signs: that of scipy's Brent, bit by bit.


def rising(number):
    """Polynomials with one root in (0, 1), of every degree and size, some roots beside an end."""
    chance = np.random.default_rng(1)
    for _ in range(number):
        steps = chance.exponential(size=chance.integers(2, 17)) ** 3
        b = np.cumsum(steps) * 10.0 ** chance.integers(-12, 3)
        zero = chance.random() ** chance.integers(1, 9)
        yield b - b[0] - zero * (b[-1] - b[0])


def test_one_root_is_brents():
    found = 0
    for b in rising(500):
        if b[0] * b[-1] < 0.0:
            wanted = brentq(bernstein.scalar(b), 0.0, 1.0, xtol=1e-300, rtol=2.0**-50, maxiter=2000)
            assert crossings(b) == pytest.approx([wanted], rel=1e-13)
            found += 1
    assert found > 470


def test_flat_places():
    """u^p − r^p has its root to a few digits' ends, though a secant from 1 creeps towards it."""
    for power, root in ((3, 1e-34), (5, 1e-20), (9, 1e-28)):
        b = np.zeros(power + 1)
        b[-1] = 1.0
        assert crossings(b - root**power) == pytest.approx([root], rel=1e-12)


# All roots: every change of sign, and nothing else.


def from_roots(*roots, factor=1.0):
    """Ordinates of factor·Π(u − r)."""
    coefficients = factor * Polynomial.fromroots(roots).coef
    n = coefficients.size - 1
    b = [bernstein.binomials(j) / bernstein.binomials(n)[: j + 1] for j in range(n + 1)]
    return np.array([row @ coefficients[: j + 1] for j, row in enumerate(b)])


def test_roots():
    """In order, to rounding: simple ones, also where the search splits; close ones; scaled ones."""
    for roots in ((0.3,), (0.2, 0.7), (0.1, 0.45, 0.9), (0.5,), (0.25, 0.5), (0.25, 0.5, 0.75)):
        assert crossings(from_roots(*roots)) == pytest.approx(list(roots), abs=1e-14)
    for gap in (1e-2, 1e-4, 1e-6):
        found = crossings(from_roots(0.3, 0.3 + gap))
        assert found == pytest.approx([0.3, 0.3 + gap], abs=4e-16 / gap)
    for scale in (1e-12, 1e-100, 1e-200):
        assert crossings(scale * from_roots(0.2, 0.7)) == pytest.approx([0.2, 0.7], abs=1e-13)
    assert crossings(from_roots(0.25), 2.0, 6.0) == pytest.approx([3.0], abs=1e-14)
    assert crossings(np.array([-1.0, 1.0, -1.0, 1.0])) == [0.5]  # a triple root


def test_what_is_no_crossing():
    """Touching zero, zero itself, a root at 0 or 1, which does not hide the one inside."""
    for root in (0.25, 0.5):
        assert crossings(from_roots(root, root)) == []
        assert crossings(from_roots(root, root, factor=-3.0)) == []
    assert crossings(np.zeros(6)) == crossings(np.array([0.0, 1.0, 0.0])) == []
    found = crossings(np.array([0.0, 0.4, -0.6, 0.0]))  # 3u(1 − u)(0.4 − u)
    assert found == pytest.approx([0.4], abs=1e-14)


def test_negative_intervals():
    """Where u(u − 0.2)(u − 0.7) is negative: between its roots."""
    (interval,) = bernstein.negative_intervals(from_roots(0.0, 0.2, 0.7))
    assert interval == pytest.approx((0.2, 0.7), abs=1e-14)
    assert bernstein.negative_intervals(np.array([-1.0, -2.0])) == [(0.0, 1.0)]
    assert bernstein.negative_intervals(np.zeros(4)) == []


ordinate_lists = st.lists(
    st.one_of(st.just(0.0), st.floats(-1.0, 1.0).filter(lambda x: abs(x) > 1e-6)),
    min_size=1,
    max_size=16,
)


@settings(max_examples=3 * settings.default.max_examples)
@given(ordinate_lists)
def test_every_change_of_sign_is_found(numbers):
    """An odd number of crossings iff the sign differs, the ordinates' but for pairs (Descartes)."""
    b = np.array(numbers)
    values = evaluate(b, DENSE)
    clear = np.abs(values) > 1e-12 * np.abs(b).max()  # beyond the rounding of evaluate
    u, signs = DENSE[clear], np.sign(values[clear])
    roots = np.array(crossings(b))
    assert np.all(np.diff(roots) >= 0.0)
    assert np.all((roots > 0.0) & (roots < 1.0))
    counts = np.diff(np.searchsorted(roots, u))
    np.testing.assert_array_equal(counts % 2 == 1, signs[1:] != signs[:-1])
    assert roots.size <= bernstein.count_sign_changes(b)
    if b[0] * b[-1] != 0.0:
        assert (bernstein.count_sign_changes(b) - roots.size) % 2 == 0


# Products and compositions against 40 digits.


def values(size):
    return st.lists(st.floats(-1.0, 1.0), min_size=size, max_size=size).map(np.array)


@FEW
@given(st.integers(1, 60), st.data())
def test_composition_loses_nothing(degree, data):
    """f(u(τ)) to rounding of the largest ordinate, at every degree a law may have."""
    outer = data.draw(values(degree + 1))
    inner = np.sort(data.draw(values(3))) / 2.0 + 0.5
    got = compose(outer[:, None], inner)
    assert got.shape == (2 * degree + 1, 1)
    with mp.workdps(40):
        for tau in (0.0, 0.25, 0.6, 1.0):
            expected = by_de_casteljau(outer, by_de_casteljau(inner, mp.mpf(tau)))
            value = evaluate(got[:, 0], np.array([tau]))[0]
            assert value == pytest.approx(float(expected), abs=4e-15 * (1.0 + 0.1 * degree))


@FEW
@given(st.integers(0, 4), st.integers(0, 40), st.data())
def test_product(low, high, data):
    one, other = data.draw(values(low + 1)), data.draw(values(high + 1))
    got = product(one, other[:, None])
    assert got.shape == (low + high + 1, 1)
    with mp.workdps(40):
        for u in (0.0, 0.3, 0.9, 1.0):
            expected = by_de_casteljau(one, mp.mpf(u)) * by_de_casteljau(other, mp.mpf(u))
            value = evaluate(got[:, 0], np.array([u]))[0]
            assert value == pytest.approx(float(expected), abs=1e-15 * (1.0 + high))

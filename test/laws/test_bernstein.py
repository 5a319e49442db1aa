"""Bernstein polynomials against exact arithmetic: identities, roots, products."""

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

#: Rounding of a sum of degree 15 with terms of order 1: a few dozen eps.
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


def exact_values(b, points=POINTS, order=0):
    """Return the values of a derivative, computed with 40 digits."""
    with mp.workdps(40):
        return [float(mp.diff(lambda x: by_de_casteljau(b, x), u, order)) for u in points]


def close(result, expected, tolerance=ROUNDING):
    np.testing.assert_allclose(result, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("degree", DEGREES)
def test_operations_on_ordinates_agree_with_the_definition(degree):
    """Values, elevations, derivatives and integrals of ordinates are exact.

    They agree with the definition in 40 digits. The basis is a partition of unity without
    negative values.
    """
    values, b = bernstein.basis(degree, POINTS), ordinates(degree)
    close(values.sum(axis=1), 1.0)
    assert values.min() >= 0.0
    close(evaluate(b, POINTS), exact_values(b))
    higher = bernstein.elevate(b, degree + 6)
    assert higher.size == degree + 7
    close(exact_values(higher), exact_values(b))
    slope, grown = bernstein.derivative(b), max(degree, 1) * ROUNDING
    close(evaluate(slope, POINTS), exact_values(b, order=1), grown)
    integral = bernstein.antiderivative(b, start=0.75)
    assert integral[0] == 0.75
    close(bernstein.derivative(integral), b, (degree + 1) * ROUNDING)


@pytest.mark.parametrize("degree", DEGREES)
def test_split_and_restrict_keep_the_polynomial(degree):
    """Both parts of a split, and a restriction, are the polynomial on their intervals."""
    b = ordinates(degree)
    for u in (0.25, 0.5, 0.9):
        left, right = bernstein.split(b, u)
        assert left[-1] == right[0]
        close(exact_values(left), exact_values(b, u * POINTS))
        close(exact_values(right), exact_values(b, u + (1.0 - u) * POINTS))
    for start, stop in ((0.0, 1.0), (0.0, 0.3), (0.25, 0.75), (0.7, 1.0)):
        expected = exact_values(b, start + (stop - start) * POINTS)
        close(exact_values(bernstein.restrict(b, start, stop)), expected)


def test_shared_tables_are_frozen():
    """Tables that calls share cannot be changed."""
    for table in (bernstein.binomials(7), bernstein.elevation_matrix(3, 5)):
        with pytest.raises(ValueError, match="read-only"):
            table[0] = 2.0


# A single root between two signs, compared with scipy's Brent.


def rising(number):
    """Yield polynomials with one root in (0, 1), of every degree and size.

    Some roots are close to an end.
    """
    chance = np.random.default_rng(1)
    for _ in range(number):
        steps = chance.exponential(size=chance.integers(2, 17)) ** 3
        b = np.cumsum(steps) * 10.0 ** chance.integers(-12, 3)
        zero = chance.random() ** chance.integers(1, 9)
        yield b - b[0] - zero * (b[-1] - b[0])


def test_a_single_root_agrees_with_brent():
    """The single root of a rising polynomial agrees with that of scipy's Brent."""
    count = 0
    for b in rising(500):
        if b[0] * b[-1] < 0.0:
            root = brentq(bernstein.scalar(b), 0.0, 1.0, xtol=1e-300, rtol=2.0**-50, maxiter=2000)
            assert crossings(b) == pytest.approx([root], rel=1e-13)
            count += 1
    assert count > 470


def test_roots_of_flat_polynomials_are_accurate():
    """The root of u^p − r^p is accurate, although a secant from 1 converges slowly."""
    for power, root in ((3, 1e-34), (5, 1e-20), (9, 1e-28)):
        b = np.zeros(power + 1)
        b[-1] = 1.0
        assert crossings(b - root**power) == pytest.approx([root], rel=1e-12)


# All roots: every sign change is found, and only sign changes.


def from_roots(*roots, factor=1.0):
    """Return the ordinates of factor·Π(u − r)."""
    coefficients = factor * Polynomial.fromroots(roots).coef
    n = coefficients.size - 1
    b = [bernstein.binomials(j) / bernstein.binomials(n)[: j + 1] for j in range(n + 1)]
    return np.array([row @ coefficients[: j + 1] for j, row in enumerate(b)])


def test_all_roots_are_found_in_order():
    """Simple, close and scaled roots are accurate, also where the search splits."""
    for roots in ((0.3,), (0.2, 0.7), (0.1, 0.45, 0.9), (0.5,), (0.25, 0.5), (0.25, 0.5, 0.75)):
        assert crossings(from_roots(*roots)) == pytest.approx(list(roots), abs=1e-14)
    for gap in (1e-2, 1e-4, 1e-6):
        result = crossings(from_roots(0.3, 0.3 + gap))
        assert result == pytest.approx([0.3, 0.3 + gap], abs=4e-16 / gap)
    for scale in (1e-12, 1e-100, 1e-200):
        assert crossings(scale * from_roots(0.2, 0.7)) == pytest.approx([0.2, 0.7], abs=1e-13)
    assert crossings(from_roots(0.25), 2.0, 6.0) == pytest.approx([3.0], abs=1e-14)
    assert crossings(np.array([-1.0, 1.0, -1.0, 1.0])) == [0.5]  # a triple root


def test_touching_zeros_and_ends_are_not_crossings():
    """A zero that is touched, or at 0 or 1, is not a crossing.

    A zero polynomial has no crossing.
    """
    for root in (0.25, 0.5):
        assert crossings(from_roots(root, root)) == []
        assert crossings(from_roots(root, root, factor=-3.0)) == []
    assert crossings(np.zeros(6)) == crossings(np.array([0.0, 1.0, 0.0])) == []
    result = crossings(np.array([0.0, 0.4, -0.6, 0.0]))  # 3u(1 − u)(0.4 − u)
    assert result == pytest.approx([0.4], abs=1e-14)


def test_negative_intervals():
    """The negative intervals of a polynomial lie between its roots.

    u(u − 0.2)(u − 0.7) is negative between its last two roots.
    """
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
    """Every change of sign of a polynomial is found as a crossing.

    The number of crossings is odd if and only if the signs of both ends differ. It agrees with
    the sign changes of the ordinates up to pairs (Descartes).
    """
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


# Products and compositions, compared with 40 digits.


def values(size):
    return st.lists(st.floats(-1.0, 1.0), min_size=size, max_size=size).map(np.array)


@FEW
@given(st.integers(1, 60), st.data())
def test_composition_is_accurate(degree, data):
    """The composition f(u(τ)) is accurate to rounding of its largest ordinate."""
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
def test_product_is_accurate(low, high, data):
    """The ordinates of a product are accurate to rounding."""
    first, second = data.draw(values(low + 1)), data.draw(values(high + 1))
    got = product(first, second[:, None])
    assert got.shape == (low + high + 1, 1)
    with mp.workdps(40):
        for u in (0.0, 0.3, 0.9, 1.0):
            expected = by_de_casteljau(first, mp.mpf(u)) * by_de_casteljau(second, mp.mpf(u))
            value = evaluate(got[:, 0], np.array([u]))[0]
            assert value == pytest.approx(float(expected), abs=1e-15 * (1.0 + high))


@pytest.mark.parametrize("degree", DEGREES)
def test_ordinates_of_powers_agree_with_the_definition(degree):
    """The polynomial from the coefficients of its powers has their values."""
    powers = ordinates(degree)
    close(evaluate(bernstein.from_powers(powers), POINTS), Polynomial(powers)(POINTS), 4 * ROUNDING)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_hermite_polynomials_have_the_given_ends(count):
    """Each polynomial has the given value and derivatives at both ends of its interval."""
    rng = np.random.default_rng(count)
    ends, spans = rng.uniform(-1.0, 1.0, (2, count, 5)), rng.uniform(0.5, 2.0, 5)
    rows = bernstein.hermite(*ends, spans)
    for order in range(count):
        close(rows[[0, -1]], ends[:, order], 100 * ROUNDING)
        rows = bernstein.derivative(rows) / spans

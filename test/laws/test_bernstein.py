"""The Bernstein basis: identities, against 50-digit arithmetic."""

import mpmath as mp
import numpy as np
import pytest

from cam_rig.laws import bernstein

#: Rounding of a degree-15 sum of terms of order 1: a few dozen eps.
ROUNDING = 1e-14
POINTS = np.linspace(0.0, 1.0, 33)
DEGREES = [0, 1, 5, 7, 15]


def ordinates(degree: int) -> np.ndarray:
    return np.random.default_rng(degree).uniform(-1.0, 1.0, degree + 1)


def exact(b: np.ndarray, u: mp.mpf) -> mp.mpf:
    """The polynomial of ordinates ``b`` at u, by its definition."""
    n = len(b) - 1
    terms = (mp.binomial(n, i) * u**i * (1 - u) ** (n - i) * mp.mpf(c) for i, c in enumerate(b))
    return mp.fsum(terms)


def exact_at(b: np.ndarray, points: np.ndarray) -> list[float]:
    with mp.workdps(50):
        return [float(exact(b, mp.mpf(u))) for u in points]


@pytest.mark.parametrize("degree", DEGREES)
def test_partition_of_unity(degree):
    """The basis sums to one and is nowhere negative on [0, 1]: a curve stays in its hull."""
    values = bernstein.basis(degree, POINTS)
    np.testing.assert_allclose(values.sum(axis=1), 1.0, rtol=0, atol=ROUNDING)
    assert values.min() >= 0.0


@pytest.mark.parametrize("degree", DEGREES)
def test_evaluate(degree):
    """Values are those of the definition in 50 digits."""
    b = ordinates(degree)
    np.testing.assert_allclose(
        bernstein.evaluate(b, POINTS), exact_at(b, POINTS), rtol=0, atol=ROUNDING
    )


@pytest.mark.parametrize("degree", DEGREES)
def test_elevate_keeps_the_polynomial(degree):
    """The same polynomial written with a higher degree has the same values."""
    b = ordinates(degree)
    higher = bernstein.elevate(b, degree + 6)
    assert higher.size == degree + 7
    np.testing.assert_allclose(exact_at(higher, POINTS), exact_at(b, POINTS), atol=ROUNDING)


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("at", [0.25, 0.5, 0.9])
def test_split(degree, at):
    """The halves of a split are the polynomial on either side, and they meet."""
    b = ordinates(degree)
    left, right = bernstein.split(b, at)
    assert left[-1] == right[0]
    np.testing.assert_allclose(exact_at(left, POINTS), exact_at(b, at * POINTS), atol=ROUNDING)
    np.testing.assert_allclose(
        exact_at(right, POINTS), exact_at(b, at + (1.0 - at) * POINTS), atol=ROUNDING
    )


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize(("start", "stop"), [(0.0, 1.0), (0.0, 0.3), (0.25, 0.75), (0.7, 1.0)])
def test_restrict(degree, start, stop):
    """The polynomial written on a part of [0, 1] has that part's values."""
    b = ordinates(degree)
    part = bernstein.restrict(b, start, stop)
    expected = exact_at(b, start + (stop - start) * POINTS)
    np.testing.assert_allclose(exact_at(part, POINTS), expected, atol=ROUNDING)


@pytest.mark.parametrize("degree", DEGREES)
def test_derivative(degree):
    """d/du is that of 50-digit differentiation; rounding grows with the degree."""
    b = ordinates(degree)
    slope = bernstein.evaluate(bernstein.derivative(b), POINTS)
    with mp.workdps(50):
        expected = [float(mp.diff(lambda u: exact(b, u), mp.mpf(u))) for u in POINTS]
    np.testing.assert_allclose(slope, expected, rtol=0, atol=max(degree, 1) * ROUNDING)


@pytest.mark.parametrize("degree", DEGREES)
def test_antiderivative(degree):
    """Integrating begins at the start value and undoes differentiating."""
    b = ordinates(degree)
    integral = bernstein.antiderivative(b, start=0.75)
    assert integral[0] == 0.75
    np.testing.assert_allclose(
        bernstein.derivative(integral), b, rtol=0, atol=(degree + 1) * ROUNDING
    )


def test_columns_side_by_side():
    """n polynomials in columns give what they give one by one."""
    b = np.stack([ordinates(5), ordinates(5)[::-1]], axis=1)
    for operation in (bernstein.derivative, bernstein.antiderivative):
        both = operation(b)
        np.testing.assert_array_equal(both[:, 1], operation(b[:, 1]))
    np.testing.assert_allclose(
        bernstein.evaluate(b, POINTS)[:, 0], bernstein.evaluate(b[:, 0], POINTS), atol=ROUNDING
    )


def test_shared_tables_are_frozen():
    """Cached tables cannot be changed by who reads them."""
    for table in (bernstein.binomials(7), bernstein.elevation_matrix(3, 5)):
        with pytest.raises(ValueError, match="read-only"):
            table[0] = 2.0


@pytest.mark.parametrize(("power", "root"), [(3, 1e-34), (5, 1e-20), (9, 1e-28)])
def test_a_root_beside_the_start_is_found(power, root):
    """u^p − r^p has its root to a few digits' ends, though a secant from 1 creeps towards it."""
    ordinates = np.zeros(power + 1)
    ordinates[-1] = 1.0
    assert bernstein.crossings(ordinates - root**power) == pytest.approx([root], rel=1e-12)

"""Roots of Bernstein polynomials: every change of sign, and nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from cam_rig.laws import bernstein

DENSE = np.linspace(0.0, 1.0, 4001)


def from_roots(*roots: float, factor: float = 1.0) -> np.ndarray:
    """Ordinates of factor·Π(u − r)."""
    powers = factor * Polynomial.fromroots(roots).coef
    n = powers.size - 1
    b = [bernstein.binomials(j) / bernstein.binomials(n)[: j + 1] for j in range(n + 1)]
    return np.array([row @ powers[: j + 1] for j, row in enumerate(b)])


@pytest.mark.parametrize("roots", [(0.3,), (0.2, 0.7), (0.1, 0.45, 0.9), (0.5,), (0.25, 0.5)])
def test_simple_roots(roots):
    """Each simple root inside is found, in order, to rounding."""
    assert bernstein.crossings(from_roots(*roots)) == pytest.approx(list(roots), abs=1e-14)


def test_double_root_is_no_crossing():
    """Touching zero is no change of sign, on either side of zero."""
    for root in (0.25, 0.5):
        assert bernstein.crossings(from_roots(root, root)) == []
        assert bernstein.crossings(from_roots(root, root, factor=-3.0)) == []


def test_triple_root_is_one_crossing():
    """A triple root at a split point changes the sign once."""
    assert bernstein.crossings(np.array([-1.0, 1.0, -1.0, 1.0])) == [0.5]


def test_root_exactly_at_the_split():
    """A root at u = 0.5, where the search splits, is found once among others."""
    assert bernstein.crossings(from_roots(0.25, 0.5, 0.75)) == pytest.approx([0.25, 0.5, 0.75])


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_close_roots(gap):
    """Two roots a gap apart are both found; their error grows as eps / gap."""
    found = bernstein.crossings(from_roots(0.3, 0.3 + gap))
    assert found == pytest.approx([0.3, 0.3 + gap], abs=4e-16 / gap)


def test_zero_everywhere():
    """The zero polynomial never changes sign."""
    assert bernstein.crossings(np.zeros(6)) == []


def test_roots_at_the_ends_are_outside():
    """A root at 0 or 1 is not inside (0, 1), and does not hide the one that is."""
    assert bernstein.crossings(np.array([0.0, 1.0, 0.0])) == []
    found = bernstein.crossings(np.array([0.0, 0.4, -0.6, 0.0]))  # 3u(1 − u)(0.4 − u)
    assert found == pytest.approx([0.4], abs=1e-14)


def test_given_interval():
    """Roots are given in the coordinate of the interval named."""
    assert bernstein.crossings(from_roots(0.25), 2.0, 6.0) == pytest.approx([3.0], abs=1e-14)


@pytest.mark.parametrize("scale", [1e-12, 1e-100, 1e-200])
def test_scale_does_not_matter(scale):
    """A polynomial times a small number has the same roots."""
    assert bernstein.crossings(scale * from_roots(0.2, 0.7)) == pytest.approx([0.2, 0.7], abs=1e-13)


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


@settings(max_examples=4 * settings.default.max_examples)
@given(ordinate_lists)
def test_every_change_of_sign_is_found(numbers):
    """Between two samples clear of zero lie an odd number of crossings iff the sign differs."""
    b = np.array(numbers)
    values = bernstein.evaluate(b, DENSE)
    clear = np.abs(values) > 1e-12 * np.abs(b).max()  # beyond the rounding of evaluate
    u, signs = DENSE[clear], np.sign(values[clear])
    roots = np.array(bernstein.crossings(b))
    assert np.all(np.diff(roots) >= 0.0)
    assert np.all((roots > 0.0) & (roots < 1.0))
    counts = np.diff(np.searchsorted(roots, u))
    np.testing.assert_array_equal(counts % 2 == 1, signs[1:] != signs[:-1])


@settings(max_examples=4 * settings.default.max_examples)
@given(ordinate_lists)
def test_descartes_rule(numbers):
    """There are no more roots than sign changes of the ordinates, and as many but for pairs."""
    b = np.array(numbers)
    roots = bernstein.crossings(b)
    assert len(roots) <= bernstein.sign_changes(b)
    if b[0] * b[-1] != 0.0:
        assert (bernstein.sign_changes(b) - len(roots)) % 2 == 0

"""Analysis of variance: sums that add up, and tables whose answer is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cam_rig.paper.anova import two_levels, two_way

TABLES = arrays(np.float64, (3, 4), elements=st.floats(-100.0, 100.0))


@given(TABLES)
def test_sums_of_squares_add_up(values):
    """Rows, columns and interaction are all of the variation about the mean."""
    found = two_way(values)
    total = ((values - values.mean()) ** 2).sum()
    assert found.total == pytest.approx(total, abs=1e-9)
    assert sum(found.shares) == pytest.approx(1.0) or total < 1e-9
    assert found.classes == pytest.approx(found.rows, abs=1e-9)


@given(TABLES)
def test_effects_are_about_the_mean(values):
    """Effects of rows add up to nothing, and of columns."""
    found = two_way(values)
    assert found.row_effects.sum() == pytest.approx(0.0, abs=1e-9)
    assert found.column_effects.sum() == pytest.approx(0.0, abs=1e-9)
    turned = two_way(values.T)
    assert (turned.rows, turned.columns) == pytest.approx((found.columns, found.rows), abs=1e-9)


def test_additive_table_has_no_interaction():
    """Effects that add: shares as their sums of squares, nothing left."""
    rows, columns = np.array([-2.0, 0.0, 2.0]), np.array([-1.0, 1.0])
    found = two_way(5.0 + rows[:, None] + columns)
    assert found.mean == 5.0
    assert (found.rows, found.columns, found.interaction) == pytest.approx((16.0, 6.0, 0.0))


def test_pure_interaction():
    """A table of opposite corners has neither row nor column effect."""
    assert two_way(np.array([[1.0, -1.0], [-1.0, 1.0]])).shares == (0.0, 0.0, 1.0)


def test_classes_of_rows():
    """Two rows of one class that differ only between themselves leave nothing between classes."""
    values = np.array([[1.0, 1.0], [3.0, 3.0], [2.0, 2.0]])
    found = two_way(values, ["a", "a", "b"])
    assert found.rows == pytest.approx(4.0)
    assert found.classes == pytest.approx(0.0)


def test_nothing_varies():
    """A constant table has no shares to speak of."""
    assert two_way(np.ones((2, 2))).shares == (0.0, 0.0, 0.0)


@given(arrays(np.float64, (2, 2, 2), elements=st.floats(-100.0, 100.0)))
def test_shares_of_two_levels_are_of_all(values):
    """Every factor and interaction once; a two-way table gives the same two shares."""
    shares = two_levels(values)
    total = ((values - values.mean()) ** 2).sum()
    assert len(shares) == 7
    assert sum(shares.values()) == pytest.approx(1.0) or total < 1e-9
    flat = two_way(values[0])
    if flat.total > 1e-6:
        of_two = two_levels(values[0])
        assert of_two[(0,)] == pytest.approx(flat.shares[0], abs=1e-6)
        assert of_two[(0, 1)] == pytest.approx(flat.shares[2], abs=1e-6)

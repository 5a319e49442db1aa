"""Intervals and the one grid of samples they share."""

import itertools
from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.dynamics import Interval
from cam_rig.units import NS

times_ns = st.integers(0, 20 * NS)
rates = st.integers(100, 1_000_000)


@given(st.lists(times_ns, min_size=2, max_size=8, unique=True), rates)
def test_consecutive_intervals_share_no_sample_and_miss_none(cuts, rate):
    """Each interval's first sample is the one after the last of the interval before."""
    cuts = sorted(cuts)
    pairs = itertools.pairwise(cuts)
    grids = [Interval(a, b, 0.0, 1.0).grid(rate) for a, b in pairs]
    for before, after in itertools.pairwise(grids):
        assert after.first == before.first + before.count
    whole = Interval(cuts[0], cuts[-1], 0.0, 1.0).grid(rate)
    assert whole.first == grids[0].first
    assert whole.count == sum(grid.count for grid in grids)


@given(times_ns, st.integers(1, NS), rates)
def test_samples_lie_inside(start, length, rate):
    """All instants k / rate in [start, stop) belong to the interval, and no other does."""
    grid = Interval(start, start + length, 0.0, 1.0).grid(rate)
    low, high = Fraction(start, NS), Fraction(start + length, NS)
    assert grid.count >= 0
    assert Fraction(grid.first - 1, rate) < low <= Fraction(grid.first, rate)
    end = grid.first + grid.count
    assert Fraction(end - 1, rate) < high <= Fraction(end, rate)


@given(times_ns, st.integers(1, NS), rates)
def test_offset_is_exact(start, length, rate):
    """The first sample's distance from the start is the exact fraction, rounded once."""
    grid = Interval(start, start + length, 0.0, 1.0).grid(rate)
    assert grid.offset == float(Fraction(grid.first, rate) - Fraction(start, NS))


def test_index_after():
    """The first sample at or after a time; never before the first."""
    grid = Interval(0, NS, 0.0, 1.0).grid(1000)
    assert [grid.index_after(t) for t in (-1.0, 0.0, 0.25, 0.2501)] == [0, 0, 250, 251]
    np.testing.assert_allclose(grid.since_start()[[0, 999]], [0.0, 0.999], rtol=1e-15)


def test_an_hour_on_the_grid_is_still_exact():
    """Rig time does not wear out the grid: it is counted in whole numbers."""
    hour = 3600 * NS
    grid = Interval(hour + 1, hour + NS, 0.0, 1.0).grid(48_000)
    assert grid.first == 3600 * 48_000 + 1
    assert grid.count == 48_000 - 1

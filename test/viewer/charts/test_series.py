"""Thinning a line never loses a peak."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.viewer.quantities import extremes


@pytest.mark.parametrize(("count", "bucket"), [(1, 5), (5, 5), (52, 5), (100, 7), (9, 100)])
def test_least_and_greatest_of_every_bucket_stay_in_order(count: int, bucket: int) -> None:
    """Each bucket keeps its own two, also the last, shorter one."""
    values = np.random.default_rng(1).normal(size=count)
    kept = extremes(values, bucket)
    assert np.all(np.diff(kept) > 0)
    assert kept.size <= 2 * -(-count // bucket)
    for begin in range(0, count, bucket):
        part = values[begin : begin + bucket]
        of_part = values[kept[(kept >= begin) & (kept < begin + bucket)]]
        assert of_part.min() == part.min()
        assert of_part.max() == part.max()


def test_a_bucket_of_one_keeps_all() -> None:
    """Nothing is thinned."""
    np.testing.assert_array_equal(extremes(np.array([3.0, 1.0, 2.0]), 1), [0, 1, 2])

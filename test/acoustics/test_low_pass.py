"""The recursion of every low pass, taken in blocks: that of scipy's filter, to rounding."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from cam_rig.acoustics.radiation import BLOCK, first_order


@pytest.mark.variants(8)
@pytest.mark.parametrize("count", [0, 1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3000, 100_000])
@pytest.mark.parametrize("decay", [0.0, 1e-5, 0.01, 0.6, 30.0, 800.0])
def test_it_is_the_recursion(count, decay):
    """One sample after the other, from what was before the first.

    The power that takes a block's end to the next one's is rounded once a block, as long as the
    low pass remembers.
    """
    keep, drive = math.exp(-decay), np.random.default_rng(count).normal(size=count)
    wanted = lfilter([1.0], [1.0, -keep], drive, zi=[keep * 1.3])[0]
    found = first_order(keep, drive, 1.3)
    remembered = min(count, 1.0 / max(decay, 1e-9)) / BLOCK
    limit = (1e-14 + 2.0**-53 * remembered) * np.abs(wanted).max(initial=1.0)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=limit)


def test_cut_anywhere_it_is_the_same():
    """A tick goes on where the one before has ended."""
    drive = np.random.default_rng(1).normal(size=1000)
    whole = first_order(0.99, drive, -0.5)
    first = first_order(0.99, drive[:333], -0.5)
    rest = first_order(0.99, drive[333:], float(first[-1]))
    np.testing.assert_allclose(np.concatenate([first, rest]), whole, rtol=0.0, atol=1e-13)

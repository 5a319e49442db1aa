"""What is taken of an array everywhere."""

import numpy as np
import pytest

from cam_rig.units import correlation_length


def test_neighbours_that_err_alike_are_counted_as_one():
    """Noise has length 1; each value eight times has length 8."""
    noise = np.random.default_rng(1).standard_normal(4000)
    assert correlation_length(noise) < 1.3
    assert correlation_length(np.repeat(noise, 8)) == pytest.approx(8.0, rel=0.2)

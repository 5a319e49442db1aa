"""An encoder's count is found from the angles read through it, at any speed and rate."""

import doctest

import numpy as np
import pytest

from cam_rig.simulation import instruments as encoder
from cam_rig.simulation.instruments import encoder_count
from cam_rig.units import TURN


def test_the_example_is_true():
    """What the docstring promises."""
    assert doctest.testmod(encoder, extraglobs={"np": np}).failed == 0


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(40))
def test_the_count_is_found(seed):
    """Of any encoder, at any speed, read at even times or not; some counts may be passed over."""
    random = np.random.default_rng(seed)
    number = int(random.choice([60, 360, 500, 1000, 1024, 4096, 10_000]))
    time = np.linspace(0.0, random.uniform(1.0, 12.0), int(random.choice([1000, 5000, 20_000])))
    if seed % 2:
        time = np.sort(random.uniform(0.0, time[-1], time.size))
    angle = random.uniform(3.0, 60.0) * time + 0.02 * np.sin(3.0 * time) * (seed % 3)
    step = TURN / number
    stepped = np.floor((angle + random.uniform(0.0, 40.0)) / step) * step
    assert TURN / encoder_count(stepped) == pytest.approx(number, rel=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_an_exact_angle_has_no_counts(seed):
    """Neither at a steady speed, whose steps are equal, nor with ripple, nor at random times."""
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, 3.0, 3000)
    speed = random.uniform(3.0, 60.0)
    assert encoder_count(speed * time) == 0.0
    assert encoder_count(speed * time + 0.2 * np.sin(7.0 * time)) == 0.0
    assert encoder_count(np.cumsum(random.uniform(0.0, 0.05, 6000))) == 0.0

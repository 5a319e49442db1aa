"""Numbers with units and errors, as they are shown."""

import math

import numpy as np
import pytest

from cam_rig.units import rounded_to_error


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (14.947876, 0.0323, "14.948"),
        (1.2999, 0.0996, "1.30"),
        (4042.31, 123.0, "4040"),
        (-0.001, 0.13, "0.00"),
        (3.3e8, 1.23e6, "3.300e+08"),
        (1e-9, 2.2e-11, "1.000e-09"),
        (14.947876, 0.0, "14.9479"),
        (14.947876, math.nan, "14.9479"),
    ],
)
def test_a_value_is_shown_to_two_digits_of_its_error(value, error, shown):
    """No digit beyond them, and none that is missing; without an error six."""
    assert rounded_to_error(value, error) == shown


def test_rounding_costs_less_than_a_twentieth_of_the_error():
    """Half a unit of the error's second digit, over 30 orders of value and error."""
    random = np.random.default_rng(0)
    for _ in range(500):
        error = 10.0 ** random.uniform(-15, 12)
        value = random.choice([-1, 1]) * error * 10.0 ** random.uniform(-3, 8)
        assert abs(float(rounded_to_error(value, error)) - value) <= 0.0501 * error

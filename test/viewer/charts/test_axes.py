"""Axes of round numbers: from, to and marks of any two values."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.show.chart import ABOVE, round_range, step_marks, tens_range

SEED = 18


def some_ends() -> list[tuple[float, float]]:
    """Pairs that differ by anything from a thousandth to a million, around 0 and away from it."""
    random = np.random.default_rng(SEED)
    size = 10.0 ** random.uniform(-3.0, 6.0, 300)
    low = random.uniform(-1.0, 1.0, 300) * size
    return [*zip(low.tolist(), (low + size * random.uniform(0.01, 1.0, 300)).tolist(), strict=True)]


def test_an_axis_holds_its_values_and_wastes_little() -> None:
    """From and to are whole steps of 1, 2 or 5 by a power of ten, less than one beyond each end."""
    for low, high in some_ends():
        left, right, step = round_range(low, high)
        mantissa = step / 10.0 ** np.floor(np.log10(step) + 1e-9)
        assert round(mantissa, 9) in (1.0, 2.0, 5.0)
        assert left <= low + 1e-9 * step
        assert high <= right + 1e-9 * step
        assert low - left < step * (1.0 + 1e-9)
        assert right - high < step * (1.0 + 1e-9)
        assert (high - low) / step <= 5.0 + 1e-9


def test_every_axis_has_two_to_four_numbers() -> None:
    """They are within it, whole steps apart, and 0 is one of them where the axis passes it."""
    for low, high in some_ends():
        left, right, step = round_range(low, high)
        marks = step_marks(left, right, step)
        values = np.array([*marks])
        assert 2 <= values.size <= 4
        assert left - 1e-9 * step <= values.min()
        assert values.max() <= right + 1e-9 * step
        apart = np.diff(values) / step
        np.testing.assert_allclose(apart, np.rint(apart), atol=1e-6)
        if left <= 0.0 <= right:
            assert np.abs(values).min() < 1e-9 * step
        for value, words in marks.items():
            assert float(words.replace("−", "-")) == pytest.approx(value, rel=1e-5)


def test_what_does_not_change_has_an_axis_too() -> None:
    """A follower that never leaves its cam has a gap of 0, from 0 to 1."""
    assert round_range(0.0, 0.0)[:2] == (0.0, 1.0)


def test_an_axis_over_time_has_three_numbers_and_room_for_them() -> None:
    """Powers of ten times a whole number, at most eleven apart, half of the axis used at least."""
    for low, high in some_ends():
        left, right = tens_range(low, high)
        assert left <= low and high <= right
        step = 10.0 ** np.floor(np.log10(high - low) + 1e-9)
        numbers = np.arange(np.ceil(left / step - 1e-9), right / step)
        assert numbers.size >= 3
        assert (right - left) / step <= 10.0 * (1.0 + ABOVE) + 1.0
        assert high - low >= 0.33 * (right - left)

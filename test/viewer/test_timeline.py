"""Whole degrees and turns of rows whose time was rounded."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.viewer.timeline import CAM_DEGREES, TURN, TURN_DEGREES, time_columns


@pytest.mark.parametrize("rpm", [60.0, 200.0, 400.0, 3000.0, 10_000.0])
def test_a_row_at_the_end_of_a_turn_is_at_0_of_the_next(rpm: float) -> None:
    """Angles reached at whole ns, before or after the turn is full, as the drive says them."""
    turns = np.arange(1, 700)
    speed = rpm * np.pi / 30.0
    time = np.floor(turns * 2.0 * np.pi / speed * 1e9) * 1e-9
    columns = {
        str(column.timeline): column.as_arrow_array().cast("int64").to_numpy()
        for column in time_columns(time, time * speed)
    }
    np.testing.assert_array_equal(columns[TURN], turns)
    np.testing.assert_array_equal(columns[TURN_DEGREES], np.zeros(turns.size))
    np.testing.assert_array_equal(columns[CAM_DEGREES], 360 * turns)

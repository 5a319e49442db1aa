"""Sound pressure and its level."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.acoustics import level_db, pressure_pa


@given(st.floats(-50.0, 200.0))
def test_inverse(level):
    """Pressure to level and back, to rounding."""
    assert float(level_db(pressure_pa(level))) == pytest.approx(level, abs=1e-12)


def test_reference_values():
    """20 µPa is 0 dB; 94 dB, the calibrator's level, is 1.0024 Pa; ten times more is 20 dB."""
    assert float(level_db(20e-6)) == 0.0
    assert float(pressure_pa(94.0)) == pytest.approx(1.0024, abs=5e-5)
    assert float(level_db(10.0) - level_db(1.0)) == pytest.approx(20.0, rel=1e-14)


def test_arrays():
    """Many at once are as one by one."""
    levels = np.array([0.0, 60.0, 94.0])
    one_by_one = [float(pressure_pa(level)) for level in levels]
    np.testing.assert_allclose(pressure_pa(levels), one_by_one, rtol=1e-15)

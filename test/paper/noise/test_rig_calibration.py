"""Calibration finds the constants a curve was made with, and nothing it may not use."""

import dataclasses

import numpy as np
import pytest

from cam_rig.acoustics import level_db, steady_power
from cam_rig.errors import DynamicsError
from cam_rig.paper.noise.calibration import calibrate

RPM = np.linspace(200.0, 400.0, 9)
SPEEDS = RPM * np.pi / 30.0


def levels_of(law, follower, radiation):
    power = [steady_power(law, follower, radiation, float(speed)) for speed in SPEEDS]
    return level_db(np.sqrt(np.array(power)))


@pytest.mark.parametrize(("gain", "corner"), [(2e-4, 15.0), (5e-5, 60.0)])
def test_recovers_gain_and_corner(laws, follower, radiation, gain, corner):
    """From levels made with known constants it gets them back, to the search's 1e-6."""
    law = laws["poly345"]
    true = dataclasses.replace(radiation, gain=gain, corner=corner)
    start = dataclasses.replace(radiation, gain=1e-3, corner=5.0)
    found, rmse = calibrate(law, follower, start, SPEEDS, levels_of(law, follower, true))
    assert found.gain == pytest.approx(gain, rel=1e-4)
    assert found.corner == pytest.approx(corner, rel=1e-4)
    assert rmse < 1e-4


def test_background_is_left_alone(laws, follower, radiation):
    """Two numbers are fitted; the rest stays as it was."""
    levels = levels_of(laws["poly345"], follower, radiation)
    found, _ = calibrate(laws["poly345"], follower, radiation, SPEEDS, levels)
    same = dataclasses.replace(found, gain=radiation.gain, corner=radiation.corner)
    assert same == radiation


def test_residual_is_the_rms_difference(laws, follower, radiation):
    """Levels that zigzag by ±0.5 dB leave nearly that residual, as the fit can show."""
    law = laws["poly345"]
    zigzag = 0.5 * (-1.0) ** np.arange(RPM.size)
    levels = levels_of(law, follower, radiation) + zigzag
    found, rmse = calibrate(law, follower, radiation, SPEEDS, levels)
    left = levels_of(law, follower, found) - levels
    assert rmse == pytest.approx(float(np.sqrt(np.mean(left**2))), rel=1e-9)
    assert 0.4 < rmse <= 0.5


def test_refuses_a_cam_that_lifts_off(laws, follower, radiation):
    """With jumps the steady response does not hold: the error names cam and speed."""
    fast = np.array([300.0, 600.0]) * np.pi / 30.0
    with pytest.raises(DynamicsError, match="cam 'poly345' loses contact at 600 rpm; allowed"):
        calibrate(laws["poly345"], follower, radiation, fast, np.array([80.0, 90.0]))

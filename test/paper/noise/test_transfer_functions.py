"""Structures between force and sound: sums over harmonics, and what a fit is worth."""

import numpy as np
import pytest

from cam_rig.acoustics import steady_power
from cam_rig.paper.noise.calibration import (
    HARMONICS,
    STRUCTURES,
    compare_structures,
    harmonic_power,
)
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

SPEEDS = np.linspace(200.0, 400.0, 11) * np.pi / 30.0


def test_harmonics_through_the_low_pass_are_the_steady_response(laws, follower, radiation):
    """Parseval: the sum over harmonics is the exact mean square over a turn, to 1e-3."""
    frequency = np.arange(1, HARMONICS + 1) * SPEEDS[:, None] / (2.0 * np.pi)
    low_pass = STRUCTURES[0].transfer(np.log([radiation.gain, radiation.corner]), frequency)
    for cam in ("poly345", "bezier15"):
        power = np.sum(low_pass * harmonic_power(laws[cam], follower, SPEEDS), axis=1)
        exact = [
            steady_power(laws[cam], follower, radiation, float(s))
            - radiation.background_power(float(s))
            for s in SPEEDS
        ]
        np.testing.assert_allclose(power, exact, rtol=1e-3)


@pytest.mark.long
def test_the_low_pass_predicts_best():
    """More constants fit the cam they see better, and the cam they do not see worse; an A-weighted
    level of this sound could not have had the published shape."""
    loaded = open_scene(config_root() / "scenes" / "tm21_sweep.yaml")
    cams, speeds = ("poly345", "bezier15"), np.array(loaded.scene.program.speeds.si_list)
    fits = compare_structures(
        {cam: loaded.laws[cam] for cam in cams},
        loaded.follower,
        loaded.radiation,
        {cam: loaded.published_levels(cam, speeds * 30.0 / np.pi) for cam in cams},
        speeds,
        "poly345",
    )
    by_name = {(fit.name, fit.weighting): fit for fit in fits}
    plain, modes = by_name["low-pass", "Z"], by_name["two modes", "Z"]
    assert modes.fitted_db < plain.fitted_db
    assert modes.predicted_db["bezier15"] > 1.5 * plain.predicted_db["bezier15"]
    assert by_name["two modes", "A"].fitted_db > plain.fitted_db
    assert all(plain.predicted_db["bezier15"] < 1.01 * fit.predicted_db["bezier15"] for fit in fits)


@pytest.fixture
def radiation():
    """The shipped constants."""
    return open_scene(config_root() / "scenes" / "tm21_sweep.yaml").radiation

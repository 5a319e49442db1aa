"""Fits find the constants that a curve was made with, and say what they cannot."""

import dataclasses

import numpy as np
import pytest

from cam_rig.acoustics import level_db, steady_power
from cam_rig.errors import DynamicsError
from cam_rig.paper.noise.calibration import (
    HARMONICS,
    STRUCTURES,
    PublishedCam,
    by_substitution,
    calibrate,
    compare_structures,
    harmonic_power,
    sensitivity,
    two_constants,
)
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.simulate import Acoustics, settled_turns

SPEEDS = np.linspace(200.0, 400.0, 11) * np.pi / 30.0


@pytest.fixture
def published_cam(make_loaded_scene):
    """A function that makes a cam whose published levels are those of given constants."""
    loaded = make_loaded_scene()

    def make(cam, true):
        turns = settled_turns(loaded.laws[cam], "one_mass", loaded.follower, SPEEDS)
        return PublishedCam(cam, turns, true.levels(turns))

    return make


def test_two_constants_are_recovered(make_loaded_scene, published_cam):
    """From two cams: gain and corner come back."""
    start = Acoustics(make_loaded_scene().radiation)
    true = start.with_constants(2e-4, 12.0)
    cams = [published_cam(cam, true) for cam in ("poly345", "bezier15")]
    found = two_constants(cams, start).radiation
    assert (found.gain, found.corner) == pytest.approx((2e-4, 12.0), rel=1e-5)


def test_substitution_carries_over(make_loaded_scene, published_cam):
    """What one cam measures of the rig's speed response holds for another, to 0.05 dB."""
    start = Acoustics(make_loaded_scene().radiation)
    r = start.radiation
    true = start.with_constants(r.gain, r.corner, (0.5, -0.4, 0.3))
    found = by_substitution(published_cam("poly345", true), start)
    assert published_cam("poly345", true).rms(found) < 0.02
    assert published_cam("bezier15", true).rms(found) < 0.2
    plain = two_constants([published_cam("poly345", true)], start)
    assert published_cam("bezier15", true).rms(found) < published_cam("bezier15", true).rms(plain)


@pytest.mark.parametrize("response", [(), (0.5, -0.4, 0.3)])
def test_sensitivity_is_the_derivative(make_loaded_scene, published_cam, response):
    """A small change of a constant moves the levels as the sensitivity says."""
    r = make_loaded_scene().radiation
    acoustics = Acoustics(r, response)
    cam = published_cam("bezier15", acoustics)
    slope = sensitivity(cam, acoustics)
    louder = acoustics.with_constants(r.gain * 1.001, r.corner, response)
    np.testing.assert_allclose(
        cam.difference(louder), slope[:, 0] * np.log(1.001), rtol=1e-2, atol=1e-6
    )
    assert slope.shape == (SPEEDS.size, 4 if response else 2)
    if response:
        tilted = acoustics.with_constants(r.gain, r.corner, (0.501, -0.4, 0.3))
        np.testing.assert_allclose(cam.difference(tilted), slope[:, 1] * 1e-3, rtol=1e-2, atol=1e-7)


# Of one cam with a closed form, as cam-rig calibrate fits it.


def levels_of(law, follower, radiation):
    power = [steady_power(law, follower, radiation, float(speed)) for speed in SPEEDS]
    return level_db(np.sqrt(np.array(power)))


@pytest.mark.variants(1)
@pytest.mark.parametrize(("gain", "corner"), [(2e-4, 15.0), (5e-5, 60.0)])
def test_recovers_gain_and_corner(laws, follower, radiation, gain, corner):
    """From levels made with known constants it gets them back; all else stays as it was."""
    law = laws["poly345"]
    true = dataclasses.replace(radiation, gain=gain, corner=corner)
    start = dataclasses.replace(radiation, gain=1e-3, corner=5.0)
    found, rmse = calibrate(law, follower, start, SPEEDS, levels_of(law, follower, true))
    assert found.gain == pytest.approx(gain, rel=1e-4)
    assert found.corner == pytest.approx(corner, rel=1e-4)
    assert dataclasses.replace(found, gain=gain, corner=corner) == true
    assert rmse < 1e-4


def test_residual_is_the_rms_difference(laws, follower, radiation):
    """Levels that zigzag by ±0.5 dB leave nearly that residual, as the fit can show."""
    law = laws["poly345"]
    zigzag = 0.5 * (-1.0) ** np.arange(SPEEDS.size)
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


# Structures between force and sound: sums over harmonics, and what a fit is worth.


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
    """More constants fit the cam they see better, the other worse; an A-weighted level neither."""
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
    assert modes.predicted_db > 1.5 * plain.predicted_db
    assert by_name["two modes", "A"].fitted_db > plain.fitted_db
    assert all(plain.predicted_db < 1.01 * fit.predicted_db for fit in fits)

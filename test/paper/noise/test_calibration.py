"""Fits find the constants that a curve was made with, and say what they cannot."""

import numpy as np
import pytest

from cam_rig.paper.noise.calibration import (
    PublishedCam,
    by_substitution,
    sensitivity,
    two_constants,
)
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import rms

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
    """From one cam or two: gain and corner come back."""
    start = Acoustics(make_loaded_scene().radiation)
    true = start.with_constants(2e-4, 12.0)
    for cams in (["poly345"], ["poly345", "bezier15"]):
        found = two_constants([published_cam(cam, true) for cam in cams], start).radiation
        assert found.gain == pytest.approx(2e-4, rel=1e-5)
        assert found.corner == pytest.approx(12.0, rel=1e-5)


def test_substitution_carries_over(make_loaded_scene, published_cam):
    """What one cam measures of the rig's speed response holds for another, to 0.05 dB.

    The reference's corner is first fitted as if there were no response, so not all of it is exact.
    """
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


def test_rms():
    """Root mean square."""
    assert rms(np.array([3.0, -4.0])) == pytest.approx(np.sqrt(12.5), rel=1e-15)

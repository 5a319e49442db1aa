"""Profile errors as piecewise polynomials: how near, how smooth, and closed at the turn's end."""

import math

import numpy as np
import pytest

import cam_rig
from cam_rig.campaigns.inputs import ProfileErrors
from cam_rig.units import TURN

ANGLES = np.linspace(0.0, TURN, 20011)[:-1]


@pytest.fixture(scope="module")
def law():
    return cam_rig.build_law(cam_rig.load_cam("poly345"))


@pytest.mark.parametrize("degrees", [3.0, 10.0, 7.77, 100.0, 359.0, 360.0])
def test_a_wave_is_as_near_as_is_said(law, degrees):
    """Lift within 4.5e-7 of the amplitude, bend within 3.9e-5 of its own; five times at the end."""
    errors = ProfileErrors(waviness=1e-4, wavelength=math.radians(degrees), waviness_phase=0.4)
    wavy = errors.added_to(law)
    k = 360.0 / degrees
    inner = TURN - (2.0 + 1.0 / 12.0) * math.radians(degrees) > ANGLES
    for order, bound in ((0, 4.5e-7), (2, 3.9e-5 * k**2)):
        gap = np.abs(wavy(ANGLES, order) - law(ANGLES, order) - errors.at(ANGLES)[order]) / 1e-4
        assert gap.max() <= 5.0 * bound + 1e-8 * k**order
        if inner.any():
            assert gap[inner].max() <= 1.02 * bound + 1e-8 * k**order
            exact = -(k**2) * np.sin(k * ANGLES + 0.4) if order else np.sin(k * ANGLES + 0.4)
            assert np.abs(errors.at(ANGLES)[order] / 1e-4 - exact)[inner].max() < 1e-9 * k**2


@pytest.mark.parametrize("degrees", [3.0, 7.77, 33.3, 100.0, 250.0])
def test_it_closes_without_a_step(law, degrees):
    """Value, slope and bend go on at every joint, that of the turn's end too; no wave is larger."""
    errors = ProfileErrors(waviness=1e-5, wavelength=math.radians(degrees), waviness_phase=1.0)
    wavy = errors.added_to(law)
    k = 360.0 / degrees
    assert wavy.velocity_jumps == {}
    assert np.abs(wavy.jumps(0)).max() < 1e-15
    assert np.abs(wavy.jumps(2)).max() < 1e-6 * 1e-5 * k**2 + np.abs(law.jumps(2)).max() + 1e-11
    assert np.abs(errors.at(ANGLES)[0]).max() <= 1e-5 * (1.0 + 1e-12)


def test_size_and_eccentricity_are_added(law):
    """A constant, and once a turn; errors of nothing change nothing at all."""
    errors = ProfileErrors(size=2e-5, eccentricity=3e-5, eccentricity_phase=0.7)
    sum_ = errors.added_to(law)(ANGLES)
    expected = law(ANGLES) + 2e-5 + 3e-5 * np.sin(ANGLES + 0.7)
    assert np.abs(sum_ - expected).max() < 1e-6 * 3e-5
    sized = ProfileErrors(size=2e-5).added_to(law)
    assert np.abs(sized(ANGLES) - law(ANGLES) - 2e-5).max() < 1e-16
    assert np.array_equal(ProfileErrors().added_to(law).ordinates, law.ordinates)


def test_the_law_below_is_kept(law):
    """Cutting its pieces changes it by rounding alone: a wave of 1e-12 m."""
    wavy = ProfileErrors(waviness=1e-12, wavelength=math.radians(3.0)).added_to(law)
    assert wavy.spans.size == 1440
    assert np.abs(wavy(ANGLES) - law(ANGLES)).max() < 1.1e-12
    assert np.abs(wavy(ANGLES, 2) - law(ANGLES, 2)).max() < 1e-12 * 120**2 + 1e-9

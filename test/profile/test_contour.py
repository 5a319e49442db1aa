"""The contour under a roller: touched where it should be, and nowhere else."""

import numpy as np
import pytest

from cam_rig.profile import contour, pitch_curve, turn_angles


@pytest.fixture
def cam(law, cams):
    """The law's pitch radius and roller radius, m."""
    follower = cams[law.name].follower
    return follower.base_radius.si + follower.roller, follower.roller


def test_contour_is_one_roller_radius_inside_the_pitch_curve(law, cam):
    """Each point of the contour is touched by the roller at its cam angle."""
    pitch, roller = cam
    angle = turn_angles(720)
    centre = pitch_curve(law, pitch, angle)
    points = contour(law, pitch, roller, angle)
    np.testing.assert_allclose(np.hypot(*(points - centre)), roller, rtol=1e-13)
    assert np.all(np.hypot(*points) < np.hypot(*centre))


def test_roller_lies_on_the_contour_and_not_in_it(law, cam):
    """No other point of the contour is nearer to the roller's centre: nothing is undercut."""
    pitch, roller = cam
    points = contour(law, pitch, roller, turn_angles(7200))
    for angle in np.linspace(0.0, 2.0 * np.pi, 37):
        centre = pitch_curve(law, pitch, np.array([angle]))
        nearest = np.hypot(*(points - centre)).min()
        assert nearest == pytest.approx(roller, abs=2e-6)  # spacing² / 2 roller radius


def test_normal_is_square_to_the_path_of_the_centre(law, cam):
    """The common normal of roller and contour is normal to the pitch curve."""
    pitch, roller = cam
    angle, step = turn_angles(360), 1e-6
    towards = contour(law, pitch, roller, angle) - pitch_curve(law, pitch, angle)
    along = pitch_curve(law, pitch, angle + step) - pitch_curve(law, pitch, angle - step)
    cosine = np.sum(towards * along, axis=0) / np.hypot(*towards) / np.hypot(*along)
    assert np.abs(cosine).max() < 1e-6


def test_pressure_angle_is_what_the_cam_files_say(law, cam):
    """The assumed base radii keep the pressure angle atan(s'/(R_b + R_r + s)) within 30°."""
    angle = turn_angles(3600)
    slope, distance = law(angle, 1), cam[0] + law(angle)
    assert np.degrees(np.arctan2(np.abs(slope), distance)).max() < 30.0

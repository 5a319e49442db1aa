"""Measuring: a follower on any closed contour, and the contours that are none."""

import re

import numpy as np
import pytest

from cam_rig.errors import ProfileError
from cam_rig.profile import contours
from cam_rig.profile.faces import GuidedCentre, GuidedFace, SwungCentre, SwungFace
from cam_rig.profile.measure import closed_curve, rest

ANGLES = np.radians(np.arange(0.0, 360.0, 7.3))
#: A circular cam about (3, 4) mm, 20 mm in radius.
CENTRE, RADIUS = 0.003 + 0.004j, 0.020


def eccentric_circle(at):
    return CENTRE + RADIUS * np.exp(1j * at)


@pytest.mark.parametrize("roller", [0.0, 0.006])
def test_on_an_eccentric_circle_a_roller_stands_by_pythagoras(roller):
    """Height of its centre: y + √((R + r)² − x²) over the circle's centre turned with the cam."""
    element = GuidedCentre(roller, 0.0, 0.0)
    centre = CENTRE * np.exp(1j * ANGLES)
    expected = centre.imag + np.sqrt((RADIUS + roller) ** 2 - centre.real**2)
    np.testing.assert_allclose(rest(element, eccentric_circle, ANGLES), expected, rtol=1e-14)


def test_on_an_eccentric_circle_a_face_stands_one_radius_over_its_centre():
    """Square or inclined: the distance of the face from the centre is the radius."""
    centre = CENTRE * np.exp(1j * ANGLES)
    for slant in (0.0, 0.3):
        expected = (RADIUS + (centre * np.exp(-1j * slant)).imag) / np.cos(slant)
        lift = rest(GuidedFace(slant, 0.0, 0.0), eccentric_circle, ANGLES)
        np.testing.assert_allclose(lift, expected, rtol=1e-14)


@pytest.mark.parametrize("roller", [0.0, 0.006])
def test_on_an_eccentric_circle_an_arm_closes_a_triangle(roller):
    """Arm, pivot to centre, and R + r: the law of cosines."""
    pivot, arm = 0.060, 0.050
    towards = pivot - CENTRE * np.exp(1j * ANGLES)
    far = np.abs(towards)
    inner = np.arccos((arm**2 + far**2 - (RADIUS + roller) ** 2) / (2.0 * arm * far))
    expected = arm * (inner - np.angle(towards))
    lift = rest(SwungCentre(roller, arm, pivot, 0.0), eccentric_circle, ANGLES)
    np.testing.assert_allclose(lift, expected, rtol=1e-13)


def test_on_an_eccentric_circle_a_swinging_face_touches():
    """sin(φ − direction of the centre) = (R − offset) / distance of the centre."""
    pivot, arm, offset = 0.060, 0.050, 0.004
    towards = pivot - CENTRE * np.exp(1j * ANGLES)
    arm_angle = np.arcsin((RADIUS - offset) / np.abs(towards)) - np.angle(towards)
    lift = rest(SwungFace(arm, offset, pivot, 0.0), eccentric_circle, ANGLES)
    np.testing.assert_allclose(lift, arm * arm_angle, rtol=1e-13)


def test_sense_and_start_of_the_points_do_not_matter(made):
    """A contour read from a file may run either way and begin anywhere."""
    for disc, contour in zip(made.discs, contours(made.cam.follower, made.law, 2000), strict=True):
        other = np.roll(contour.points[:, ::-1], 321, axis=1)
        other = np.append(other, other[:, :1], axis=1)  # closed twice
        lift = rest(disc.element, closed_curve(other), ANGLES)
        np.testing.assert_allclose(lift, made.law(ANGLES), rtol=0, atol=1e-9 * made.law.lift)


def test_a_contour_that_the_follower_passes_by():
    """A small hole far from the axis: the roller finds nothing under it."""

    def aside(at):
        return 0.1 + 0.001 * np.exp(1j * at)

    for element in (GuidedCentre(0.005, 0.0, 0.0), GuidedCentre(0.0, 0.0, 0.0)):
        with pytest.raises(ProfileError, match=r"passes the contour by at \d+(\.\d+)?°; allowed: "):
            rest(element, aside, ANGLES)


def test_too_few_points():
    """A triangle is no contour."""
    words = "contour has 3 different points; allowed: at least 8"
    with pytest.raises(ProfileError, match=re.escape(words)):
        closed_curve(np.array([[0.0, 1.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]))

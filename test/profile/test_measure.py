"""Tests of a follower on a finished contour: lift, backlash, faulty contours."""

import re

import numpy as np
import pytest

from cam_rig.errors import ProfileError
from cam_rig.profile import contours, measure, turn_angles
from cam_rig.profile.faces import GuidedCentre, GuidedFace, SwungCentre, SwungFace

from .conftest import OPPOSITE, SampleCam, make

ANGLES = np.radians(np.arange(0.0, 360.0, 7.3))
#: Centre of a circular cam relative to its axis, m.
CENTRE = 0.003 + 0.004j
#: Radius of the circular cam, m.
RADIUS = 0.020
#: Largest backlash (m) that counts as zero.
BACKLASH_ATOL = 1e-9


def is_at(element, expected, rtol=1e-14):
    """Assert that a follower element measures the expected lift on the circular cam.

    `element` is the roller, tip or face that touches the cam.
    """
    lift = measure.rest_on_contour(
        element, lambda parameter: CENTRE + RADIUS * np.exp(1j * parameter), ANGLES
    )
    np.testing.assert_allclose(lift, expected, rtol=rtol)


def test_on_an_eccentric_circle():
    """The measured lift on an eccentric circle equals a closed form.

    It follows from the theorem of Pythagoras for a roller, and from the law of cosines for an arm.
    A flat face is one radius above the centre.
    """
    centre = CENTRE * np.exp(1j * ANGLES)
    pivot, arm, offset = 0.060, 0.050, 0.004
    far, direction = np.abs(pivot - centre), np.angle(pivot - centre)
    for roller in (0.0, 0.006):
        height = centre.imag + np.sqrt((RADIUS + roller) ** 2 - centre.real**2)
        is_at(GuidedCentre(roller, 0.0, 0.0), height)
        inner = np.arccos((arm**2 + far**2 - (RADIUS + roller) ** 2) / (2.0 * arm * far))
        is_at(SwungCentre(roller, arm, pivot, 0.0), arm * (inner - direction), 1e-13)
    for slant in (0.0, 0.3):
        height = (RADIUS + (centre * np.exp(-1j * slant)).imag) / np.cos(slant)
        is_at(GuidedFace(slant, 0.0, 0.0), height)
    # sin(φ − direction of the centre) = (R − offset) / distance of the centre
    angle = np.arcsin((RADIUS - offset) / far) - direction
    is_at(SwungFace(arm, offset, pivot, 0.0), arm * angle, 1e-13)


def test_direction_and_first_point_do_not_matter(every_kind):
    """The measured lift does not depend on how the points of the contour are listed.

    Direction, first point and repeated points have no effect.
    """
    for sample in every_kind:
        cam_contours = contours(sample.cam.follower, sample.law, 2000)
        for disc, contour in zip(sample.discs, cam_contours, strict=True):
            other = np.roll(contour.points[:, ::-1], 321, axis=1)
            other = np.append(other, other[:, :1], axis=1)  # closed twice
            lift = measure.rest_on_contour(disc.element, measure.closed_curve(other), ANGLES)
            np.testing.assert_allclose(
                lift, sample.law(ANGLES), rtol=0, atol=1e-9 * sample.law.lift
            )


def test_contours_that_cannot_be_measured():
    """A contour that the follower's path misses, or with too few points, is refused."""

    def hole(parameter):
        return 0.1 + 0.001 * np.exp(1j * parameter)

    for element in (GuidedCentre(0.005, 0.0, 0.0), GuidedCentre(0.0, 0.0, 0.0)):
        with pytest.raises(ProfileError, match=r"misses the contour at \d+(\.\d+)?°; allowed: "):
            measure.rest_on_contour(element, hole, ANGLES)
    text = "contour has 3 different points; allowed: at least 8"
    with pytest.raises(ProfileError, match=re.escape(text)):
        measure.closed_curve(np.array([[0.0, 1.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]))


# -- the decisive test of a contour: put the follower on it, and measure its lift


def assert_rests_on_the_law(sample, angles):
    """Assert that a follower measures its law on the contours, to 1e-9 of the lift."""
    for number, disc in enumerate(sample.discs):

        def curve(parameter, number=number):
            """Return points x + iy (m) of the finished contour, computed without the law."""
            x, y = sample.contours(parameter.ravel())[number].points
            return (x + 1j * y).reshape(parameter.shape)

        for element in filter(None, (disc.element, disc.opposite)):
            lift = measure.rest_on_contour(element, curve, angles)
            np.testing.assert_allclose(
                lift, sample.law(angles), rtol=0, atol=1e-9 * sample.law.lift
            )


@pytest.mark.variants(5)
def test_shipped_cams_have_the_lift_of_their_laws(law, cams, angles):
    """A follower on the contour of a shipped cam measures s(θ) to 1e-9 of the lift."""
    assert_rests_on_the_law(SampleCam(cams[law.name], law), angles[::2])


# -- points that are not a closed contour: shuffled, or with a gap


def test_contours_have_no_warnings(followable_laws, cams):
    """Contours of shipped cams with 36 or 1800 points cause no warnings.

    The contours are open or closed by a repeated point, and in both directions.
    """
    for name, law in followable_laws.items():
        for count in (36, 1800):
            for contour in contours(cams[name].follower, law, count):
                closed = np.append(contour.points, contour.points[:, :1], axis=1)
                for points in (contour.points, closed, contour.points[:, ::-1]):
                    assert measure.contour_warnings(points, True) == []


def test_warnings_of_faulty_contours():
    """A contour that crosses itself, has few points or a gap causes a warning.

    A circle of 360 points and a radius of 40 mm has a step of 0.698 mm.
    """
    angle = np.radians(np.arange(360.0))
    points = 0.040 * np.array([np.cos(angle), np.sin(angle)])
    shuffled = np.random.default_rng(1).permutation(points, axis=1)
    (crossing,) = measure.contour_warnings(shuffled, False)
    assert "crosses itself" in crossing
    (sparse,) = measure.contour_warnings(points[:, ::30], True)
    assert "12 points" in sparse
    text = "points 200 and 1 are 78.9 mm apart, the others 0.6981 mm (median)"
    assert text in measure.contour_warnings(points[:, :200], True)[0]
    (gap,) = measure.contour_warnings(np.delete(points, np.arange(10, 25), axis=1), True)
    assert "points 10 and 11 are" in gap


# -- backlash of a follower that its cam moves both ways: each element touches its contour


def test_shipped_cams_have_no_backlash(cams, laws):
    """Shipped followers that the cam moves both ways have no backlash, to 1e-9 m.

    Two opposite faces have no backlash if the fall is the rise turned by 180°.
    """
    for name in ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate"):
        assert np.abs(measure.closure(cams[name].follower, laws[name])).max() < BACKLASH_ATOL
    sample = make("constant_breadth", OPPOSITE)
    assert np.abs(measure.closure(sample.cam.follower, sample.law)).max() < BACKLASH_ATOL


def test_backlash_of_a_second_cam_for_another_rocker():
    """A second disc for a wrong angle between the arms gives the backlash −arm·δ.

    δ is the error of the angle. The backlash is the same at each cam angle.
    """
    for error in (-0.01, 0.02):
        right, wrong = (make("oscillating_conjugate", arms_angle=80.0 + d) for d in (0.0, error))
        first = contours(right.cam.follower, right.law, measure.CONTOUR_POINTS)[0]
        second = contours(wrong.cam.follower, wrong.law, measure.CONTOUR_POINTS)[1]
        curves = measure.closed_curve(first.points), measure.closed_curve(second.points)
        backlash = measure.backlash(measure.both_elements(right.discs), curves, turn_angles(36))
        np.testing.assert_allclose(backlash, -0.075 * np.radians(error), rtol=0, atol=BACKLASH_ATOL)
    sample = make("roller")
    with pytest.raises(ProfileError, match="moves both ways"):
        measure.closure(sample.cam.follower, sample.law)

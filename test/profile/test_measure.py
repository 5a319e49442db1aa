"""A follower on a finished contour: where it rests, its backlash, what is no contour."""

import re

import numpy as np
import pytest

from cam_rig.errors import ProfileError
from cam_rig.profile import contours, measure, turn_angles
from cam_rig.profile.faces import GuidedCentre, GuidedFace, SwungCentre, SwungFace

from .conftest import OPPOSITE, Made, make

ANGLES = np.radians(np.arange(0.0, 360.0, 7.3))
#: A circular cam about (3, 4) mm, 20 mm in radius.
CENTRE, RADIUS = 0.003 + 0.004j, 0.020
#: Largest backlash allowed, m.
NONE = 1e-9


def is_at(element, expected, rtol=1e-14):
    found = measure.rest(element, lambda at: CENTRE + RADIUS * np.exp(1j * at), ANGLES)
    np.testing.assert_allclose(found, expected, rtol=rtol)


def test_on_an_eccentric_circle():
    """A roller stands by Pythagoras, a face one radius over the centre, an arm by cosines."""
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


def test_sense_and_start_of_the_points_do_not_matter(every_kind):
    for made in every_kind:
        found = contours(made.cam.follower, made.law, 2000)
        for disc, contour in zip(made.discs, found, strict=True):
            other = np.roll(contour.points[:, ::-1], 321, axis=1)
            other = np.append(other, other[:, :1], axis=1)  # closed twice
            lift = measure.rest(disc.element, measure.closed_curve(other), ANGLES)
            np.testing.assert_allclose(lift, made.law(ANGLES), rtol=0, atol=1e-9 * made.law.lift)


def test_what_cannot_be_measured():
    """A small hole far from the axis, where the roller finds nothing under it; a triangle."""

    def aside(at):
        return 0.1 + 0.001 * np.exp(1j * at)

    for element in (GuidedCentre(0.005, 0.0, 0.0), GuidedCentre(0.0, 0.0, 0.0)):
        with pytest.raises(ProfileError, match=r"misses the contour at \d+(\.\d+)?°; allowed: "):
            measure.rest(element, aside, ANGLES)
    words = "contour has 3 different points; allowed: at least 8"
    with pytest.raises(ProfileError, match=re.escape(words)):
        measure.closed_curve(np.array([[0.0, 1.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]))


# The one test that a contour cannot fool: put the follower on it, and see where it rests.


def assert_rests_on_the_law(made, angles):
    for number, disc in enumerate(made.discs):

        def curve(at, number=number):
            """The finished contour; the parameter says nothing of the law."""
            x, y = made.contours(at.ravel())[number].points
            return (x + 1j * y).reshape(at.shape)

        for element in filter(None, (disc.element, disc.opposite)):
            lift = measure.rest(element, curve, angles)
            np.testing.assert_allclose(lift, made.law(angles), rtol=0, atol=1e-9 * made.law.lift)


def test_follower_rests_where_the_law_says(every_kind, angles):
    """Each kind, both elements of a frame, both cams of a pair: s(θ) to 1e-9 of the lift."""
    for made in every_kind:
        assert_rests_on_the_law(made, angles[::6])


@pytest.mark.variants(5)
def test_shipped_cams_lift_as_their_laws_say(law, cams, angles):
    assert_rests_on_the_law(Made(cams[law.name], law), angles[::2])


# Points that are no contour in order: shuffled, or with a part left out.


def test_contours_are_in_order_and_whole(followed, cams):
    """Every shipped cam at 36 angles and more, closed by its first point or not, turned over."""
    for name, law in followed.items():
        for count in (36, 1800):
            for contour in contours(cams[name].follower, law, count):
                closed = np.append(contour.points, contour.points[:, :1], axis=1)
                for points in (contour.points, closed, contour.points[:, ::-1]):
                    assert measure.contour_warnings(points, True) == []


def test_points_that_are_no_whole_contour():
    """Of a circle of 360 points, 40 mm in radius, a step is 0.698 mm."""
    angle = np.radians(np.arange(360.0))
    points = 0.040 * np.array([np.cos(angle), np.sin(angle)])
    shuffled = np.random.default_rng(1).permutation(points, axis=1)
    (crossing,) = measure.contour_warnings(shuffled, False)
    assert "crosses itself" in crossing
    (sparse,) = measure.contour_warnings(points[:, ::30], True)
    assert "12 points" in sparse
    words = "points 200 and 1 are 78.9 mm apart, the others 0.6981 mm (median)"
    assert words in measure.contour_warnings(points[:, :200], True)[0]
    (gap,) = measure.contour_warnings(np.delete(points, np.arange(10, 25), axis=1), True)
    assert "points 10 and 11 are" in gap


# A follower moved both ways has no backlash: both its elements touch, by dropping each on its cam.


def test_shipped_cams_have_no_backlash(cams, laws):
    """Both rollers touch all round; so do the faces of a fall that is its rise turned by 180°."""
    for name in ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate"):
        assert np.abs(measure.closure(cams[name].follower, laws[name])).max() < NONE
    made = make("constant_breadth", OPPOSITE)
    assert np.abs(measure.closure(made.cam.follower, made.law)).max() < NONE


def test_a_second_cam_cut_for_another_rocker_shows():
    """For an angle between the arms wrong by δ the backlash is −arm δ at every angle."""
    for wrong in (-0.01, 0.02):
        right, cut = (make("oscillating_conjugate", arms_angle=80.0 + d) for d in (0.0, wrong))
        first = contours(right.cam.follower, right.law, measure.CONTOUR_POINTS)[0]
        second = contours(cut.cam.follower, cut.law, measure.CONTOUR_POINTS)[1]
        curves = measure.closed_curve(first.points), measure.closed_curve(second.points)
        found = measure.backlash(measure.both_elements(right.discs), curves, turn_angles(36))
        np.testing.assert_allclose(found, -0.075 * np.radians(wrong), rtol=0, atol=NONE)
    made = make("roller")
    with pytest.raises(ProfileError, match="moves both ways"):
        measure.closure(made.cam.follower, made.law)

"""The one test that a contour cannot fool: put the follower on it, and see where it rests."""

import numpy as np
import pytest
from shapely import LineString, Point, Polygon

from cam_rig.profile.faces import GuidedCentre, GuidedFace, SwungCentre
from cam_rig.profile.measure import rest

from .conftest import Made


def exact_curve(made, number):
    """The finished contour as a closed parametric curve; the parameter says nothing of the law."""

    def curve(at):
        x, y = made.contours(at.ravel())[number].points
        return (x + 1j * y).reshape(at.shape)

    return curve


def assert_rests_on_the_law(made, angles):
    for number, element in made.riders():
        lift = rest(element, exact_curve(made, number), angles)
        np.testing.assert_allclose(lift, made.law(angles), rtol=0, atol=1e-9 * made.law.lift)


@pytest.mark.variants(6)
def test_follower_rests_where_the_law_says(made, angles):
    """Each kind, both elements of a frame, both cams of a pair: s(θ) to 1e-9 of the lift."""
    assert_rests_on_the_law(made, angles)


@pytest.mark.variants(9)
def test_shipped_cams_lift_as_their_laws_say(law, cams, angles):
    """The same for every cam of config/cams."""
    assert_rests_on_the_law(Made(cams[law.name], law), angles)


def in_cam_frame(points, angle):
    turned = points * np.exp(-1j * angle)
    return np.column_stack([turned.real, turned.imag])


def outline_of(element, s, angle):
    """The follower at displacement s as a shapely shape in the cam's frame, and its half width."""
    stand = element.stand(np.array([s]))
    if isinstance(element, GuidedCentre | SwungCentre):
        return Point(in_cam_frame(stand, angle)[0]), element.roller
    if isinstance(element, GuidedFace):
        along = element.side * np.exp(1j * element.inclination)
    else:
        along = np.exp(-1j * element.arm_angle(np.array(s)))
    return LineString(in_cam_frame(stand + along * np.array([-0.3, 0.3]), angle)), 0.0


@pytest.mark.variants(13)
@pytest.mark.parametrize("step", [0.0, 1e-6])
def test_follower_touches_the_cam_and_does_not_enter_it(made, step):
    """By shapely on a polygon: at s it touches; a micrometre out of the cam it does not."""
    fine = np.linspace(0.0, 2.0 * np.pi, 40_000, endpoint=False)
    polygons = [Polygon(contour.points.T) for contour in made.contours(fine)]
    for number, element in made.riders():
        for angle in np.radians(np.arange(7.0, 360.0, 30.0)):
            out = step * getattr(element, "side", 1)
            shape, width = outline_of(element, float(made.law(angle)) + out, angle)
            gap = shape.distance(polygons[number].exterior) - width
            if step == 0.0:
                assert abs(gap) < 2e-8  # m: the chords of the polygon
            else:  # the way of the contact, not that at the end of the arm
                assert 0.4 * step < gap < 1.6 * step
            if width == step == 0.0 and isinstance(shape, LineString):
                assert shape.intersection(polygons[number]).length < 4e-4

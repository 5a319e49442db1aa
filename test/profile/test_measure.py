"""A follower put on a finished contour: where it rests, whether it has play, contours that are none."""

import re

import numpy as np
import pytest
from shapely import LineString, Point, Polygon

from cam_rig.errors import ProfileError
from cam_rig.profile import contours, turn_angles
from cam_rig.profile.faces import GuidedCentre, GuidedFace, SwungCentre, SwungFace
from cam_rig.profile.measure import (
    POINTS,
    closed_curve,
    closure,
    crossing,
    gap,
    pair,
    play,
    rest,
    sparse,
)

from .conftest import OPPOSITE, UNEVEN, Made, make

ANGLES = np.radians(np.arange(0.0, 360.0, 7.3))
#: A circular cam about (3, 4) mm, 20 mm in radius.
CENTRE, RADIUS = 0.003 + 0.004j, 0.020


def eccentric_circle(at):
    return CENTRE + RADIUS * np.exp(1j * at)


def test_on_an_eccentric_circle_a_roller_stands_by_pythagoras():
    """Height of its centre: y + √((R + r)² − x²) over the circle's centre turned with the cam."""
    for roller in [0.0, 0.006]:
        element = GuidedCentre(roller, 0.0, 0.0)
        centre = CENTRE * np.exp(1j * ANGLES)
        expected = centre.imag + np.sqrt((RADIUS + roller) ** 2 - centre.real**2)
        np.testing.assert_allclose(rest(element, eccentric_circle, ANGLES), expected, rtol=1e-14)


def test_on_an_eccentric_circle_a_face_stands_one_radius_over_its_centre():
    centre = CENTRE * np.exp(1j * ANGLES)
    for slant in (0.0, 0.3):
        expected = (RADIUS + (centre * np.exp(-1j * slant)).imag) / np.cos(slant)
        lift = rest(GuidedFace(slant, 0.0, 0.0), eccentric_circle, ANGLES)
        np.testing.assert_allclose(lift, expected, rtol=1e-14)


def test_on_an_eccentric_circle_an_arm_closes_a_triangle():
    """Arm, pivot to centre, and R + r: the law of cosines."""
    for roller in [0.0, 0.006]:
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


def test_sense_and_start_of_the_points_do_not_matter(every_kind):
    for made in every_kind:
        for disc, contour in zip(
            made.discs, contours(made.cam.follower, made.law, 2000), strict=True
        ):
            other = np.roll(contour.points[:, ::-1], 321, axis=1)
            other = np.append(other, other[:, :1], axis=1)  # closed twice
            lift = rest(disc.element, closed_curve(other), ANGLES)
            np.testing.assert_allclose(lift, made.law(ANGLES), rtol=0, atol=1e-9 * made.law.lift)


def test_a_contour_that_the_follower_passes_by():
    def aside(at):
        return 0.1 + 0.001 * np.exp(1j * at)

    for element in (GuidedCentre(0.005, 0.0, 0.0), GuidedCentre(0.0, 0.0, 0.0)):
        with pytest.raises(ProfileError, match=r"passes the contour by at \d+(\.\d+)?°; allowed: "):
            rest(element, aside, ANGLES)


def test_too_few_points():
    words = "contour has 3 different points; allowed: at least 8"
    with pytest.raises(ProfileError, match=re.escape(words)):
        closed_curve(np.array([[0.0, 1.0, 0.5, 0.0], [0.0, 0.0, 1.0, 0.0]]))


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


def test_contours_are_in_order_and_whole(followed, cams):
    """Every shipped cam at 36 angles and more, closed by its first point or not, turned over."""
    for law in followed.values():
        for count in (36, 3600):
            for contour in contours(cams[law.name].follower, law, count):
                closed = np.append(contour.points, contour.points[:, :1], axis=1)
                for points in (contour.points, closed, contour.points[:, ::-1]):
                    assert crossing(points) is None
                    assert gap(points) is None
                    assert sparse(points) is None


@pytest.fixture
def points():
    """A circle of 360 points, 40 mm in radius: a step is 0.698 mm."""
    angle = np.radians(np.arange(360.0))
    return 0.040 * np.array([np.cos(angle), np.sin(angle)])


def test_shuffled_points_cross(points):
    shuffled = np.random.default_rng(1).permutation(points, axis=1)
    assert "crosses itself" in str(crossing(shuffled))


def test_a_dozen_points_are_a_guess():
    assert "12 points" in str(sparse(np.zeros((2, 12))))


def test_a_part_of_a_contour_has_a_gap(points):
    """200 of 360 points: the chord of the other 161° is 2 R sin(80.5°)."""
    words = "points 200 and 1 are 78.9 mm apart, the others 0.6981 mm (median)"
    assert words in str(gap(points[:, :200]))
    assert "points 10 and 11 are" in str(gap(np.delete(points, np.arange(10, 25), axis=1)))


#: Every shipped cam that moves its follower both ways.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")
#: Largest play allowed, m.
NONE = 1e-9


def test_shipped_cams_have_no_play(cams, laws):
    """Both rollers touch all round, within 1e-9 m."""
    for name in FORM_CLOSED:
        assert np.abs(closure(cams[name].follower, laws[name])).max() < NONE


def test_random_rockers_have_no_play():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        numbers = {
            "base_radius": rng.uniform(38, 46),
            "roller_radius": rng.uniform(5, 11),
            "pivot_distance": rng.uniform(88, 110),
            "arm": rng.uniform(70, 88),
        }
        if seed % 2:
            numbers["arms_angle"] = rng.uniform(78, 88)
        made = make("oscillating_conjugate", UNEVEN, lift=rng.uniform(6, 14), **numbers)
        assert np.abs(closure(made.cam.follower, made.law)).max() < NONE


def test_a_frame_of_faces():
    """Constant breadth, of a cam whose fall is its rise turned by 180°."""
    made = make("constant_breadth", OPPOSITE)
    assert np.abs(closure(made.cam.follower, made.law)).max() < NONE


def test_a_second_cam_cut_for_another_rocker_shows():
    """For an angle between the arms wrong by δ the play is −arm δ at every angle."""
    for wrong in [-0.01, 0.02]:
        right, cut = (
            make("oscillating_conjugate", UNEVEN, arms_angle=80.0 + more) for more in (0.0, wrong)
        )
        first = contours(right.cam.follower, right.law, POINTS)[0]
        second = contours(cut.cam.follower, cut.law, POINTS)[1]
        curves = closed_curve(first.points), closed_curve(second.points)
        found = play(pair(right.discs), curves, turn_angles(36))
        np.testing.assert_allclose(found, -0.075 * np.radians(wrong), rtol=0, atol=NONE)


def test_one_element_has_no_play():
    made = make("roller", UNEVEN)
    with pytest.raises(ProfileError, match="moves both ways"):
        closure(made.cam.follower, made.law)

"""Points that are no contour in order: shuffled, or with a part left out."""

import numpy as np
import pytest

from cam_rig.profile import contours
from cam_rig.profile.measure import crossing, gap, sparse


def test_contours_are_in_order_and_whole(law, cams):
    """Every shipped cam at 36 angles and more, closed by its first point or not, turned over."""
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
    """The line through them crosses itself."""
    shuffled = np.random.default_rng(1).permutation(points, axis=1)
    assert "crosses itself" in str(crossing(shuffled))


def test_a_dozen_points_are_a_guess():
    """A closed curve through them is off by a part of the lift."""
    assert "12 points" in str(sparse(np.zeros((2, 12))))


def test_a_part_of_a_contour_has_a_gap(points):
    """200 of 360 points: the chord of the other 161° is 2 R sin(80.5°)."""
    words = "points 200 and 1 are 78.9 mm apart, the others 0.6981 mm (median)"
    assert words in str(gap(points[:, :200]))
    assert "points 10 and 11 are" in str(gap(np.delete(points, np.arange(10, 25), axis=1)))

"""A follower moved both ways has no play: both its elements touch, by dropping each on its cam."""

import numpy as np
import pytest

from cam_rig.errors import ProfileError
from cam_rig.profile import contours, turn_angles
from cam_rig.profile.measure import POINTS, closed_curve, closure, pair, play

from ..conftest import OPPOSITE, UNEVEN, make

#: Every shipped cam that moves its follower both ways.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")
#: Largest play allowed, m.
NONE = 1e-9


@pytest.mark.parametrize("name", FORM_CLOSED)
def test_shipped_cams_have_no_play(name, cams, laws):
    """Both rollers touch all round, within 1e-9 m."""
    assert np.abs(closure(cams[name].follower, laws[name])).max() < NONE


@pytest.mark.parametrize("seed", range(6))
def test_random_rockers_have_no_play(seed):
    """Arms, pivots, rollers and angles between the arms at random; rise and fall differ."""
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


@pytest.mark.parametrize("wrong", [-0.01, 0.02])
def test_a_second_cam_cut_for_another_rocker_shows(wrong):
    """For an angle between the arms wrong by δ the play is −arm δ at every angle."""
    right, cut = (
        make("oscillating_conjugate", UNEVEN, arms_angle=80.0 + more) for more in (0.0, wrong)
    )
    first = contours(right.cam.follower, right.law, POINTS)[0]
    second = contours(cut.cam.follower, cut.law, POINTS)[1]
    curves = closed_curve(first.points), closed_curve(second.points)
    found = play(pair(right.discs), curves, turn_angles(36))
    np.testing.assert_allclose(found, -0.075 * np.radians(wrong), rtol=0, atol=NONE)


def test_one_element_has_no_play():
    """A spring closes it: there is nothing to measure."""
    made = make("roller", UNEVEN)
    with pytest.raises(ProfileError, match="moves both ways"):
        closure(made.cam.follower, made.law)

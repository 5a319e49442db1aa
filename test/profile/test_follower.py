"""A drawn follower touches its cam where the profile says, and where kinematics says again."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.laws import Law
from cam_rig.profile import contours_at, turn_angles
from cam_rig.profile.contact import Motion
from cam_rig.profile.faces import GuidedFace, SwungFace
from cam_rig.profile.outlines import FollowerShape, Oscillating, follower_shape
from cam_rig.schema import CamConfig
from cam_rig.show.looks import turned
from cam_rig.units import FloatArray

#: Beside the joints, where a limit is taken.
ANGLES = turn_angles(720) + 1e-3
#: One cam of each kind of follower.
KINDS = (
    "poly345",
    "eccentric_roller",
    "flat",
    "inclined_flat",
    "oscillating_point",
    "oscillating_roller",
    "oscillating_flat",
    "conjugate",
    "oscillating_conjugate",
    "constant_breadth",
)
LIFT = 0.01


@pytest.fixture(scope="module", params=KINDS)
def cam(request: pytest.FixtureRequest, cams: dict[str, CamConfig]) -> CamConfig:
    return cams[request.param]


@pytest.fixture(scope="module")
def law_of(cam: CamConfig, laws: dict[str, Law]) -> Law:
    return laws[cam.name]


@pytest.fixture(scope="module")
def shape(cam: CamConfig, law_of: Law) -> FollowerShape:
    return follower_shape(cam, law_of)


def is_face(shape: FollowerShape) -> bool:
    return isinstance(shape.element, GuidedFace | SwungFace)


def instant_centre(shape: FollowerShape, slope: FloatArray) -> FloatArray:
    """``(n, 2)`` point of the line of both axes where cam and follower have one velocity.

    It is at s' for a translating follower, and at q φ'/(1 + φ') for one that turns by φ about a
    pivot at q.
    """
    if isinstance(shape, Oscillating):
        rate = slope / shape.element.arm
        slope = shape.element.pivot * rate / (1.0 + rate)
    return np.column_stack([slope, np.zeros_like(slope)])


def contact_by_kennedy(shape: FollowerShape, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Contact and normal by Kennedy's theorem: the normal runs through the instant centre."""
    place, centre = shape.place(motion.s), instant_centre(shape, motion.slope)
    if is_face(shape):
        # a face is square to the guide or along the arm, or inclined
        normal = turned(shape.upward(motion.s), getattr(shape.element, "inclination", 0.0))
        height = np.sum((place - centre) * normal, axis=1, keepdims=True)
        return centre + height * normal, normal
    normal = place - centre
    normal /= np.hypot(*normal.T)[:, None]
    return place - shape.element.roller * normal, normal


def test_contact_is_where_kennedys_theorem_puts_it(shape: FollowerShape, law_of: Law) -> None:
    """By the instant centre of cam and follower, which the profile's formulas do not use."""
    motion = Motion.at(law_of, ANGLES)
    for found, expected in zip(
        shape.contact(motion), contact_by_kennedy(shape, motion), strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_contact_is_on_the_contour(shape: FollowerShape, cam: CamConfig, law_of: Law) -> None:
    """Turned into the rig's frame, the contour's point for a cam angle is the point of contact."""
    points, _ = shape.contact(Motion.at(law_of, ANGLES))
    outline = contours_at(cam.follower, law_of, ANGLES)[0].points.T
    expected = np.stack([turned(p[None], a)[0] for p, a in zip(outline, ANGLES, strict=True)])
    np.testing.assert_allclose(np.hypot(*points.T), np.hypot(*expected.T), rtol=1e-12)
    turn = np.angle((points @ [1.0, 1j]) / (expected @ [1.0, 1j]))
    np.testing.assert_allclose(turn, turn[0], rtol=0, atol=1e-12)


def test_at_rest_the_follower_touches_the_base_circle(shape: FollowerShape, cam: CamConfig) -> None:
    """At no lift and no slope the contact is one base radius from the cam's axis."""
    none = np.zeros(1)
    points, normals = shape.contact(Motion(none, none, none, none))
    np.testing.assert_allclose(np.hypot(*points[0]), cam.follower.base_radius.si, rtol=1e-12)
    np.testing.assert_allclose(np.hypot(*normals[0]), 1.0, rtol=1e-12)
    assert points[0, 1] > 0.0


def test_the_place_moves_by_the_lift(shape: FollowerShape) -> None:
    """A small rise moves the place as far, the way `upward` says; a face's beside its arm."""
    lift, rise = np.array([LIFT]), np.array([1e-7])
    moved = (shape.place(lift + rise) - shape.place(lift)) / rise
    beside = getattr(shape.element, "offset", 0.0) / getattr(shape.element, "arm", 1.0)
    np.testing.assert_allclose(moved, shape.upward(lift), atol=1e-6 + 1.1 * abs(beside))


def test_the_outline_is_where_the_place_is(shape: FollowerShape) -> None:
    """Turned and moved to its origin, the first strip's middle is at the place, m."""
    lift = np.array([LIFT])
    strip = shape.outline()[0]
    if isinstance(shape.element, SwungFace):
        strip = strip[:1] + (strip[1:] - strip[:1]) * shape.element.arm / np.ptp(strip[:, 0])
        strip = strip[-1:]
    elif not is_face(shape) and not shape.element.roller:
        strip = strip[1:2]  # the tip
    elif not is_face(shape):
        strip = strip[:-1]
    drawn = turned(strip, float(shape.turn(lift)[0])) + shape.origin(lift)
    np.testing.assert_allclose(drawn.mean(axis=0), shape.place(lift)[0], rtol=0, atol=1e-15)


def test_a_carried_point_keeps_its_place_on_the_follower(shape: FollowerShape) -> None:
    """Carrying is a rigid motion: the place itself goes where the follower's place is."""
    start, end = np.array([0.5 * LIFT]), np.array([3.0 * LIFT])
    carried = shape.carried(shape.place(start), start, end)
    np.testing.assert_allclose(carried, shape.place(end), atol=1e-15)


def test_every_kind_can_be_drawn(shape: FollowerShape, cam: CamConfig) -> None:
    """Finite strips of points, and a reach around them."""
    strips: list[FloatArray] = [*shape.outline(), *shape.support()]
    assert all(strip.ndim == 2 and np.isfinite(strip).all() for strip in strips)
    base = cam.follower.base_radius.si
    assert base < shape.reach < 10.0 * base


@pytest.mark.parametrize("name", ["tm21", "poly345", "eccentric_roller", "flat"])
def test_what_the_stem_carries_stays_below_its_bearing(
    name: str, cams: dict[str, CamConfig], laws: dict[str, Law]
) -> None:
    """At the highest lift and a tenth more, as after a lift-off; the stem is in it at rest."""
    shape = follower_shape(cams[name], laws[name])
    low = min(strip[:, 1].min() for strip in shape.support())
    high = max(strip[:, 1].max() for strip in shape.support())
    head, stem = shape.outline()[0], shape.outline()[-1]
    highest, rest = (shape.place(np.array([lift]))[0, 1] for lift in (1.1 * shape.max_lift, 0.0))
    assert head[:, 1].max() + highest < low
    assert stem[:, 1].max() + rest > high

"""A drawn follower touches its cam where the profile says; the cam's body and its dial."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from cam_rig.laws import Law
from cam_rig.profile import contours, contours_at, turn_angles
from cam_rig.profile.contact import Motion
from cam_rig.profile.faces import GuidedFace, SwungFace
from cam_rig.profile.outlines import FollowerShape, Oscillating, follower_shape
from cam_rig.schema import CamConfig
from cam_rig.show.looks import NUMBER, body, closed, ring_numbers, rotation, turned
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
    motion = Motion.at(law_of, ANGLES)
    for found, expected in zip(
        shape.contact(motion), contact_by_kennedy(shape, motion), strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_contact_is_on_the_contour(shape: FollowerShape, cam: CamConfig, law_of: Law) -> None:
    points, _ = shape.contact(Motion.at(law_of, ANGLES))
    outline = contours_at(cam.follower, law_of, ANGLES)[0].points.T
    expected = np.stack([turned(p[None], a)[0] for p, a in zip(outline, ANGLES, strict=True)])
    np.testing.assert_allclose(np.hypot(*points.T), np.hypot(*expected.T), rtol=1e-12)
    turn = np.angle((points @ [1.0, 1j]) / (expected @ [1.0, 1j]))
    np.testing.assert_allclose(turn, turn[0], rtol=0, atol=1e-12)


def test_at_rest_the_follower_touches_the_base_circle(shape: FollowerShape, cam: CamConfig) -> None:
    none = np.zeros(1)
    points, normals = shape.contact(Motion(none, none, none, none))
    np.testing.assert_allclose(np.hypot(*points[0]), cam.follower.base_radius.si, rtol=1e-12)
    np.testing.assert_allclose(np.hypot(*normals[0]), 1.0, rtol=1e-12)
    assert points[0, 1] > 0.0


def test_the_place_moves_by_the_lift(shape: FollowerShape) -> None:
    lift, rise = np.array([LIFT]), np.array([1e-7])
    moved = (shape.place(lift + rise) - shape.place(lift)) / rise
    beside = getattr(shape.element, "offset", 0.0) / getattr(shape.element, "arm", 1.0)
    np.testing.assert_allclose(moved, shape.upward(lift), atol=1e-6 + 1.1 * abs(beside))


def test_the_outline_is_where_the_place_is(shape: FollowerShape) -> None:
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
    start, end = np.array([0.5 * LIFT]), np.array([3.0 * LIFT])
    carried = shape.carried(shape.place(start), start, end)
    np.testing.assert_allclose(carried, shape.place(end), atol=1e-15)


def test_every_kind_can_be_drawn(shape: FollowerShape, cam: CamConfig) -> None:
    strips: list[FloatArray] = [*shape.outline(), *shape.support()]
    assert all(strip.ndim == 2 and np.isfinite(strip).all() for strip in strips)
    base = cam.follower.base_radius.si
    assert base < shape.reach < 10.0 * base


def test_what_the_stem_carries_stays_below_its_bearing(
    cams: dict[str, CamConfig], laws: dict[str, Law]
) -> None:
    for name in ["tm21", "poly345", "eccentric_roller", "flat"]:
        shape = follower_shape(cams[name], laws[name])
        low = min(strip[:, 1].min() for strip in shape.support())
        high = max(strip[:, 1].max() for strip in shape.support())
        head, stem = shape.outline()[0], shape.outline()[-1]
        highest, rest = (
            shape.place(np.array([lift]))[0, 1] for lift in (1.1 * shape.max_lift, 0.0)
        )
        assert head[:, 1].max() + highest < low
        assert stem[:, 1].max() + rest > high


def test_the_cams_own_zero_points_to_its_angle() -> None:
    """What is up at cam angle 0 stands at the number of the angle, for every number."""
    places, words = ring_numbers(10.0)
    for place, word in zip(places, words, strict=True):
        up = turned(np.array([[0.0, 10.0 * NUMBER]]), np.radians(float(word)))
        np.testing.assert_allclose(up[0], place, atol=1e-12)


def test_the_arrow_turns_as_the_cam() -> None:
    arc, head = rotation(1.0)
    x, y = arc.T
    assert np.all(x[:-1] * y[1:] - y[:-1] * x[1:] > 0.0)
    np.testing.assert_array_equal(head[1], arc[-1])


def test_a_body_fills_its_outline(cams: dict[str, CamConfig], laws: dict) -> None:
    """Every point of a fine net within the contour is under a strip, and no strip reaches out of
    it by more than a fiftieth of its radius."""
    for name in ["poly345", "tm21", "flat", "arcs_convex", "oscillating_roller"]:
        contour = contours(cams[name].follower, laws[name], 360)[0].points.T
        outline = closed(contour)
        strips, half = body(outline)
        share = np.linspace(0.0, 1.0, 50)[:, None]
        lines = np.concatenate([a + share * (b - a) for s in strips for a, b in pairwise(s)])
        for part in np.linspace(0.02, 0.96, 40):
            away = (part * outline[::30])[:, None] - lines
            assert np.hypot(away[..., 0], away[..., 1]).min(axis=1).max() < half
        angle = np.arctan2(*contour.T[::-1])
        order = np.argsort(angle)
        radius = np.interp(
            np.arctan2(*strips[-1].T[::-1]),
            angle[order],
            np.hypot(*contour.T)[order],
            period=2 * np.pi,
        )
        assert (np.hypot(*strips[-1].T) + half - radius).max() < 0.02 * radius.max()

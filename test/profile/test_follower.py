"""Tests of drawn followers, which touch their cam, and of drawn cams.

A cam has a body and an angle dial.
"""

from itertools import pairwise

import numpy as np
import pytest

from cam_rig.profile import contours, contours_at, turn_angles
from cam_rig.profile.contact import Motion
from cam_rig.profile.faces import GuidedFace, SwungFace
from cam_rig.profile.outlines import follower_shape
from cam_rig.profile.shapes import (
    NUMBER_RADIUS,
    body,
    close_outline,
    ring_numbers,
    rotate,
    rotation_arrow,
)

#: Cam angles (rad) that are not at a joint of a law, where two of its pieces meet.
ANGLES = turn_angles(720) + 1e-3
#: Names of shipped cams, one for each kind of follower.
KINDS = (
    *("poly345", "eccentric_roller", "flat", "inclined_flat", "oscillating_point"),
    *("oscillating_roller", "oscillating_flat", "conjugate", "oscillating_conjugate"),
    "constant_breadth",
)
#: Lift of the followers, m.
LIFT = 0.01


@pytest.fixture(scope="module")
def drawn(cams, laws):
    """Cam, motion law and drawn follower, for each kind of follower."""
    return [(cams[n], laws[n], follower_shape(cams[n], laws[n])) for n in KINDS]


def test_contact(drawn):
    """The drawn contact point is that of the contour at each cam angle.

    At lift 0 it is one base radius from the axis.
    """
    zero = np.zeros(1)
    for cam, law, shape in drawn:
        contact, _ = shape.contact(Motion.at(law, ANGLES))
        outline = contours_at(cam.follower, law, ANGLES)[0].points
        points = contact @ [1.0, 1j]
        turn = points / ((outline[0] + 1j * outline[1]) * np.exp(1j * ANGLES))
        np.testing.assert_allclose(turn, turn[0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(np.abs(turn), 1.0, rtol=1e-12)
        points, normals = shape.contact(Motion(zero, zero, zero, zero))
        base = cam.follower.base_radius.si
        np.testing.assert_allclose(np.hypot(*points[0]), base, rtol=1e-12)
        np.testing.assert_allclose(np.hypot(*normals[0]), 1.0, rtol=1e-12)
        assert points[0, 1] > 0.0


def test_follower_moves_as_a_rigid_body(drawn):
    """In a small rise a follower's reference point moves along the vector `upward`.

    `carried` moves points from a lift to another as parts of the rigid follower.
    """
    lift, rise = np.array([LIFT]), np.array([1e-7])
    start, end = np.array([0.5 * LIFT]), np.array([3.0 * LIFT])
    for _, _, shape in drawn:
        moved = (shape.place(lift + rise) - shape.place(lift)) / rise
        slope = getattr(shape.element, "offset", 0.0) / getattr(shape.element, "arm", 1.0)
        np.testing.assert_allclose(moved, shape.upward(lift), atol=1e-6 + 1.1 * abs(slope))
        carried = shape.carried(shape.place(start), start, end)
        np.testing.assert_allclose(carried, shape.place(end), atol=1e-15)


def test_outline_agrees_with_the_reference_point(drawn):
    """The drawn outline of a follower is at its reference point at each lift.

    The reference point is the centre of the roller, the tip, or a point of the face.
    """
    lift = np.array([LIFT])
    for cam, _, shape in drawn:
        strip = shape.outline()[0]
        if isinstance(shape.element, SwungFace):
            strip = strip[:1] + (strip[1:] - strip[:1]) * shape.element.arm / np.ptp(strip[:, 0])
            strip = strip[-1:]
        elif not isinstance(shape.element, GuidedFace):
            strip = strip[:-1] if shape.element.roller else strip[1:2]  # the tip
        moved = rotate(strip, float(shape.turn(lift)[0])) + shape.origin(lift)
        np.testing.assert_allclose(moved.mean(axis=0), shape.place(lift)[0], rtol=0, atol=1e-15)
        strips = [*shape.outline(), *shape.support()]
        assert all(strip.ndim == 2 and np.isfinite(strip).all() for strip in strips)
        assert 1.0 < shape.reach / cam.follower.base_radius.si < 10.0


def test_moving_parts_stay_below_the_bearing(cams, laws):
    """At 1.1 of the largest lift the follower's head stays below its bearing.

    At rest the stem is in the bearing.
    """
    for name in ("tm21", "poly345", "eccentric_roller", "flat"):
        shape = follower_shape(cams[name], laws[name])
        low = min(strip[:, 1].min() for strip in shape.support())
        high = max(strip[:, 1].max() for strip in shape.support())
        head, stem = shape.outline()[0], shape.outline()[-1]
        lifts = (1.1 * shape.max_lift, 0.0)
        highest, at_rest = (shape.place(np.array([lift]))[0, 1] for lift in lifts)
        assert head[:, 1].max() + highest < low
        assert stem[:, 1].max() + at_rest > high


# -- angle dial, arrow and body of the cam


def test_dial():
    """The number at the top of the drawn angle dial is the cam angle.

    The arrow of the cam's rotation is counterclockwise.
    """
    for centre, number in zip(*ring_numbers(10.0), strict=True):
        up = rotate(np.array([[0.0, 10.0 * NUMBER_RADIUS]]), np.radians(float(number)))
        np.testing.assert_allclose(up[0], centre, atol=1e-12)
    arc, head = rotation_arrow(1.0)
    x, y = arc.T
    assert np.all(x[:-1] * y[1:] - y[:-1] * x[1:] > 0.0)
    np.testing.assert_array_equal(head[1], arc[-1])


def test_body_fills_its_outline(cams, laws):
    """The lines that fill a cam's body cover its outline.

    They protrude by at most 1/50 of the largest radius.
    """
    fraction = np.linspace(0.0, 1.0, 30)[:, None]
    for name in ("tm21", "flat", "oscillating_roller"):
        contour = contours(cams[name].follower, laws[name], 360)[0].points.T
        outline = close_outline(contour)
        strips, half = body(outline)
        lines = np.concatenate([a + fraction * (b - a) for s in strips for a, b in pairwise(s)])
        for scale in np.linspace(0.02, 0.96, 20):
            away = (scale * outline[::30])[:, None] - lines
            assert np.hypot(away[..., 0], away[..., 1]).min(axis=1).max() < half
        angle, edge = (np.arctan2(*line.T[::-1]) for line in (contour, strips[-1]))
        order = np.argsort(angle)
        radius = np.hypot(*contour.T)
        outline_radius = np.interp(edge, angle[order], radius[order], period=2 * np.pi)
        assert (np.hypot(*strips[-1].T) + half - outline_radius).max() < 0.02 * radius.max()

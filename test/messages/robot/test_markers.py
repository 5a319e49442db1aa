"""Markers lie where cam and follower are: seen through /tf, in the cam's and follower's frames."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cam_rig.live.law_server import CONTOUR_POINTS
from cam_rig.messages.frames import CAM, FOLLOWER, GUIDE, Robot
from cam_rig.messages.markers import (
    ARROW,
    LINE_STRIP,
    SPHERE,
    TEXT,
    TRIANGLE_LIST,
    FollowerMarkers,
    cam_markers,
)
from cam_rig.messages.motion import Transforms
from cam_rig.profile import contours, contours_at
from cam_rig.profile.faces import GuidedFace, SwungFace
from cam_rig.profile.outlines import Oscillating
from cam_rig.units import NS, FloatArray

from .test_transforms import TF, matrices

ARRAY = "visualization_msgs/msg/MarkerArray"
COUNT, GAP = 90, 1.3e-3
Read = Callable[[bytes, str], Any]


@pytest.fixture(scope="module")
def angle() -> FloatArray:
    return np.linspace(0.001, 12.0, COUNT)


@pytest.fixture(scope="module")
def stamps() -> Any:
    return np.arange(COUNT) * 10**7 + 3


def flat(points: list[Any]) -> FloatArray:
    return np.array([[p.x, p.y, 0.0, 1.0] for p in points])


def seen_from(robot: Robot, read: Read, angle: FloatArray, lift: FloatArray, link: str) -> Any:
    """``(n, 4, 4)`` that take points of the guide into a link."""
    messages = Transforms(robot).moving(np.zeros(COUNT, np.int64), angle, lift)
    return np.stack([np.linalg.inv(matrices(read(cdr, TF))[GUIDE, link]) for cdr in messages])


def off_the_follower(robot: Robot, points: FloatArray) -> FloatArray:
    """How far points of the link follower are from roller, point or face, m."""
    shape, rest = robot.shape, np.zeros(1)
    element = shape.element
    place = shape.place(rest) - shape.origin(rest)
    if isinstance(shape, Oscillating):  # the link lies along the arm at rest
        turn = -float(shape.turn(rest)[0])
        place = place @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]).T
    else:
        place = shape.place(rest)
    away = points[:, :2] - place
    if isinstance(element, SwungFace):
        return np.abs(away[:, 1])
    if isinstance(element, GuidedFace):
        return np.abs(away @ [-np.sin(element.inclination), np.cos(element.inclination)])
    return np.abs(np.hypot(*away.T) - element.roller)


def test_the_point_of_contact_is_on_cam_and_follower(
    robot: Robot, read: Read, angle: FloatArray, stamps: Any
) -> None:
    """In contact, through /tf: to 1e-9 m on the cam's contour, and on roller, point or face."""
    lift, force = robot.law(angle), np.full(COUNT, 20.0)
    found = [read(cdr, ARRAY) for cdr in FollowerMarkers(robot).at(stamps, angle, lift, force)]
    spheres = [message.markers[0] for message in found]
    assert {(m.type, m.action, m.header.frame_id) for m in spheres} == {(SPHERE, 0, GUIDE)}
    times = [m.header.stamp.sec * NS + m.header.stamp.nanosec for m in spheres]
    assert times == list(stamps)
    points = flat([m.pose.position for m in spheres])
    of_cam = np.einsum("nij,nj->ni", seen_from(robot, read, angle, lift, CAM), points)
    contour = contours_at(robot.mounted.follower, robot.law, angle)[0].points.T
    np.testing.assert_allclose(of_cam[:, :2], contour, rtol=0, atol=1e-9)
    of_follower = np.einsum("nij,nj->ni", seen_from(robot, read, angle, lift, FOLLOWER), points)
    assert off_the_follower(robot, of_follower).max() < 1e-9


def test_the_arrow_is_the_force(robot: Robot, read: Read, angle: FloatArray, stamps: Any) -> None:
    """Along the common normal; its part along y of the link follower is the contact force."""
    lift, force = robot.law(angle), np.linspace(1.0, 50.0, COUNT)
    found = [read(cdr, ARRAY) for cdr in FollowerMarkers(robot).at(stamps, angle, lift, force)]
    arrows = [message.markers[1] for message in found]
    assert {m.type for m in arrows} == {ARROW}
    ends = [flat([m.points[k] for m in arrows]) for k in (0, 1)]
    vector = (ends[1] - ends[0]) * [1.0, 1.0, 1.0, 0.0]
    of_follower = np.einsum("nij,nj->ni", seen_from(robot, read, angle, lift, FOLLOWER), vector)
    newtons_per_metre = force / of_follower[:, 1]
    np.testing.assert_allclose(newtons_per_metre, newtons_per_metre[0], rtol=1e-9)
    of_cam = np.einsum("nij,nj->ni", seen_from(robot, read, angle, lift, CAM), vector)
    normal = contours_at(robot.mounted.follower, robot.law, angle)[0].normal.T
    across = of_cam[:, 0] * normal[:, 1] - of_cam[:, 1] * normal[:, 0]
    assert np.abs(across).max() < 1e-9


def test_in_flight_the_gap_is_drawn_and_said(
    robot: Robot, read: Read, angle: FloatArray, stamps: Any
) -> None:
    """From the contour to the follower, with its length in µm; the same markers, replaced."""
    lift = robot.law(angle) + GAP
    made = FollowerMarkers(robot).at(stamps, angle, lift, np.zeros(COUNT))
    found = [read(cdr, ARRAY).markers for cdr in made]
    assert {(m[0].type, m[1].type) for m in found} == {(LINE_STRIP, TEXT)}
    assert {(m[0].ns, m[0].id, m[1].ns, m[1].id) for m in found} == {("contact", 0, "contact", 1)}
    starts, ends = (flat([m[0].points[k] for m in found]) for k in (0, 1))
    contour = contours_at(robot.mounted.follower, robot.law, angle)[0].points.T
    of_cam = np.einsum("nij,nj->ni", seen_from(robot, read, angle, lift, CAM), starts)
    np.testing.assert_allclose(of_cam[:, :2], contour, rtol=0, atol=1e-9)
    of_follower = np.einsum("nij,nj->ni", seen_from(robot, read, angle, lift, FOLLOWER), ends)
    assert off_the_follower(robot, of_follower).max() < 1e-9
    gaps = np.hypot(*(ends - starts)[:, :2].T) * 1e6
    said = [float(m[1].text.removeprefix("gap ").removesuffix(" µm")) for m in found]
    np.testing.assert_allclose(said, gaps, atol=0.051)


def test_contact_and_flight_in_one_tick_stay_in_order(
    robot: Robot, read: Read, angle: FloatArray, stamps: Any
) -> None:
    """Each instant is drawn by its own force."""
    force = np.where(np.arange(COUNT) % 3, 20.0, 0.0)
    made = FollowerMarkers(robot).at(stamps, angle, robot.law(angle), force)
    found = [read(cdr, ARRAY).markers[0] for cdr in made]
    assert [m.type == SPHERE for m in found] == list(force > 0.0)
    assert [m.header.stamp.nanosec + m.header.stamp.sec * NS for m in found] == list(stamps)


def test_the_cam_is_drawn_with_its_own_contour(robot: Robot, read: Read) -> None:
    """The line is the profile's contour, closed; both filled faces have the contour's area."""
    line, body = read(cam_markers(robot), ARRAY).markers
    assert (line.type, body.type) == (LINE_STRIP, TRIANGLE_LIST)
    assert line.header.frame_id == body.header.frame_id == robot.mounted.name
    outline = contours(robot.mounted.follower, robot.law, CONTOUR_POINTS)[0].points.T
    points = np.array([[p.x, p.y] for p in line.points])
    np.testing.assert_array_equal(points, np.vstack([outline, outline[:1]]))
    corners = np.array([[p.x, p.y, p.z] for p in body.points]).reshape(-1, 3, 3)
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = 0.5 * np.cross(one, other)
    x, y = outline.T
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    along = normals[:, 2]
    assert along[along > 0.0].sum() == pytest.approx(area, rel=1e-12)
    assert along[along < 0.0].sum() == pytest.approx(-area, rel=1e-12)
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-12)  # a closed surface

"""Where the follower touches its cam, and how hard; or how far it is off: /follower/markers.

Each message says all, so that none depends on one before: marker 0 is the point of contact, or in
flight the line from the cam's contour to the follower; marker 1 is the contact force along the
common normal, or in flight the gap in words. A viewer replaces the one by the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.live.law_server import contour_of
from cam_rig.messages.frames import GUIDE, Robot
from cam_rig.messages.serialization import CdrTemplate, example_header, header, new, serialize
from cam_rig.messages.urdf import BODY, DISC
from cam_rig.profile.contact import Motion
from cam_rig.profile.shapes import closed
from cam_rig.show import looks as colours
from cam_rig.show.looks import of_cam
from cam_rig.simulation.scene import ARROW as ARROW_SHARE
from cam_rig.simulation.scene import max_contact_force
from cam_rig.units import FloatArray

#: Kinds of visualization_msgs/Marker.
ARROW, SPHERE, LINE_STRIP, TEXT, TRIANGLE_LIST = 0, 2, 4, 9, 11


def point(x: float, y: float, z: float = 0.0) -> Any:
    """A geometry_msgs/Point, m."""
    return new("geometry_msgs/Point", x, y, z)


def colour(rgba: int, opacity: float = 1.0) -> Any:
    """A std_msgs/ColorRGBA of the palette's 0xRRGGBBAA."""
    red, green, blue = (((rgba >> shift) & 0xFF) / 255.0 for shift in (24, 16, 8))
    return new("std_msgs/ColorRGBA", red, green, blue, opacity)


def marker(
    of_frame: Any,
    namespace: str,
    number: int,
    shape: int,
    scale: tuple[float, float, float],
    colour: Any,
    points: Sequence[Any] = (),
    place: Any = None,
    text: str = "",
    turns: bool = False,
) -> Any:
    """A visualization_msgs/Marker; one that ``turns`` with its frame is drawn anew with it."""
    no_image = new("sensor_msgs/CompressedImage", header(0, ""), "", np.zeros(0, np.uint8))
    no_mesh = new("visualization_msgs/MeshFile", "", np.zeros(0, np.uint8))
    turn = new("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0)
    return new(
        "visualization_msgs/Marker",
        of_frame,
        namespace,
        number,
        shape,
        0,  # add or modify
        new("geometry_msgs/Pose", place or point(0.0, 0.0), turn),
        new("geometry_msgs/Vector3", *scale),
        colour,
        new("builtin_interfaces/Duration", 0, 0),
        turns,
        list(points),
        [],
        "",
        no_image,
        [],
        text,
        "",
        no_mesh,
        False,
    )


KIND, NAMESPACE = "visualization_msgs/msg/MarkerArray", "contact"
#: Stands for the gap in the example; every text is as long.
_WORDS = "gap 0000000.0 µm"


class FollowerMarkers:
    """The serialized markers of a robot's follower, in the frame of its guide."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._front = robot, 0.5 * BODY * robot.size
        force = max_contact_force(robot.loaded, robot.mounted.name, robot.top_speed)
        self._metres_per_newton = ARROW_SHARE * robot.size / force
        self._touching = CdrTemplate(KIND, self._contact, 4)
        self._flying = CdrTemplate(KIND, self._flight, 4)

    def at(
        self, stamps: NDArray[np.int64], angle: FloatArray, lift: FloatArray, force: FloatArray
    ) -> list[bytes]:
        """A message at each stamp (ns), ``(n,)``; rad, m, and N, of which there are 0 in flight."""
        shape, motion = self._robot.shape, Motion(angle, *self._robot.law.motion_at(angle))
        contact, normal = shape.contact(motion)
        along = np.sum(normal * shape.upward(motion.s), axis=1)
        tip = contact + normal * (force / along * self._metres_per_newton)[:, None]
        off = force == 0.0
        if not off.any():
            return self._touching.fill(stamps, *contact.T, *tip.T)
        carried = shape.carried(contact, motion.s, lift)
        touching = self._touching.fill(stamps[~off], *contact[~off].T, *tip[~off].T)
        flying = self._flying.fill(stamps[off], *contact[off].T, *carried[off].T)
        gaps = np.minimum(1e6 * np.hypot(*(carried - contact)[off].T), 9_999_999.9).tolist()
        words = (f"gap {gap:9.1f} µm".encode() for gap in gaps)
        said = (one.replace(_WORDS.encode(), own) for one, own in zip(flying, words, strict=True))
        here = iter(touching), said
        return [next(here[is_off]) for is_off in off.tolist()]

    def _contact(self, x: float, y: float, tip_x: float, tip_y: float) -> Any:
        size, at = self._robot.size, example_header(GUIDE)
        ball, shaft = (0.04 * size,) * 3, (0.02 * size, 0.05 * size, 0.0)
        ends = point(x, y, self._front), point(tip_x, tip_y, self._front)
        dot, arrow = colour(colours.BLACK), colour(colours.FORCE)
        at_contact = marker(at, NAMESPACE, 0, SPHERE, ball, dot, place=ends[0])
        pushed = marker(at, NAMESPACE, 1, ARROW, shaft, arrow, ends)
        return new("visualization_msgs/MarkerArray", [at_contact, pushed])

    def _flight(self, x: float, y: float, to_x: float, to_y: float) -> Any:
        size, at, red = self._robot.size, example_header(GUIDE), colour(colours.GAP)
        ends = point(x, y, self._front), point(to_x, to_y, self._front)
        line, words = (0.02 * size, 0.0, 0.0), (0.0, 0.0, 0.1 * size)
        beside = point(0.5 * size, 0.0, self._front)
        gap = marker(at, NAMESPACE, 0, LINE_STRIP, line, red, ends)
        said = marker(at, NAMESPACE, 1, TEXT, words, red, place=beside, text=_WORDS)
        return new("visualization_msgs/MarkerArray", [gap, said])


def cam_markers(robot: Robot) -> bytes:
    """The serialized MarkerArray of the mounted cam; its contour is /cam/profile's to the digit."""
    cam, size = robot.mounted, robot.size
    outline, half = contour_of(cam, robot.law).T, 0.5 * DISC * size
    strip = [point(float(x), float(y), half) for x, y in closed(outline)]
    solid = [point(*map(float, corner)) for corner in _solid(outline, half)]
    at, width, whole = header(0, cam.name), (0.01 * size, 0.0, 0.0), (1.0, 1.0, 1.0)
    black, own = colour(colours.BLACK), colour(of_cam(cam.name))
    markers = [
        marker(at, "cam", 0, LINE_STRIP, width, black, strip, turns=True),
        marker(at, "cam", 1, TRIANGLE_LIST, whole, own, solid, turns=True),
    ]
    return serialize(new("visualization_msgs/MarkerArray", markers))


def _solid(outline: FloatArray, half: float) -> FloatArray:
    """``(m, 3)`` corners of triangles: both faces, as fans about the shaft, and the rim."""
    one, other = outline, np.roll(outline, -1, axis=0)
    middle = np.zeros_like(one)

    def at(points: FloatArray, z: float) -> FloatArray:
        return np.column_stack([points, np.full(len(points), z)])

    triangles = [
        (at(middle, half), at(other, half), at(one, half)),  # the contour runs clockwise
        (at(middle, -half), at(one, -half), at(other, -half)),
        (at(one, half), at(other, half), at(one, -half)),
        (at(other, half), at(other, -half), at(one, -half)),
    ]
    return np.concatenate([np.stack(corners, axis=1).reshape(-1, 3) for corners in triangles])

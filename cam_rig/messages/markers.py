"""Markers of contact point, contact force, gap and cam.

Each message of /follower/markers is complete and independent of the previous messages. Marker 0 is
the point of contact, or in flight the line from the cam's contour to the follower. Marker 1 is the
contact force along the common normal, or in flight the gap as text. A viewer replaces the markers
of the previous message by those of the same number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.live.law_server import contour_of
from cam_rig.messages.frames import GUIDE, Robot
from cam_rig.messages.serialization import CdrTemplate, example_header, header, new, serialize
from cam_rig.messages.urdf import BODY_THICKNESS, DISC_THICKNESS
from cam_rig.profile.contact import Motion
from cam_rig.profile.shapes import close_outline
from cam_rig.show import looks as colours
from cam_rig.show.looks import of_cam
from cam_rig.simulation.scene import FORCE_ARROW_RATIO as ARROW_SHARE
from cam_rig.simulation.scene import max_contact_force
from cam_rig.units import FloatArray

# Values of the field type of visualization_msgs/Marker.
ARROW = 0
SPHERE = 2
LINE_STRIP = 4
TEXT = 9
TRIANGLE_LIST = 11


def point(x: float, y: float, z: float = 0.0) -> Any:
    """Return a geometry_msgs/Point in m."""
    return new("geometry_msgs/Point", x, y, z)


def colour(rgba: int, opacity: float = 1.0) -> Any:
    """Convert a colour 0xRRGGBBAA to std_msgs/ColorRGBA, with another opacity."""
    red, green, blue = (((rgba >> shift) & 0xFF) / 255.0 for shift in (24, 16, 8))
    return new("std_msgs/ColorRGBA", red, green, blue, opacity)


def marker(
    head: Any,
    namespace: str,
    number: int,
    shape: int,
    scale: tuple[float, float, float],
    colour: Any,
    points: Sequence[Any] = (),
    position: Any = None,
    text: str = "",
    frame_locked: bool = False,
) -> Any:
    """Return a visualization_msgs/Marker.

    `head` is its header, and `namespace` and `number` identify it. `shape` is its type, such as
    `ARROW`, and `scale` its size in m. If `frame_locked` is True, a viewer moves the marker
    whenever its frame moves. `colour`, `points`, `position` and `text` are fields of the message,
    lengths in m.
    """
    no_image = new("sensor_msgs/CompressedImage", header(0, ""), "", np.zeros(0, np.uint8))
    no_mesh = new("visualization_msgs/MeshFile", "", np.zeros(0, np.uint8))
    no_rotation = new("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0)
    return new(
        "visualization_msgs/Marker",
        head,
        namespace,
        number,
        shape,
        0,  # add or modify
        new("geometry_msgs/Pose", position or point(0.0, 0.0), no_rotation),
        new("geometry_msgs/Vector3", *scale),
        colour,
        new("builtin_interfaces/Duration", 0, 0),
        frame_locked,
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


#: Message type of /follower/markers.
MARKER_ARRAY = "visualization_msgs/msg/MarkerArray"
#: Namespace of the follower's markers, by which a viewer can hide them.
NAMESPACE = "contact"
#: Largest gap (µm) that fits in `_GAP_TEXT`. A larger gap is displayed as this value.
MAX_GAP_UM = 9_999_999.9
#: Placeholder for the text of the gap in the template of the message. All texts of a gap have the
#: length of this one.
_GAP_TEXT = "gap 0000000.0 µm"


class FollowerMarkers:
    """Serialized markers of a robot's follower, in the frame of its guide."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._front = robot, 0.5 * BODY_THICKNESS * robot.size
        force = max_contact_force(robot.loaded, robot.mounted.name, robot.top_speed)
        self._metres_per_newton = ARROW_SHARE * robot.size / force
        self._contact = CdrTemplate(MARKER_ARRAY, self._contact_example, 4)
        self._flight = CdrTemplate(MARKER_ARRAY, self._flight_example, 4)

    def messages(
        self, stamps: NDArray[np.int64], angle: FloatArray, lift: FloatArray, force: FloatArray
    ) -> list[bytes]:
        """Return the serialized markers of the follower for each stamp (ns).

        Cam angle (rad), lift (m) and contact force (N) have shape (n,). The force is 0 in flight.
        """
        shape, motion = self._robot.shape, Motion(angle, *self._robot.law.motion_at(angle))
        contact, normal = shape.contact(motion)
        along = np.sum(normal * shape.upward(motion.s), axis=1)
        tip = contact + normal * (force / along * self._metres_per_newton)[:, None]
        in_flight = force == 0.0
        in_contact = ~in_flight
        if not in_flight.any():
            return self._contact.fill(stamps, *contact.T, *tip.T)
        carried = shape.carried(contact, motion.s, lift)
        touching = self._contact.fill(
            stamps[in_contact], *contact[in_contact].T, *tip[in_contact].T
        )
        flying = self._flight.fill(stamps[in_flight], *contact[in_flight].T, *carried[in_flight].T)
        gaps = np.minimum(1e6 * np.hypot(*(carried - contact)[in_flight].T), MAX_GAP_UM).tolist()
        with_gaps = (
            cdr.replace(_GAP_TEXT.encode(), f"gap {gap:9.1f} µm".encode())
            for cdr, gap in zip(flying, gaps, strict=True)
        )
        sources = iter(touching), with_gaps
        return [next(sources[flies]) for flies in in_flight.tolist()]

    def _contact_example(self, x: float, y: float, tip_x: float, tip_y: float) -> Any:
        size, head = self._robot.size, example_header(self._robot.frame_prefix + GUIDE)
        ball, shaft = (0.04 * size,) * 3, (0.02 * size, 0.05 * size, 0.0)
        ends = point(x, y, self._front), point(tip_x, tip_y, self._front)
        black, orange = colour(colours.BLACK), colour(colours.FORCE)
        contact = marker(head, NAMESPACE, 0, SPHERE, ball, black, position=ends[0])
        force = marker(head, NAMESPACE, 1, ARROW, shaft, orange, ends)
        return new("visualization_msgs/MarkerArray", [contact, force])

    def _flight_example(self, x: float, y: float, to_x: float, to_y: float) -> Any:
        size, red = self._robot.size, colour(colours.GAP)
        head = example_header(self._robot.frame_prefix + GUIDE)
        ends = point(x, y, self._front), point(to_x, to_y, self._front)
        line, letters = (0.02 * size, 0.0, 0.0), (0.0, 0.0, 0.1 * size)
        position = point(0.5 * size, 0.0, self._front)
        gap = marker(head, NAMESPACE, 0, LINE_STRIP, line, red, ends)
        label = marker(head, NAMESPACE, 1, TEXT, letters, red, position=position, text=_GAP_TEXT)
        return new("visualization_msgs/MarkerArray", [gap, label])


def cam_markers(robot: Robot) -> bytes:
    """Return the serialized MarkerArray of the cam.

    Its contour is equal to that of /cam/profile.
    """
    cam, size = robot.mounted, robot.size
    outline, half = contour_of(cam, robot.law).T, 0.5 * DISC_THICKNESS * size
    strip = [point(float(x), float(y), half) for x, y in close_outline(outline)]
    solid = [point(*map(float, corner)) for corner in _solid(outline, half)]
    head = header(0, robot.frame_prefix + cam.name)
    width, unscaled = (0.01 * size, 0.0, 0.0), (1.0, 1.0, 1.0)
    black, cam_colour = colour(colours.BLACK), colour(of_cam(cam.name))
    markers = [
        marker(head, "cam", 0, LINE_STRIP, width, black, strip, frame_locked=True),
        marker(head, "cam", 1, TRIANGLE_LIST, unscaled, cam_colour, solid, frame_locked=True),
    ]
    return serialize(new("visualization_msgs/MarkerArray", markers))


def _solid(outline: FloatArray, half: float) -> FloatArray:
    """Return the corners of the triangles of a cam's faces and rim, shape (m, 3), m.

    Each face is a fan of triangles about the shaft, at a distance `half` (m) from the middle.
    """

    def at_height(points: FloatArray, z: float) -> FloatArray:
        return np.column_stack([points, np.full(len(points), z)])

    following, centre = np.roll(outline, -1, axis=0), np.zeros_like(outline)
    front, back = at_height(outline, half), at_height(outline, -half)
    next_front, next_back = at_height(following, half), at_height(following, -half)
    triangles = [
        (at_height(centre, half), next_front, front),  # the contour is clockwise
        (at_height(centre, -half), back, next_back),
        (front, next_front, back),
        (next_front, next_back, back),
    ]
    return np.concatenate([np.stack(corners, axis=1).reshape(-1, 3) for corners in triangles])

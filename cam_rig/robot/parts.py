"""Parts of messages, as rosbags has them: points, colours, headers, a link's transform."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cam_rig.messages.cdr_template import TYPES
from cam_rig.units import NS

#: Kinds of visualization_msgs/Marker.
ARROW, SPHERE, LINE_STRIP, TEXT, TRIANGLE_LIST = 0, 2, 4, 9, 11


def new(kind: str, *fields: Any) -> Any:
    """A message of a type such as ``std_msgs/Header``, with its fields in their order."""
    return TYPES.types[kind.replace("/", "/msg/")](*fields)


def serialize(message: Any) -> bytes:
    """The message's bytes."""
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__))


def header(stamp_ns: int, frame: str) -> Any:
    """A std_msgs/Header with rig time in ns."""
    return new("std_msgs/Header", new("builtin_interfaces/Time", *divmod(stamp_ns, NS)), frame)


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
    """A visualization_msgs/Marker to add or to take the place of its number's last.

    One that ``turns`` with its frame (frame_locked) is drawn anew whenever the frame moves.
    """
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

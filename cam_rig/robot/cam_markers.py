"""The mounted cam as it is, its own contour: /cam/markers."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.drawing.cam_looks import of_cam
from cam_rig.drawing.outlines import closed
from cam_rig.live.cam_check import contour_of
from cam_rig.robot.frames import Robot
from cam_rig.robot.parts import (
    LINE_STRIP,
    TRIANGLE_LIST,
    colour,
    header,
    marker,
    new,
    point,
    serialize,
)
from cam_rig.robot.urdf import DISC

NAMESPACE = "cam"


def cam_markers(robot: Robot, stamp_ns: int = 0) -> bytes:
    """The serialized MarkerArray of the mounted cam, in the frame that bears its name.

    The contour is that of /cam/profile, to its last digit; how thick the cam is, is only looks.
    """
    cam = robot.mounted
    outline = contour_of(cam, robot.law).T
    half, rgba = 0.5 * DISC * robot.size, of_cam(cam.name)
    strip = [point(float(x), float(y), half) for x, y in closed(outline)]
    solid = [point(*map(float, corner)) for corner in _solid(outline, half)]
    at, width = header(stamp_ns, cam.name), (0.01 * robot.size, 0.0, 0.0)
    markers = [
        marker(at, NAMESPACE, 0, LINE_STRIP, width, colour(colours.BLACK), strip, turns=True),
        marker(at, NAMESPACE, 1, TRIANGLE_LIST, (1.0, 1.0, 1.0), colour(rgba), solid, turns=True),
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

"""Where the follower touches its cam, and how hard; or how far it is off: /follower/markers.

Each message says all, so that none depends on one before: marker 0 is the point of contact, or in
flight the line from the cam's contour to the follower; marker 1 is the contact force along the
common normal, or in flight the gap in words. A viewer replaces the one by the other.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.drawing.force_scale import ARROW as ARROW_SHARE
from cam_rig.messages.cdr_template import CdrTemplate, example_header
from cam_rig.profile.motion import Motion
from cam_rig.robot.frames import GUIDE, Robot
from cam_rig.robot.parts import ARROW, LINE_STRIP, SPHERE, TEXT, colour, marker, new, point
from cam_rig.robot.urdf import BODY

KIND, NAMESPACE = "visualization_msgs/msg/MarkerArray", "contact"
#: Stands for the gap in the example; every text is as long.
_WORDS = "gap 0000000.0 µm"


class FollowerMarkers:
    """The serialized markers of a robot's follower, in the frame of its guide.

    Examples
    --------
    >>> from pathlib import Path
    >>> from cam_rig.simulation.loaded_scene import open_scene
    >>> markers = FollowerMarkers(Robot.of(open_scene(Path("config/scenes/quick.yaml"))))
    >>> stamps, angle = np.array([0, 10]), np.array([3.1, 3.2])
    >>> len(markers.at(stamps, angle, lift=np.array([0.0, 0.006]), force=np.array([20.0, 0.0])))
    2
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._front = robot, 0.5 * BODY * robot.size
        self._metres_per_newton = ARROW_SHARE * robot.size / robot.top_force
        self._touching = CdrTemplate(KIND, self._contact, 4)
        self._flying = CdrTemplate(KIND, self._flight, 4)

    def at(
        self, stamps: NDArray[np.int64], angle: FloatArray, lift: FloatArray, force: FloatArray
    ) -> list[bytes]:
        """A message at each of ``(n,)`` stamps (ns); cam angle in rad, lift in m, force in N.

        Where the contact force is zero, contact is lost.
        """
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
        gaps = np.hypot(*(carried - contact)[off].T)
        here = iter(touching), iter(map(_with_words, flying, gaps.tolist()))
        return [next(here[is_off]) for is_off in off.tolist()]

    def _contact(self, x: float, y: float, tip_x: float, tip_y: float) -> Any:
        size, at = self._robot.size, example_header(GUIDE)
        ball, shaft = (0.04 * size,) * 3, (0.02 * size, 0.05 * size, 0.0)
        ends = point(x, y, self._front), point(tip_x, tip_y, self._front)
        dot, arrow = colour(colours.BLACK), colour(colours.FORCE)
        return new(
            "visualization_msgs/MarkerArray",
            [
                marker(at, NAMESPACE, 0, SPHERE, ball, dot, place=ends[0]),
                marker(at, NAMESPACE, 1, ARROW, shaft, arrow, ends),
            ],
        )

    def _flight(self, x: float, y: float, to_x: float, to_y: float) -> Any:
        size, at, red = self._robot.size, example_header(GUIDE), colour(colours.GAP)
        ends = point(x, y, self._front), point(to_x, to_y, self._front)
        line, words = (0.02 * size, 0.0, 0.0), (0.0, 0.0, 0.1 * size)
        beside = point(0.5 * size, 0.0, self._front)
        return new(
            "visualization_msgs/MarkerArray",
            [
                marker(at, NAMESPACE, 0, LINE_STRIP, line, red, ends),
                marker(at, NAMESPACE, 1, TEXT, words, red, place=beside, text=_WORDS),
            ],
        )


def _with_words(flight: bytes, gap: float) -> bytes:
    """A message with its gap (m) in words."""
    words = f"gap {min(gap * 1e6, 9_999_999.9):9.1f} µm"
    return flight.replace(_WORDS.encode(), words.encode())

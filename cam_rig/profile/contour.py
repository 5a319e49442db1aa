"""The cam's contour under a translating roller or point follower on the cam's centre line.

The follower's centre stands at (0, d(θ)) above the cam, d = R_b + R_r + s. Turning the frame
with the cam (eq. 2.16) gives the pitch curve; the contour lies one roller radius inside it along
its normal (eq. 2.20-2.25).
"""

from __future__ import annotations

import numpy as np

from cam_rig.laws import TURN, Law
from cam_rig.laws.bernstein import FloatArray


def pitch_curve(law: Law, pitch_radius: float, angle: FloatArray) -> FloatArray:
    """``(2, n)`` path of the follower's centre in the cam's frame, m.

    ``pitch_radius`` is R_b + R_r in m, ``angle`` the cam angles in rad.
    """
    distance = pitch_radius + law(angle)
    return np.stack([distance * np.sin(angle), distance * np.cos(angle)])


def contour(law: Law, pitch_radius: float, roller_radius: float, angle: FloatArray) -> FloatArray:
    """``(2, n)`` points of the cam's contour in its own frame, m; radii in m, angle in rad.

    Point i is the one the follower touches at cam angle i.
    """
    distance, slope = pitch_radius + law(angle), law(angle, 1)
    sine, cosine = np.sin(angle), np.cos(angle)
    tangent = np.stack([slope * sine + distance * cosine, slope * cosine - distance * sine])
    inward = np.stack([tangent[1], -tangent[0]]) / np.hypot(slope, distance)
    return pitch_curve(law, pitch_radius, angle) + roller_radius * inward


def turn_angles(points: int) -> FloatArray:
    """``points`` cam angles over one turn, without its end."""
    return np.linspace(0.0, TURN, points, endpoint=False)

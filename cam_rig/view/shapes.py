"""Outlines in the plane, in mm, as lists of strips: cam, roller, stem, guide."""

from __future__ import annotations

import numpy as np

from cam_rig.dynamics import FloatArray
from cam_rig.schema.cam import Follower

#: mm in a metre.
MM = 1e3


def circle(radius: float, points: int = 96) -> FloatArray:
    """``(points + 1, 2)`` closed circle about the origin; any unit."""
    angle = np.linspace(0.0, 2.0 * np.pi, points + 1)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def closed(points: FloatArray) -> FloatArray:
    """``(n + 1, 2)``: the ``(n, 2)`` points of an outline with the first again at the end."""
    return np.vstack([points, points[:1]])


def follower_strips(follower: Follower, reach: float) -> list[FloatArray]:
    """Roller (or point) and stem with the roller's centre, or the point, at the origin, mm.

    ``reach`` (m) is the greatest height of that centre, and here the stem's length.
    """
    half, top, roller = 0.03 * reach * MM, reach * MM, follower.roller * MM
    foot = 0.4 * roller if roller else 2.0 * half
    stem = np.array([[-half, top], [-half, foot], [half, foot], [half, top], [-half, top]])
    tip = circle(roller) if roller else np.array([[-half, foot], [0.0, 0.0], [half, foot]])
    return [tip, stem]


def guide_strips(reach: float) -> list[FloatArray]:
    """The fixed bearing of the stem, above the highest place (m) of the roller's centre, mm."""
    inner, outer = 0.04 * reach * MM, 0.16 * reach * MM
    low, high = 1.15 * reach * MM, 1.25 * reach * MM
    right = np.array([[inner, low], [outer, low], [outer, high], [inner, high], [inner, low]])
    return [right, right * (-1.0, 1.0)]


def turned(points: FloatArray, angle: float) -> FloatArray:
    """``(n, 2)`` points of the cam, turned from its own frame into the rig's at cam angle (rad).

    In its own frame the cam sees its follower towards (sin θ, cos θ); in the rig's it is on +y.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]))

"""Outlines in the plane, in mm, as lists of strips: circles, stems, faces, arms, bearings."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray

#: mm in a metre.
MM = 1e3


def circle(radius: float, points: int = 96) -> FloatArray:
    """``(points + 1, 2)`` closed circle about the origin; any unit."""
    angle = np.linspace(0.0, 2.0 * np.pi, points + 1)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def closed(points: FloatArray) -> FloatArray:
    """``(n + 1, 2)``: the ``(n, 2)`` points of an outline with the first again at the end."""
    return np.vstack([points, points[:1]])


def stem(half: float, foot: float, top: float) -> FloatArray:
    """``(5, 2)`` box around the y axis from ``foot`` to ``top``; any unit."""
    return np.array([[-half, top], [-half, foot], [half, foot], [half, top], [-half, top]])


def tip(half: float, height: float) -> FloatArray:
    """``(3, 2)`` knife edge that ends in the origin; any unit."""
    return np.array([[-half, height], [0.0, 0.0], [half, height]])


def bearing(centre: float, inner: float, outer: float, low: float, high: float) -> list[FloatArray]:
    """Two boxes on either side of x = ``centre``: a guide; any unit."""
    right = np.array([[inner, low], [outer, low], [outer, high], [inner, high], [inner, low]])
    middle = np.array([centre, 0.0])
    return [middle + right, middle + right * (-1.0, 1.0)]


def turned(points: FloatArray, angle: float) -> FloatArray:
    """``(n, 2)`` points of the cam, turned from its own frame into the rig's at cam angle (rad).

    In its own frame the cam sees its follower towards (sin θ, cos θ); in the rig's it is on +y.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]))


def distances(points: FloatArray, strip: FloatArray) -> FloatArray:
    """``(n,)`` distances of ``(n, 2)`` points from a strip ``(m, 2)`` of lines.

    Examples
    --------
    >>> distances(np.array([[0.5, 2.0], [4.0, 4.0]]), np.array([[0.0, 0.0], [1.0, 0.0]])).tolist()
    [2.0, 5.0]
    """
    begin, along = strip[:-1], np.diff(strip, axis=0)
    length = np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny)
    to = points[:, None] - begin
    share = (np.sum(to * along, axis=2) / length).clip(0.0, 1.0)
    away = to - share[:, :, None] * along
    return np.asarray(np.hypot(away[:, :, 0], away[:, :, 1]).min(axis=1))

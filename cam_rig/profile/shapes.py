"""Plane shapes of a cam and its follower, as strips of points: circle, stem, bearing, ring."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.units import FloatArray


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
    """``(n, 2)`` points of the cam's own frame in the rig's, at cam angle (rad); follower on +y."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]))


def distances(points: FloatArray, strip: FloatArray) -> FloatArray:
    """``(n,)`` distances of ``(n, 2)`` points from a strip ``(m, 2)`` of lines."""
    begin, along = strip[:-1], np.diff(strip, axis=0)
    length = np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny)
    to = points[:, None] - begin
    share = (np.sum(to * along, axis=2) / length).clip(0.0, 1.0)
    away = to - share[:, :, None] * along
    return np.asarray(np.hypot(away[:, :, 0], away[:, :, 1]).min(axis=1))


#: Degrees from number to number, and from tick to tick.
NUMBERED, TICKED = 30, 10


#: Radii as shares of the ring's: ends of a short and a long tick, middle of a number.
SHORT, LONG, NUMBER = 1.03, 1.07, 1.17


#: Strips that fill a cam, and points of each: a browser without a graphics card is slow at them.
SHELLS, SHELL_POINTS = 6, 60


#: The arc that says which way the cam turns, °, and its arrow's head over its radius.
ARC, BARB = (150.0, 390.0), 0.28


def ring(radius: float) -> list[FloatArray]:
    """Strips of a ring with a tick every 10°, longer every 30°."""
    ticks = []
    for degrees in range(0, 360, TICKED):
        outer = SHORT if degrees % NUMBERED else LONG
        ticks.append(np.outer([radius, outer * radius], _towards(degrees)))
    return [circle(radius), *ticks]


def ring_numbers(radius: float) -> tuple[FloatArray, list[str]]:
    """``(11, 2)`` middles of the numbers, and the numbers, but 0, where the follower is."""
    degrees = range(NUMBERED, 360, NUMBERED)
    places = np.array([_towards(at) for at in degrees]) * NUMBER * radius
    return places, [f"{at}" for at in degrees]


def rotation(radius: float) -> list[FloatArray]:
    """Strips of an arrow along an arc: counterclockwise, as the cam turns."""
    angle = np.radians(np.linspace(*ARC, 49))
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    back, out = arc[-1] - arc[-4], arc[-1] / radius
    back = -back / math.hypot(*back)
    barbs = [arc[-1] + BARB * radius * (back + side * 0.6 * out) for side in (1.0, -1.0)]
    return [arc, np.array([barbs[0], arc[-1], barbs[1]])]


def body(outline: FloatArray) -> tuple[list[FloatArray], float]:
    """Closed strips ``(n, 2)`` within an outline around the origin, and half their width."""
    outline = outline[np.linspace(0, len(outline) - 1, SHELL_POINTS + 1).astype(int)]
    radii = np.hypot(*outline.T)
    half = float(radii.max()) / (2.0 * SHELLS)
    inner = outline * ((radii - half) / radii)[:, None]
    return [inner * (i + 0.5) / (SHELLS - 0.5) for i in range(SHELLS)], 1.08 * half


def _towards(degrees: float) -> FloatArray:
    """Where a degree of the ring is: 0 up, then counterclockwise."""
    angle = math.radians(degrees)
    return np.array([-math.sin(angle), math.cos(angle)])

"""A cam as an instrument: a ring of degrees around it, which way it turns, its body filled.

The frame is the rig's: the cam's own direction of 0° points to +y at cam angle 0 and turns
counterclockwise, so that it points to θ on the ring, which stands still. Any unit of length.
"""

from __future__ import annotations

import math

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.drawing.outlines import circle

#: Degrees from number to number, and from tick to tick.
NUMBERED, TICKED = 30, 10
#: Radii as shares of the ring's: ends of a short and a long tick, middle of a number.
SHORT, LONG, NUMBER = 1.03, 1.07, 1.17
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


def body(outline: FloatArray, shells: int = 6, points: int = 60) -> tuple[list[FloatArray], float]:
    """Closed strips within an outline around the origin, and the radius that makes them fill it.

    Parameters
    ----------
    outline : ``(n, 2)``, closed, seen whole from the origin as a cam is
    points : of a strip; wide lines are what a browser without a graphics card is slow at

    Returns
    -------
    strips ``(n, 2)`` from the inside, and half of their width
    """
    outline = outline[np.linspace(0, len(outline) - 1, points + 1).astype(int)]
    radii = np.hypot(*outline.T)
    half = float(radii.max()) / (2.0 * shells)
    inner = outline * ((radii - half) / radii)[:, None]
    return [inner * (i + 0.5) / (shells - 0.5) for i in range(shells)], 1.08 * half


def _towards(degrees: float) -> FloatArray:
    """Where a degree of the ring is: 0 up, then counterclockwise."""
    angle = math.radians(degrees)
    return np.array([-math.sin(angle), math.cos(angle)])

"""Plane shapes for drawings of a cam and its follower, as polylines."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.units import FloatArray


def circle(radius: float, points: int = 96) -> FloatArray:
    """Return a closed circle about the origin, shape ``(points + 1, 2)``, in any unit."""
    angle = np.linspace(0.0, 2.0 * np.pi, points + 1)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def close_outline(points: FloatArray) -> FloatArray:
    """Return an outline ``(n, 2)`` with its first point repeated at the end.

    The shape of the result is ``(n + 1, 2)``.
    """
    return np.vstack([points, points[:1]])


def stem(half: float, foot: float, top: float) -> FloatArray:
    """Return a follower's stem as a closed box ``(5, 2)``, in any unit.

    The box is symmetric about the y axis, with half the width `half`, from y = `foot` to `top`.
    """
    return np.array([[-half, top], [-half, foot], [half, foot], [half, top], [-half, top]])


def tip(half: float, height: float) -> FloatArray:
    """Return a pointed tip as a polyline ``(3, 2)``, in any unit.

    The tip is in the origin. The other ends are at x = ± `half` and y = `height`.
    """
    return np.array([[-half, height], [0.0, 0.0], [half, height]])


def bearing(centre: float, inner: float, outer: float, low: float, high: float) -> list[FloatArray]:
    """Return a guide bearing as two closed boxes on either side of x = `centre`.

    In x each box extends from a distance of `inner` to `outer` from the centre, in y from `low` to
    `high`, in any unit.
    """
    right = np.array([[inner, low], [outer, low], [outer, high], [inner, high], [inner, low]])
    middle = np.array([centre, 0.0])
    return [middle + right, middle + right * (-1.0, 1.0)]


def rotate(points: FloatArray, angle: float) -> FloatArray:
    """Rotate points ``(n, 2)`` counterclockwise by a cam angle (rad).

    It converts points of the cam frame to the stationary frame of the rig, in which the follower is
    on +y.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]))


def distances(points: FloatArray, strip: FloatArray) -> FloatArray:
    """Return the distances ``(n,)`` of points ``(n, 2)`` from a polyline ``(m, 2)``."""
    start, along = strip[:-1], np.diff(strip, axis=0)
    length = np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny)
    offset = points[:, None] - start
    fraction = (np.sum(offset * along, axis=2) / length).clip(0.0, 1.0)
    away = offset - fraction[:, :, None] * along
    return np.asarray(np.hypot(away[:, :, 0], away[:, :, 1]).min(axis=1))


#: Angle between two numbers of the ring of degrees around a drawn cam, degrees.
NUMBER_STEP = 30
#: Angle between two tick marks of the ring of degrees around a drawn cam, degrees.
TICK_STEP = 10
#: Radius of the outer end of a short tick mark, as a multiple of the radius of the ring of degrees
#: around a drawn cam.
SHORT_TICK = 1.03
#: Radius of the outer end of a long tick mark, as a multiple of the radius of the ring of degrees
#: around a drawn cam.
LONG_TICK = 1.07
#: Radius at which the middle of a number is placed, as a multiple of the radius of the ring of
#: degrees around a drawn cam.
NUMBER_RADIUS = 1.17
#: Number of polylines that fill the picture of a cam. They are few, because browsers without a
#: graphics card are slow.
SHELLS = 6
#: Number of points of each polyline that fills the picture of a cam.
SHELL_POINTS = 60
#: Start and end of the arc that shows the cam's direction of rotation, degrees.
ARROW_ARC_DEG = (150.0, 390.0)
#: Size of the head of the arrow that shows the rotation, as a fraction of the radius of its arc.
BARB_RATIO = 0.28


def ring(radius: float) -> list[FloatArray]:
    """Return the polylines of a ring of degrees around a cam, with ticks every 10°.

    The ticks are longer every 30°. The first polyline is the circle, the others are the ticks.
    """
    ticks = []
    for degrees in range(0, 360, TICK_STEP):
        outer = SHORT_TICK if degrees % NUMBER_STEP else LONG_TICK
        ticks.append(np.outer([radius, outer * radius], _direction(degrees)))
    return [circle(radius), *ticks]


def ring_numbers(radius: float) -> tuple[FloatArray, list[str]]:
    """Return the positions ``(11, 2)`` and the texts of the numbers on a ring of degrees.

    `radius` is that of the ring. The number 0 is left out, because the follower is at that
    position.
    """
    degrees = range(NUMBER_STEP, 360, NUMBER_STEP)
    centres = np.array([_direction(number) for number in degrees]) * NUMBER_RADIUS * radius
    return centres, [f"{number}" for number in degrees]


def rotation_arrow(radius: float) -> list[FloatArray]:
    """Return the polylines of an arrow along an arc about the shaft.

    The arrow is counterclockwise, as the cam turns.
    """
    angle = np.radians(np.linspace(*ARROW_ARC_DEG, 49))
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    back, out = arc[-1] - arc[-4], arc[-1] / radius
    back = -back / math.hypot(*back)
    barbs = [arc[-1] + BARB_RATIO * radius * (back + side * 0.6 * out) for side in (1.0, -1.0)]
    return [arc, np.array([barbs[0], arc[-1], barbs[1]])]


def body(outline: FloatArray) -> tuple[list[FloatArray], float]:
    """Return closed polylines ``(n, 2)`` that fill an outline, and half their line width.

    Drawn with this line width, they cover the area inside of the outline, which surrounds the
    origin. Both are in the unit of the outline.
    """
    outline = outline[np.linspace(0, len(outline) - 1, SHELL_POINTS + 1).astype(int)]
    radii = np.hypot(*outline.T)
    half = float(radii.max()) / (2.0 * SHELLS)
    inner = outline * ((radii - half) / radii)[:, None]
    return [inner * (i + 0.5) / (SHELLS - 0.5) for i in range(SHELLS)], 1.08 * half


def _direction(degrees: float) -> FloatArray:
    """Return the unit vector at an angle of the ring of degrees.

    0° is up (+y), and the angle increases counterclockwise.
    """
    angle = math.radians(degrees)
    return np.array([-math.sin(angle), math.cos(angle)])

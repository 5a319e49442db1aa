"""Whether points are a closed contour in order: what a measurement of them would not show."""

from __future__ import annotations

import numpy as np
from shapely import LinearRing

from cam_rig.arrays import FloatArray

#: A step from point to point beyond so many of the usual one is a gap. Contours written at equal
#: steps of the cam angle stay below 2.
WIDE = 10.0
#: A contour of fewer points is a guess.
FEWEST = 36


def crossing(points: FloatArray) -> str | None:
    """What is wrong with the order of ``(2, n)`` points (m), if the line through them crosses."""
    if LinearRing(points.T).is_simple:
        return None
    return "the contour crosses itself; allowed: points in their order around the cam"


def sparse(points: FloatArray) -> str | None:
    """Whether ``(2, n)`` points are too few to tell a cam's shape between them."""
    if points.shape[1] >= FEWEST:
        return None
    return (
        f"{points.shape[1]} points; between them the contour is guessed, to a part of the lift; "
        f"allowed: {FEWEST} or more"
    )


def gap(points: FloatArray) -> str | None:
    """The widest step between ``(2, n)`` points (m), the last one to the first, if it is a gap."""
    step = np.hypot(*(np.roll(points, -1, axis=1) - points))
    usual, widest = float(np.median(step)), int(np.argmax(step))
    if not step[widest] > WIDE * usual:
        return None
    follower = (widest + 1) % step.size + 1
    return (
        f"points {widest + 1} and {follower} are {step[widest] * 1e3:.4g} mm apart, the others "
        f"{usual * 1e3:.4g} mm (median); between them the contour is guessed; allowed: a whole "
        f"contour, no step above {WIDE:g} medians"
    )

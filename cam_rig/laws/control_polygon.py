"""The control polygons of a cam's Bézier and B-spline segments."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws.cam import segment_angles
from cam_rig.laws.families.b_spline import greville
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Bezier, BSpline


def control_polygons(cam: CamConfig) -> list[tuple[FloatArray, FloatArray]]:
    """Cam angles (rad) and ordinates (m) of the control points, one pair a segment that has any.

    Those of a Bézier curve are equidistant, those of a B-spline stand at its Greville abscissae.
    """
    found = []
    for segment, start in zip(cam.segments, segment_angles(cam), strict=True):
        if isinstance(segment, Bezier):
            fraction = np.linspace(0.0, 1.0, len(segment.ordinates.numbers))
        elif isinstance(segment, BSpline):
            knots = np.array(segment.knots.numbers)
            fraction = greville(knots, segment.degree) - knots[0]
            fraction /= knots[-1] - knots[0]
        else:
            continue
        ordinates = cam.lift.si * np.array(segment.ordinates.numbers)
        found.append((start + segment.span.si * fraction, ordinates))
    return found

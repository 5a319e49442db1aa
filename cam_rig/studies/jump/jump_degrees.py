"""The jump speed of a law by segments, by the degree of its half-rises: the paper prints none."""

from __future__ import annotations

import re

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import build_law
from cam_rig.schema import CamConfig
from cam_rig.studies.jump.search import sought_speed
from cam_rig.units import RPM

#: The half-rises there are (laws thesis, eq. 3.4-3.9).
DEGREES = (4, 6, 8)


def jump_by_degree(
    cam: CamConfig, parameters: TwoMassParameters, duration: float
) -> dict[int, float]:
    """Jump speed (rpm) from rest with every half-rise of a cam of each degree.

    Empty for a cam that has no half-rises.
    """
    if not any(_HALF.fullmatch(segment.law) for segment in cam.segments):
        return {}
    return {
        degree: sought_speed(build_law(_with_degree(cam, degree)), parameters, duration) / RPM
        for degree in DEGREES
    }


_HALF = re.compile(r"bezier\d+_(start|end)")


def _with_degree(cam: CamConfig, degree: int) -> CamConfig:
    segments = [
        segment.model_copy(update={"law": _HALF.sub(rf"bezier{degree}_\1", segment.law)})
        for segment in cam.segments
    ]
    return cam.model_copy(update={"segments": segments})

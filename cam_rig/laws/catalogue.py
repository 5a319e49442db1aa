"""Every law there is, and the figures by which rises are compared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import get_args

import numpy as np

from cam_rig.laws.continuity import joints
from cam_rig.laws.law import Law
from cam_rig.laws.named import NAMED_RISES, unit_rise
from cam_rig.laws.peaks import peak
from cam_rig.laws.pieces import joined
from cam_rig.schema.segments import Rise, Segment
from cam_rig.schema.segments.base import SegmentBase
from cam_rig.units import TURN


def free_laws() -> dict[str, str]:
    """Laws whose figures depend on the numbers in the cam file, with the keys of these numbers."""
    kinds = (kind for kind in get_args(get_args(Segment)[0]) if kind is not Rise)
    return {
        get_args(kind.model_fields["law"].annotation)[0]: ", ".join(
            key for key in kind.model_fields if key not in SegmentBase.model_fields | {"law": None}
        )
        for kind in kinds
    }


@dataclass(frozen=True)
class Figures:
    """Peaks of a rise of unit lift over a unit span, and the class it joins with.

    ``continuity`` is C^k against dwells; a half-rise joins a dwell and a straight line.
    """

    peak_velocity: float
    peak_acceleration: float
    peak_jerk: float
    continuity: int


@lru_cache(maxsize=len(NAMED_RISES))
def figures(name: str) -> Figures:
    """The figures of a named rise, from exact roots."""
    law = _between_lines(name)
    velocity, acceleration, jerk = (abs(peak(law, order).value) for order in (1, 2, 3))
    inside = [joint.continuity for joint in joints(law) if 1.0 <= joint.angle <= 2.0]
    return Figures(velocity, acceleration, jerk, min(inside))


def _between_lines(name: str) -> Law:
    """The rise from angle 1 to 2, between the dwells or straight lines that it is made for."""
    before, after = NAMED_RISES[name].slopes
    breaks, columns = unit_rise(name)
    rest = TURN - 2.0
    lines = np.array([-before, 0.0]), np.array([1.0, 1.0 + after * rest])
    edges = np.array([0.0, *(1.0 + u for u in breaks), TURN])
    return Law(name, edges, joined([lines[0], *columns, lines[1]]))

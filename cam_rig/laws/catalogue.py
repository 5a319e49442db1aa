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

#: Families of rises with their titles.
FAMILY_TITLES = {
    "polynomial": "Full rises, polynomial",
    "start": "Half-rises, start",
    "end": "Half-rises, end",
    "classical": "Full rises, classical",
}


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
class RiseFamily:
    """Rises that are looked at together: a title, and their names."""

    title: str
    rises: tuple[str, ...]


def families() -> dict[str, RiseFamily]:
    """Every named rise in its one family, in the order of the laws thesis's figures 3.1 to 3.12.

    Examples
    --------
    >>> families()["start"].rises
    ('bezier4_start', 'bezier6_start', 'bezier8_start')
    """
    found: dict[str, list[str]] = {key: [] for key in FAMILY_TITLES}
    for name in NAMED_RISES:
        end = name.partition("_")[2]
        curve = "polynomial" if name.startswith(("poly", "bezier")) else "classical"
        found[end if end in found else curve].append(name)
    return {key: RiseFamily(FAMILY_TITLES[key], tuple(rises)) for key, rises in found.items()}


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
    law = between_lines(name)
    velocity, acceleration, jerk = (abs(peak(law, order).value) for order in (1, 2, 3))
    inside = [joint.continuity for joint in joints(law) if 1.0 <= joint.angle <= 2.0]
    return Figures(velocity, acceleration, jerk, min(inside))


def between_lines(name: str) -> Law:
    """The rise of a name from angle 1 to 2 (rad), between the lines that it is made for.

    Unit lift and unit span; the lines are dwells, or for a half-rise a dwell and constant
    velocity. The law is not periodic: it is only meant about the rise.
    """
    before, after = NAMED_RISES[name].slopes
    breaks, columns = unit_rise(name)
    rest = TURN - 2.0
    lines = np.array([-before, 0.0]), np.array([1.0, 1.0 + after * rest])
    edges = np.array([0.0, *(1.0 + u for u in breaks), TURN])
    return Law(name, edges, joined([lines[0], *columns, lines[1]]))

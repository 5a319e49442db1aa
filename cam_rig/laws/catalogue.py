"""Every law there is, and the figures by which rises are compared."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import get_args

import numpy as np

from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import joined
from cam_rig.laws.law import Law, joints, peak
from cam_rig.laws.segments import NAMED_RISES, unit_rise
from cam_rig.schema import CamConfig
from cam_rig.schema.segment_base import SegmentBase
from cam_rig.schema.segments import Rise, Segment
from cam_rig.units import TURN, FloatArray

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
    """Every named rise in its one family, in the order of the laws thesis's figures 3.1 to 3.12."""
    found: dict[str, list[str]] = {key: [] for key in FAMILY_TITLES}
    for name in NAMED_RISES:
        end = name.partition("_")[2]
        curve = "polynomial" if name.startswith(("poly", "bezier")) else "classical"
        found[end if end in found else curve].append(name)
    return {key: RiseFamily(FAMILY_TITLES[key], tuple(rises)) for key, rises in found.items()}


@dataclass(frozen=True)
class Figures:
    """Peaks of a rise of unit lift and span, and its class against what it is made to join."""

    peak_velocity: float
    peak_acceleration: float
    peak_jerk: float
    continuity: int


@lru_cache(maxsize=len(NAMED_RISES))
def figures(name: str) -> Figures:
    """The figures of a named rise, from exact roots."""
    law = between_lines(name)
    velocity, acceleration, jerk = (abs(peak(law, order).value) for order in (1, 2, 3))
    return Figures(velocity, acceleration, jerk, min(one.continuity for one in joints(law)[1:]))


def between_lines(name: str) -> Law:
    """A rise of unit lift from angle 1 to 2 (rad), between the dwells or lines it is made for."""
    before, after = NAMED_RISES[name].slopes
    breaks, columns = unit_rise(name)
    rest = TURN - 2.0
    lines = np.array([-before, 0.0]), np.array([1.0, 1.0 + after * rest])
    edges = np.array([0.0, *(1.0 + u for u in breaks), TURN])
    return Law(name, edges, joined([lines[0], *columns, lines[1]]))


# A law's s to s''' as curves: of a cam over its turn, of a named rise alone.

#: Points of a curve, but of each of its pieces at least the fewest.
POINTS, FEWEST = 2000, 12
#: Derivatives that are drawn: s, s', s'', s'''.
ORDERS = range(4)
#: Cam angle (rad) at which `between_lines` begins its rise, after the first of its pieces.
START = 1.0
#: Unit of lift where the cams have several, and what it is in m.
COMMON_UNIT = ("mm", 1e-3)


@dataclass(frozen=True, eq=False)
class LawCurves:
    """S, s', s'' and s''' of one law as they are drawn; a jump stands with both its limits.

    x, motion : ``(n,)`` deg and ``(4, n)`` m/rad^order; of a bare rise u ∈ [0, 1], per unit rise
    infinite : where the velocity jumps, and so s'' is infinite: x, and what s' gains
    """

    name: str
    x: FloatArray
    motion: FloatArray
    infinite: tuple[tuple[float, float], ...]


def sampled_pieces(law: Law, order: int) -> tuple[FloatArray, FloatArray]:
    """Cam angles (rad) and values (m/rad^order) to draw, ``(count, n)``, each piece end to end."""
    u = np.linspace(0.0, 1.0, max(FEWEST, POINTS // law.spans.size))
    angles = law.breaks[:-1] + np.outer(u, law.spans)
    return angles, bernstein.evaluate(law.derivative_ordinates(order), u)


def cam_curves(name: str, law: Law) -> LawCurves:
    """The curves of a cam's law over one turn."""
    angles = sampled_pieces(law, 0)[0]
    motion = np.stack([sampled_pieces(law, order)[1].T.ravel() for order in ORDERS])
    jumps = [joint for joint in joints(law) if joint.continuity == 0]
    infinite = tuple((float(np.degrees(joint.angle)), joint.jump) for joint in jumps)
    return LawCurves(name, np.degrees(angles.T.ravel()), motion, infinite)


def rise_curves(name: str) -> LawCurves:
    """The curves of a named rise over u from 0 to 1, without what it joins."""
    law = between_lines(name)
    u = sampled_pieces(law, 0)[0][:, 1:-1].T.ravel() - START
    motion = [sampled_pieces(law, order)[1][:, 1:-1].T.ravel() for order in ORDERS]
    jumps = [joint for joint in joints(law)[1:] if joint.continuity == 0]
    infinite = tuple((joint.angle - START, joint.jump) for joint in jumps)
    return LawCurves(name, u, np.stack(motion), infinite)


def rise_values(name: str, u: FloatArray) -> FloatArray:
    """S to s''' of a named rise, ``(4, len(u))``; right limits, at u = 1 the left one."""
    law = between_lines(name)
    values = np.stack([law(START + u, order) for order in ORDERS])
    ends = [law.derivative_ordinates(order)[-1, -2] for order in ORDERS]
    return np.where(u == 1.0, np.array(ends)[:, None], values)


def common_unit(cams: Iterable[CamConfig]) -> tuple[str, float]:
    """The unit of lift that all cams have, and what it is in m; mm if they have several, or m."""
    units = {(cam.lift.unit, cam.lift.factor) for cam in cams}
    return units.pop() if len(units) == 1 and ("m", 1.0) not in units else COMMON_UNIT

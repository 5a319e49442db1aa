"""Catalogue of all laws, with the properties and curves that compare them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import get_args

import numpy as np

from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import join_pieces
from cam_rig.laws.families import FAMILIES
from cam_rig.laws.law import Law, joints, peak
from cam_rig.laws.segments import NAMED_RISES, RISES, unit_rise
from cam_rig.schema import CamConfig
from cam_rig.schema.motions import MOTIONS
from cam_rig.schema.segment_base import SegmentBase
from cam_rig.schema.segments import Rise, Segment
from cam_rig.units import TURN, FloatArray

#: Titles of the families of rises, by their keys.
FAMILY_TITLES = {
    "polynomial": "Full rises, polynomial",
    "start": "Half-rises, start",
    "end": "Half-rises, end",
    "classical": "Full rises, classical",
}


def list_parametric_laws() -> dict[str, str]:
    """Return the laws whose peaks depend on numbers of the cam file.

    Each law is mapped to the keys of its numbers, joined by commas.
    """
    kinds = (kind for kind in get_args(get_args(Segment)[0]) if kind is not Rise)
    return {
        name: ", ".join(
            key for key in kind.model_fields if key not in SegmentBase.model_fields | {"law": None}
        )
        for kind in kinds
        for name in get_args(kind.model_fields["law"].annotation)
        if name not in FAMILIES
    }


@dataclass(frozen=True)
class RiseFamily:
    """Family of rises that are compared in one figure: its title and their names."""

    title: str
    rises: tuple[str, ...]


def rise_families() -> dict[str, RiseFamily]:
    """Return the families of named rises, each rise in one of them.

    The order is that of figures 3.1 to 3.12 of the laws thesis.
    """
    names: dict[str, list[str]] = {key: [] for key in FAMILY_TITLES}
    for name in NAMED_RISES:
        suffix = name.partition("_")[2]
        curve = "polynomial" if name.startswith(("poly", "bezier")) else "classical"
        names[suffix if suffix in names else curve].append(name)
    return {key: RiseFamily(FAMILY_TITLES[key], tuple(rises)) for key, rises in names.items()}


def all_families() -> dict[str, RiseFamily]:
    """Return the families of named rises, of the rises of the handbooks, and of motions."""
    handbook = tuple(name for name in FAMILIES if name not in MOTIONS)
    return rise_families() | {
        "handbook": RiseFamily("Full rises, handbooks", handbook),
        "motion": RiseFamily("Motions between rests", MOTIONS),
    }


@dataclass(frozen=True)
class Figures:
    """Peaks of a rise of unit lift and span, and its class of continuity.

    The class includes the joints with the dwells or lines for which the rise is made.
    """

    peak_velocity: float
    peak_acceleration: float
    peak_jerk: float
    continuity: int


@lru_cache(maxsize=len(RISES))
def rise_figures(name: str) -> Figures:
    """Compute the peaks and the continuity of a rise of `RISES`, from exact roots."""
    law = between_lines(name)
    velocity, acceleration, jerk = (abs(peak(law, order).value) for order in (1, 2, 3))
    return Figures(velocity, acceleration, jerk, min(joint.continuity for joint in joints(law)[1:]))


def between_lines(name: str) -> Law:
    """Return a law that contains a rise of `RISES`, of unit lift, between its neighbours.

    The rise is at the cam angles 1 to 2 rad. The neighbours are the dwells or straight lines for
    which it is made.
    """
    before, after = NAMED_RISES[name].slopes if name in NAMED_RISES else (0.0, 0.0)
    breaks, columns = unit_rise(name)
    remainder = TURN - 2.0
    lines = np.array([-before, 0.0]), np.array([1.0, 1.0 + after * remainder])
    edges = np.array([0.0, *(1.0 + u for u in breaks), TURN])
    return Law(name, edges, join_pieces([lines[0], *columns, lines[1]]))


# Curves of s to s''': of a cam over its turn, or of a named rise alone.

#: Number of points of a drawn curve, divided among its pieces.
CURVE_POINTS = 2000
#: Smallest number of points of each piece of a drawn curve.
MIN_PIECE_POINTS = 12
#: Orders of the derivatives in a figure: s, s', s'', s'''.
ORDERS = range(4)
#: Cam angle (rad) at which the rise of `between_lines` starts.
RISE_START = 1.0
#: Unit of the lift axis if the cams have different units, and its factor to m.
DEFAULT_UNIT = ("mm", 1e-3)


@dataclass(frozen=True, eq=False)
class LawCurves:
    """Curves of s, s', s'' and s''' of one law, with both limits at a jump.

    Parameters
    ----------
    name : str
        Cam or rise.
    x : ndarray, shape (n,)
        Cam angles in deg, or u ∈ [0, 1] of a single rise.
    motion : ndarray, shape (4, n)
        Derivatives s to s''' in m/rad^order, or per unit lift and span of a single rise.
    infinite : tuple of (float, float)
        Velocity jumps, at which s'' is infinite: pairs of x and the change of s'.
    """

    name: str
    x: FloatArray
    motion: FloatArray
    infinite: tuple[tuple[float, float], ...]


def sample_pieces(law: Law, order: int) -> tuple[FloatArray, FloatArray]:
    """Return samples of a derivative of a law: angles (rad) and values (m/rad^order).

    Each has the shape ``(count, n)``, with one column per piece, from its start to its end.
    """
    u = np.linspace(0.0, 1.0, max(MIN_PIECE_POINTS, CURVE_POINTS // law.spans.size))
    angles = law.breaks[:-1] + np.outer(u, law.spans)
    return angles, bernstein.evaluate(law.derivative_ordinates(order), u)


def cam_curves(name: str, law: Law) -> LawCurves:
    """Return the curves of s to s''' of a cam's law over one turn."""
    angles = sample_pieces(law, 0)[0]
    motion = np.stack([sample_pieces(law, order)[1].T.ravel() for order in ORDERS])
    jumps = [joint for joint in joints(law) if joint.continuity == 0]
    infinite = tuple((float(np.degrees(joint.angle)), joint.jump) for joint in jumps)
    return LawCurves(name, np.degrees(angles.T.ravel()), motion, infinite)


def rise_curves(name: str) -> LawCurves:
    """Return the curves of s to s''' of a named rise over u from 0 to 1.

    Its neighbours are left out.
    """
    law = between_lines(name)
    u = sample_pieces(law, 0)[0][:, 1:-1].T.ravel() - RISE_START
    motion = [sample_pieces(law, order)[1][:, 1:-1].T.ravel() for order in ORDERS]
    jumps = [joint for joint in joints(law)[1:] if joint.continuity == 0]
    infinite = tuple((joint.angle - RISE_START, joint.jump) for joint in jumps)
    return LawCurves(name, u, np.stack(motion), infinite)


def rise_values(name: str, u: FloatArray) -> FloatArray:
    """Return s to s''' of a named rise at positions u, ``(4, len(u))``.

    Values are right limits, at u = 1 left limits.
    """
    law = between_lines(name)
    values = np.stack([law(RISE_START + u, order) for order in ORDERS])
    ends = [law.derivative_ordinates(order)[-1, -2] for order in ORDERS]
    return np.where(u == 1.0, np.array(ends)[:, None], values)


def common_unit(cams: Iterable[CamConfig]) -> tuple[str, float]:
    """Return the unit of lift in the files of all cams, and its factor to m.

    The unit is mm if the cams have different units, or m.
    """
    units = {(cam.lift.unit, cam.lift.factor) for cam in cams}
    return units.pop() if len(units) == 1 and ("m", 1.0) not in units else DEFAULT_UNIT

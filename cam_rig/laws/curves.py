"""A law's s to s''' as curves: of a cam over its turn, of a named rise alone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import bernstein
from cam_rig.laws.catalogue import between_lines
from cam_rig.laws.continuity import joints
from cam_rig.laws.law import Law
from cam_rig.schema import CamConfig

#: Points of a curve, but of each of its pieces at least the fewest.
POINTS, FEWEST = 2000, 12
#: Derivatives that are drawn: s, s', s'', s'''.
ORDERS = range(4)
#: Cam angles (rad) between which `between_lines` has its rise.
RISE = (1.0, 2.0)
#: Unit of lift where the cams have several, and what it is in m.
COMMON_UNIT = ("mm", 1e-3)


@dataclass(frozen=True, eq=False)
class LawCurves:
    """S, s', s'' and s''' of one law as they are drawn; a jump stands with both its limits.

    Parameters
    ----------
    name : what the curves are called
    x : ``(n,)`` cam angle in degrees, or u ∈ [0, 1] of a bare rise
    motion : ``(4, n)`` of a cam in m/rad^order, of a bare rise per unit rise and unit span
    infinite : where the velocity jumps, and so s'' is infinite: x, and what s' gains
    """

    name: str
    x: FloatArray
    motion: FloatArray
    infinite: tuple[tuple[float, float], ...]


def sampled_pieces(law: Law, order: int) -> tuple[FloatArray, FloatArray]:
    """Cam angles (rad) and values (m/rad^order) to draw, ``(count, n)``, one column a piece.

    Both ends of a piece are in it, so that a jump shows its two limits.
    """
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
    """The curves of a named rise over u from 0 to 1, without what it joins.

    Examples
    --------
    >>> curves = rise_curves("poly345")
    >>> [round(float(curves.motion[order].max()), 3) for order in (0, 1, 3)]
    [1.0, 1.875, 60.0]
    """
    law = between_lines(name)
    inside = _inside(law)
    angles = sampled_pieces(law, 0)[0]
    motion = [sampled_pieces(law, order)[1][:, inside].T.ravel() for order in ORDERS]
    jumps = [j for j in joints(law) if j.continuity == 0 and RISE[0] <= j.angle <= RISE[1]]
    infinite = tuple((joint.angle - RISE[0], joint.jump) for joint in jumps)
    return LawCurves(name, angles[:, inside].T.ravel() - RISE[0], np.stack(motion), infinite)


def rise_values(name: str, u: FloatArray) -> FloatArray:
    """S to s''' of a named rise, ``(4, len(u))``; right limits, at u = 1 the left one.

    Examples
    --------
    >>> rise_values("simple_harmonic", np.array([0.0, 1.0])).round(3)[2].tolist()
    [4.935, -4.935]
    """
    law = between_lines(name)
    values = np.stack([law(RISE[0] + u, order) for order in ORDERS])
    last = int(np.flatnonzero(_inside(law))[-1])
    ends = [law.derivative_ordinates(order)[-1, last] for order in ORDERS]
    return np.where(u == 1.0, np.array(ends)[:, None], values)


def common_unit(cams: Iterable[CamConfig]) -> tuple[str, float]:
    """The unit of lift that all cams have, and what it is in m; mm if they have several, or m."""
    units = {(cam.lift.unit, cam.lift.factor) for cam in cams}
    return units.pop() if len(units) == 1 and ("m", 1.0) not in units else COMMON_UNIT


def _inside(law: Law) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """``(n,)`` which pieces of a law of `between_lines` are the rise's."""
    return (law.breaks[:-1] >= RISE[0]) & (law.breaks[:-1] < RISE[1])

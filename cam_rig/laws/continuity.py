"""How smoothly a law's pieces join: the class C0 to C4 at each joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws.law import Law

#: Classes are told apart up to this one; what is smoother counts as it.
SMOOTHEST = 4
#: A jump below this fraction of the derivative's peak in the pieces that meet counts as 0.
TOLERANCE = 1e-6
#: Rounding of a derivative at a piece's end, in units of eps·level·(2p/span)^order.
ROUNDINGS = 16.0


@dataclass(frozen=True)
class Joint:
    """Where two pieces of a law meet.

    Parameters
    ----------
    angle : cam angle, rad
    continuity : highest derivative that goes on without a jump, 4 at most, −1 for a step
    jump : right minus left limit of the next derivative, m/rad^(continuity + 1); 0 at C4
    """

    angle: float
    continuity: int
    jump: float


def joints(law: Law) -> tuple[Joint, ...]:
    """Every joint of the law with its class, in order from cam angle 0."""
    jumps = np.stack([law.jumps(order) for order in range(SMOOTHEST + 1)])
    breaks = np.abs(jumps) > np.stack([_limits(law, order) for order in range(SMOOTHEST + 1)])
    found = []
    for i, angle in enumerate(law.breaks[:-1]):
        first = int(np.argmax(breaks[:, i])) if breaks[:, i].any() else SMOOTHEST + 1
        jump = 0.0 if first > SMOOTHEST else float(jumps[first, i])
        found.append(Joint(float(angle), first - 1, jump))
    return tuple(found)


def continuity(law: Law) -> int:
    """The class of the whole law: that of its roughest joint."""
    return min(joint.continuity for joint in joints(law))


def _limits(law: Law, order: int) -> FloatArray:
    """``(n,)`` jump (m/rad^order) at the start of each piece that still counts as 0.

    A fraction of the derivative's peak in the two pieces that meet, for another piece may be a
    thousand times as sharp; of s itself over the turn. Or what the rounding of levels makes of it
    in those pieces where that is more: short ones of high degree, and dwells.
    """
    level = float(np.abs(law.ordinates).max())
    if order == 0:
        return np.full(law.spans.size, TOLERANCE * level)
    peaks = np.abs(law.derivative_ordinates(order)).max(axis=0)
    noise = ROUNDINGS * np.finfo(float).eps * level * (2.0 * law.degree / law.spans) ** order
    limits = np.maximum(TOLERANCE * peaks, noise)
    return np.asarray(np.maximum(limits, np.roll(limits, 1)))

"""The condition of constant breadth and constant diameter: s(θ) + s(θ + π) = s_max."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.profile.checks.check import Check
from cam_rig.profile.extremes import greatest_between, stroke
from cam_rig.units import TURN

#: The sum may differ from s_max by this fraction of the lift.
TOLERANCE = 1e-9


def breadth_check(law: Law) -> Check:
    """How far the sum of opposite displacements is from what the two elements are apart for."""
    apart = stroke(law)

    def difference(angle: FloatArray) -> FloatArray:
        return np.abs(law(angle) + law(angle + 0.5 * TURN) - apart)

    edges = np.concatenate([law.breaks, (law.breaks + 0.5 * TURN) % TURN])
    worst = greatest_between(difference, np.unique(edges))
    return Check(
        "s(θ) + s(θ + 180°) − s_max",
        worst.value,
        "at most",
        TOLERANCE * law.lift,
        "mm",
        worst.angle,
        "let the fall be the rise turned by 180°, or take conjugate cams",
    )

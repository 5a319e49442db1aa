"""Cam angles at which a law passes heights, from the roots of its polynomials."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cam_rig.laws import bernstein
from cam_rig.laws.law import Law, extremes
from cam_rig.units import TURN

#: Default heights at which passages are listed, as fractions of the lift.
LEVELS = (0.01, 0.50, 0.99)
#: Largest distance of a joint from a height at which the joint is on it (rounding), as a fraction
#: of the lift.
JOINT_TOLERANCE = 1e-12
#: Largest distance (rad) of two roots that are the same root. Both pieces at a joint may contain
#: it.
SAME_ANGLE_RAD = 1e-7
#: Distance (rad) before and after a root at which the law must be on different sides of the height.
SIDE_ANGLE = 1e-5


@dataclass(frozen=True)
class Passage:
    """Passage of a law through a height, in rising or falling direction.

    `level` is the height above the lowest lift as a fraction of the cam's lift, and `angle` is the
    cam angle in rad. `rising` is True if the lift increases there.
    """

    level: float
    angle: float
    rising: bool


def passages(law: Law, lift: float, levels: Iterable[float] = LEVELS) -> tuple[Passage, ...]:
    """Return every passage of a law through heights in one turn, by cam angle.

    The heights are `levels` times `lift` (m), above the lowest lift.
    """
    low = extremes(law, 0)[0].value
    result = []
    for level in levels:
        height = low + level * lift
        above = law.ordinates - height
        angles = law.breaks[:-1][np.abs(above[0]) <= JOINT_TOLERANCE * lift].tolist()
        for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
            angles += [float(start + span * u) for u in bernstein.crossings(above[:, i])]
        angles = np.sort(np.mod(angles, TURN))
        for angle in angles[np.diff(angles, prepend=-np.inf) > SAME_ANGLE_RAD].tolist():
            before, after = law(np.array([angle - SIDE_ANGLE, angle + SIDE_ANGLE])) - height
            if before * after < 0.0:
                result.append(Passage(level, angle, bool(after > before)))
    return tuple(sorted(result, key=lambda passage: passage.angle))

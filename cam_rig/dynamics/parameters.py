"""The follower's numbers, in SI, as the models use them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cam_rig.dynamics.input_limits import require_number
from cam_rig.schema import RigConfig


@dataclass(frozen=True)
class FollowerParameters:
    """One mass on a closing spring, pressed on the cam.

    Parameters
    ----------
    mass : kg
    spring_stiffness : N/m, closing spring
    damping : N·s/m, follower to ground
    preload : N, spring and weight at zero lift
    stem_stiffness : N/m, what a landing compresses
    restitution : Newton's coefficient of a landing, 0 plastic
    """

    mass: float
    spring_stiffness: float
    damping: float
    preload: float
    stem_stiffness: float
    restitution: float = 0.0

    def __post_init__(self) -> None:
        words = {"damping": "≥ 0", "preload": "≥ 0", "restitution": "in [0, 1)"}
        for name, value in vars(self).items():
            require_number(name, value, words.get(name, "> 0"))

    @classmethod
    def from_rig(cls, rig: RigConfig) -> FollowerParameters:
        """Take the numbers of a rig file."""
        follower = rig.follower
        return cls(
            mass=follower.mass.si,
            spring_stiffness=follower.spring_stiffness.si,
            damping=follower.damping.si,
            preload=follower.preload.si,
            stem_stiffness=follower.stem_stiffness.si,
            restitution=follower.restitution.si,
        )

    @property
    def contact_time(self) -> float:
        """Duration of a landing's force pulse, s: half a period of the mass on the stem."""
        return math.pi * math.sqrt(self.mass / self.stem_stiffness)

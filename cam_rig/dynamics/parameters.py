"""The follower's numbers, in SI, as the models use them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cam_rig.errors import DynamicsError
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
        limits = {
            "mass": self.mass > 0.0,
            "spring_stiffness": self.spring_stiffness > 0.0,
            "stem_stiffness": self.stem_stiffness > 0.0,
            "damping": self.damping >= 0.0,
            "preload": self.preload >= 0.0,
            "restitution": 0.0 <= self.restitution < 1.0,
        }
        words = {"damping": "≥ 0", "preload": "≥ 0", "restitution": "in [0, 1)"}
        for name, good in limits.items():
            value = getattr(self, name)
            if not (good and math.isfinite(value)):
                limit = words.get(name, "> 0")
                raise DynamicsError(f"{name} is {value!r}; allowed: finite and {limit}")

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

"""The follower's numbers, in SI, as the models use them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cam_rig.dynamics.input_limits import require_number
from cam_rig.errors import ConfigError
from cam_rig.schema import RigConfig
from cam_rig.schema.quantity import Quantity


def si_or_none(number: Quantity | None) -> float | None:
    """The number in SI; None for one that a rig file leaves out."""
    return None if number is None else number.si


def told(name: str, value: float | None) -> float:
    """A number of the follower where it is used.

    Raises
    ------
    ConfigError : it is None
    """
    if value is None:
        raise ConfigError(f"follower.{name}: is missing; so add it to the rig's numbers")
    return value


@dataclass(frozen=True)
class FollowerParameters:
    """One mass on a closing spring, pressed on the cam.

    Parameters
    ----------
    mass : kg
    spring_stiffness : N/m, closing spring
    damping : N·s/m, follower to ground
    preload : N, spring and weight at zero lift
    stem_stiffness : N/m, what a landing compresses; None on a rig that does not tell it
    restitution : Newton's coefficient of a landing, 0 plastic; None as before
    """

    mass: float
    spring_stiffness: float
    damping: float
    preload: float
    stem_stiffness: float | None = None
    restitution: float | None = 0.0

    def __post_init__(self) -> None:
        words = {"damping": "≥ 0", "preload": "≥ 0", "restitution": "in [0, 1)"}
        for name, value in vars(self).items():
            if value is not None or name not in ("stem_stiffness", "restitution"):
                require_number(name, value, words.get(name, "> 0"))

    @classmethod
    def from_rig(cls, rig: RigConfig) -> FollowerParameters:
        """Take the numbers of a rig file; those that only some models need may be None."""
        follower = rig.follower
        return cls(
            mass=follower.mass.si,
            spring_stiffness=follower.spring_stiffness.si,
            damping=follower.damping.si,
            preload=follower.preload.si,
            stem_stiffness=si_or_none(follower.stem_stiffness),
            restitution=si_or_none(follower.restitution),
        )

    @classmethod
    def on_stem(cls, rig: RigConfig, by: str, instead: str = "") -> FollowerParameters:
        """Take the numbers of a rig file that has a stem, for what is named by ``by``.

        Raises
        ------
        ConfigError : it has none
        """
        rig.need("stem_stiffness", by, instead)
        return cls.from_rig(rig)

    @property
    def stem(self) -> float:
        """The stem's stiffness, N/m.

        Raises
        ------
        ConfigError : it is None
        """
        return told("stem_stiffness", self.stem_stiffness)

    @property
    def contact_time(self) -> float:
        """Duration of a landing's force pulse, s: half a period of the mass on the stem."""
        return math.pi * math.sqrt(self.mass / self.stem)

"""Lab sheets: what a student is asked for, and the set-ups that there are for it."""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from pathlib import Path

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import AnyFollower, find_jump, follower_of
from cam_rig.dynamics.jump.jump_speed import rigid_jump
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.files import shown
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import require_sprung
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import RPM

# The rig that readings are taken on: the file's own, or another that a name hides.

#: By which part the hidden rig's numbers may differ from those on the sheet, either way.
TOLERANCES = {"spring_stiffness": 0.08, "mass": 0.04, "preload": 0.15, "damping": 0.25}
#: A seed is part of a file's name.
SEED_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")


@dataclass(frozen=True)
class LabSetup:
    """One set-up by the sheet: spring (N/m), weight on the follower (kg), preload (N)."""

    spring_stiffness: float
    added_mass: float
    preload: float


def drawn(lab: str, seed: str, number: str, tolerance: float) -> float:
    """The factor on a number: in 1 ± ``tolerance``, evenly, the same for the same words.

    Examples
    --------
    >>> round(drawn("jump", "alpha", "mass", 0.04), 6)
    1.000891
    """
    data = hashlib.sha256(f"cam_rig\n{lab}\n{seed}\n{number}".encode()).digest()
    return 1.0 + tolerance * (2.0 * int.from_bytes(data[:8], "big") / (2**64 - 1) - 1.0)


def true_rig(rig: RigConfig, setup: LabSetup, lab: str, seed: str | None) -> RigConfig:
    """The sheet's rig as it is set up, with its true numbers; no seed: the sheet's own."""

    def factor(kind: str, which: float) -> float:
        if seed is None:
            return 1.0
        return drawn(lab, seed, f"{kind} {which:.6g}", TOLERANCES[kind])

    own = rig.follower
    numbers = {
        "spring_stiffness": setup.spring_stiffness
        * factor("spring_stiffness", setup.spring_stiffness),
        # the follower, and each weight, is a body of its own
        "mass": own.mass.si * factor("mass", 0.0)
        + setup.added_mass * factor("mass", setup.added_mass),
        "preload": setup.preload * factor("preload", setup.preload),
        "damping": own.damping.si * factor("damping", 0.0),
    }
    if own.stem_damping is not None:
        numbers["stem_damping"] = own.stem_damping.si * factor("damping", 1.0)
    return rig.with_follower(**numbers)


@dataclass(frozen=True)
class Lab:
    """The set-ups of a lab: springs and preloads as parts of the rig's own, masses in kg."""

    springs: tuple[float, ...]
    added_masses: tuple[float, ...]
    preloads: tuple[float, ...]


#: The labs that there are. The texts of a page have the task of each.
LABS = {"jump": Lab(springs=(0.75, 1.0, 1.5), added_masses=(0.0, 0.5, 1.0), preloads=(1.0, 2.0))}
#: The knob begins and ends at these parts of the least and the greatest speed that one expects.
KNOB_FROM, KNOB_TO = 0.5, 1.25


@dataclass(frozen=True)
class LabSheet:
    """A lab on one cam and one rig; ``seed`` names another one that is measured in truth."""

    name: str
    cam: CamConfig
    rig: RigConfig
    seed: str | None = None

    def __post_init__(self) -> None:
        if self.name not in LABS:
            like = did_you_mean(self.name, LABS)
            raise ConfigError(f"--lab: is {shown(self.name)}; allowed: {', '.join(LABS)}{like}")
        if self.seed is not None and not SEED_NAME.fullmatch(self.seed):
            raise ConfigError(
                f"--seed: is {shown(self.seed)}; allowed: a name of 1 to 40 letters, digits, - and "
                "_"
            )
        require_sprung(Path(self.cam.name), self.cam)

    @cached_property
    def law(self) -> Law:
        """The cam's."""
        return build_law(self.cam)

    @property
    def springs(self) -> list[float]:
        """Stiffness (N/m) of each spring, to three digits as a catalogue has it."""
        own = self.rig.follower.spring_stiffness.si
        return [float(f"{own * part:.3g}") for part in LABS[self.name].springs]

    @property
    def added_masses(self) -> list[float]:
        """Weights (kg) that can be put on the follower."""
        return list(LABS[self.name].added_masses)

    @property
    def preloads(self) -> list[float]:
        """Preloads (N), to three digits."""
        own = self.rig.follower.preload.si
        return [float(f"{own * part:.3g}") for part in LABS[self.name].preloads]

    @cached_property
    def setups(self) -> list[LabSetup]:
        """Every set-up that there is."""
        return [LabSetup(*n) for n in product(self.springs, self.added_masses, self.preloads)]

    def true_rig(self, setup: LabSetup) -> RigConfig:
        """The rig as it is set up, with the numbers that it has in truth."""
        return true_rig(self.rig, setup, self.name, self.seed)

    def jump_rpm(self, setup: LabSetup) -> float:
        """The true jump speed (rpm) of a set-up: the lowest at which the steady state is off."""
        return _jump_rpm(self.law, follower_of(self.true_rig(setup)))

    @cached_property
    def knob(self) -> tuple[float, float]:
        """Speeds (rpm) of the knob, by what one rigid mass with the sheet's numbers does."""
        found = [
            rigid_jump(
                self.law, FollowerParameters.from_rig(true_rig(self.rig, s, self.name, None))
            )
            for s in self.setups
        ]
        speeds = [speed / RPM for speed, _ in found]
        if not (min(speeds) > 1.0 and math.isfinite(max(speeds))):
            raise ConfigError(
                f"lab {self.name!r}: cam {self.cam.name!r} on rig {self.rig.name!r} has no jump "
                "speed; allowed: a cam on which contact is lost, and a rig with a preload"
            )
        return (
            10.0 * math.floor(0.1 * KNOB_FROM * min(speeds)),
            10.0 * math.ceil(0.1 * KNOB_TO * max(speeds)),
        )

    @cached_property
    def critical(self) -> tuple[float, float]:
        """Lift s (m) and s'' (m/rad²) where a rigid follower without damping leaves the cam first.

        There n² = (k s + preload) / (m |s''|), the textbook's line over (k s + preload) / m.
        """
        own = FollowerParameters.from_rig(self.rig)
        _, angle = rigid_jump(self.law, replace(own, damping=0.0))
        lift, _, bend = self.law.at(angle)
        return float(lift), float(bend)

    def load(self, setup: LabSetup) -> float:
        """What presses the follower on, over its mass: (k s + preload) / m by the sheet, m/s²."""
        lift, _ = self.critical
        mass = self.rig.follower.mass.si + setup.added_mass
        return (setup.spring_stiffness * lift + setup.preload) / mass


#: One for each set-up of some sheets.
@lru_cache(maxsize=256)
def _jump_rpm(law: Law, follower: AnyFollower) -> float:
    return find_jump(law, follower, None).rpm

"""The rig that readings are taken on: the file's own, or another that a name hides.

Each number is drawn evenly within its tolerance by a hash of lab, name and number: the same on
every machine, with every version of every library.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

from cam_rig.errors import ConfigError
from cam_rig.files import shown
from cam_rig.schema import RigConfig

#: By which part the hidden rig's numbers may differ from those on the sheet, either way.
TOLERANCES = {"spring_stiffness": 0.08, "mass": 0.04, "preload": 0.15, "damping": 0.25}
#: A seed is part of a file's name.
SEED_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")


@dataclass(frozen=True)
class LabSetup:
    """One set-up, by the numbers that stand on the sheet.

    Parameters
    ----------
    spring_stiffness : of the closing spring, N/m
    added_mass : of the weight on the follower, kg
    preload : N
    """

    spring_stiffness: float
    added_mass: float
    preload: float


def require_seed(seed: str) -> None:
    """Refuse a seed that is no name.

    Raises
    ------
    ConfigError : with what is allowed
    """
    if not SEED_NAME.fullmatch(seed):
        raise ConfigError(
            f"--seed: is {shown(seed)}; allowed: a name of 1 to 40 letters, digits, - and _"
        )


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
    """The rig as it is set up, with its true numbers.

    Parameters
    ----------
    rig : of the sheet
    seed : name of the hidden rig; None for the sheet's own numbers

    Raises
    ------
    ConfigError : a number out of range
    """

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

"""Follower models by name: functions that compute the motion of a follower on a cam.

`MODELS` contains them. Every model has the same function ``advance``, which computes the motion in
one interval of time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cam_rig.dynamics import elastic_stem, kinetostatic, one_mass, two_mass
from cam_rig.dynamics.free_masses import TWO_MASS_KEYS, TwoMassParameters
from cam_rig.dynamics.interval import (
    ANGLE_TOLERANCE,
    COLUMNS,
    Block,
    Event,
    FollowerState,
    Interval,
    Samples,
    wrap,
)
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.speed_ramp import Advance
from cam_rig.dynamics.torsional import model as torsional
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law
from cam_rig.schema import RigConfig


@dataclass(frozen=True)
class Model:
    """Model of the follower's motion, as a set of functions.

    Parameters
    ----------
    parameters : callable
        Function that returns the parameters of a rig. It raises a `ConfigError` if the rig does not
        have a number that the model needs.
    advance : callable
        Function of the law, the parameters, the state at the end of the previous interval (None at
        the start of a run), the interval and the sample rate (Hz). It returns the state at the end
        of the interval, and a `Block` with the samples and events of the interval.
    require : callable
        Function that raises a `DynamicsError` for a law that the model cannot solve (default: every
        law is allowed).
    lifts_off : bool
        True if the follower can leave the cam. A model that is False keeps the follower on the cam,
        with a negative contact force if contact would be lost (default: False).
    """

    parameters: Callable[[RigConfig], Any]
    advance: Advance[Any]
    require: Callable[[Law], None] = lambda _law: None
    lifts_off: bool = False


def _one_mass(rig: RigConfig) -> FollowerParameters:
    rig.need("restitution", "the model one_mass, which lands", "take the model kinetostatic")
    return FollowerParameters.from_rig(rig)


def _elastic_stem(rig: RigConfig) -> FollowerParameters:
    return FollowerParameters.on_stem(rig, "the model elastic_stem", "take the model kinetostatic")


def _two_mass(rig: RigConfig) -> TwoMassParameters:
    keys = ("restitution", *TWO_MASS_KEYS)
    rig.need_all(keys, "the model two_mass, which lands", "take the model kinetostatic")
    return TwoMassParameters.from_rig(rig)


#: Follower models by the name in scene files and commands.
MODELS: dict[str, Model] = {
    "kinetostatic": Model(FollowerParameters.from_rig, kinetostatic.advance, require_smooth),
    "one_mass": Model(_one_mass, one_mass.advance, lifts_off=True),
    "elastic_stem": Model(_elastic_stem, elastic_stem.advance),
    "two_mass": Model(_two_mass, two_mass.advance, lifts_off=True),
    "torsional": Model(torsional.from_rig, torsional.advance, require_smooth),
}

__all__ = [
    "ANGLE_TOLERANCE", "COLUMNS", "MODELS", "Advance", "Block", "Event", "FollowerParameters",
    "FollowerState", "Interval", "Model", "Samples", "TwoMassParameters", "wrap",
]  # fmt: skip

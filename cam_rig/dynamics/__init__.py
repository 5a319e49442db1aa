"""How the follower moves: models by name, all with the same ``advance``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cam_rig.dynamics import kinetostatic, one_mass, residual, separation_block, torsional_block
from cam_rig.dynamics.block import (
    COLUMNS,
    NS,
    Block,
    Event,
    FollowerState,
    Interval,
)
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.two_mass import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.laws.bernstein import FloatArray
from cam_rig.schema import RigConfig

Advance = Callable[[Law, Any, FollowerState | None, Interval, int], tuple[FollowerState, Block]]


@dataclass(frozen=True)
class Model:
    """A follower model: what it takes from a rig, and how it passes through an interval."""

    parameters: Callable[[RigConfig], Any]
    advance: Advance


MODELS: dict[str, Model] = {
    "kinetostatic": Model(FollowerParameters.from_rig, kinetostatic.advance),
    "one_mass": Model(FollowerParameters.from_rig, one_mass.advance),
    "residual": Model(FollowerParameters.from_rig, residual.advance),
    "separation": Model(TwoMassParameters.from_rig, separation_block.advance),
    "torsional": Model(torsional_block.from_rig, torsional_block.advance),
}

__all__ = [
    "COLUMNS",
    "MODELS",
    "NS",
    "Advance",
    "Block",
    "Event",
    "FloatArray",
    "FollowerParameters",
    "FollowerState",
    "Interval",
    "Model",
    "TwoMassParameters",
]

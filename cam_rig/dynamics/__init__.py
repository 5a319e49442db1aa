"""How the follower moves: models by name, all with the same ``advance``."""

from __future__ import annotations

from collections.abc import Callable

from cam_rig.dynamics import kinetostatic, one_mass
from cam_rig.dynamics.block import (
    COLUMNS,
    NS,
    Block,
    Event,
    FollowerState,
    Interval,
)
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.laws import Law
from cam_rig.laws.bernstein import FloatArray

Advance = Callable[
    [Law, FollowerParameters, FollowerState | None, Interval, int], tuple[FollowerState, Block]
]

MODELS: dict[str, Advance] = {
    "kinetostatic": kinetostatic.advance,
    "one_mass": one_mass.advance,
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
]

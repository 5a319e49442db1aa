"""Between which speeds vibration of a follower on its stem can be measured and means something."""

from __future__ import annotations

import math
from collections.abc import Iterable

from cam_rig.dynamics import FollowerParameters
from cam_rig.errors import DynamicsError
from cam_rig.units import RPM

#: A stem must swing this often in a turn, or what rings cannot be told from what follows the law.
SWINGS = 3.0
#: Slowest and fastest speed, rpm; below, a turn has more swings of the stem than can be sampled.
SLOWEST, FASTEST = 1.0, 1e5


def fastest(follower: FollowerParameters) -> float:
    """Up to which speed (rpm) ringing means something: the stem still swings `SWINGS` a turn."""
    stiffness = follower.spring_stiffness + follower.stem_stiffness
    return min(FASTEST, math.sqrt(stiffness / follower.mass) / SWINGS / RPM)


def require_speeds(follower: FollowerParameters, rpm: Iterable[float]) -> None:
    """Refuse speeds (rpm) that are too slow to sample, or too fast for the stem.

    Raises
    ------
    DynamicsError : with the first of them and the limits
    """
    most = fastest(follower)
    for speed in rpm:
        if not SLOWEST <= speed * (1.0 + 1e-12) <= most * (1.0 + 2e-12):
            raise DynamicsError(
                f"speed is {speed:g} rpm; allowed: {SLOWEST:g} to {most:.4g} rpm on this stem, "
                f"which must swing {SWINGS:g} times a turn"
            )

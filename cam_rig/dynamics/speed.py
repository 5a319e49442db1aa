"""The one condition every follower model puts on the cam's speed."""

from __future__ import annotations

import math

from cam_rig.errors import DynamicsError


def require_turning(speed: float) -> None:
    """Refuse a cam that stands, turns backwards, or at no number at all; ``speed`` in rad/s.

    Raises
    ------
    DynamicsError : with the speed
    """
    if not (math.isfinite(speed) and speed > 0.0):
        raise DynamicsError(f"speed is {speed!r} rad/s; allowed: finite and above 0")

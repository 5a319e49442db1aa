"""When a series of ever lower bounces is over: endless in the model, contact in the rig."""

from __future__ import annotations

from cam_rig.laws import Law

#: A bounce is contact when it is lower than this fraction of the lift, or than so many metres,
#: a hundred thousandth of an atom.
MIN_OF_LIFT, MIN_HEIGHT = 1e-12, 1e-15


def least_bounce(law: Law) -> float:
    """Height (m) below which a bounce is contact."""
    return max(MIN_OF_LIFT * law.lift, MIN_HEIGHT)


def rises(rebound: float, pull: float, least: float) -> bool:
    """Whether a rebound (m/s) against a deceleration (m/s²) comes higher than ``least`` (m)."""
    if rebound <= 0.0 or pull <= 0.0:
        return rebound > 0.0
    return 0.5 * rebound**2 / pull > least

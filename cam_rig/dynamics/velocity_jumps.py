"""Joints at which a law's velocity jumps: which of them an interval owns, and when it meets them.

A joint belongs to the interval that begins with it. Where it lies at the border of two, rounding of
the angle decides nothing: an interval from angle a to b owns the joints in [a − SLACK, b − SLACK),
so of two that meet exactly one owns it, and one that lies behind the start is met at once.
"""

from __future__ import annotations

import math
from itertools import count
from typing import NamedTuple

import numpy as np

from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.laws.law import TOLERANCE
from cam_rig.units import TURN

#: Rounding (rad) that the angle at a border of two intervals may have: given as one number with
#: its turns, up to 1e5 of them.
SLACK = 1e-9
#: Two events closer than this angle (rad) to each other are at one place.
SAME_PLACE = 1e-12


class VelocityJump(NamedTuple):
    """A joint ahead: ``time`` (s) to it, ``step`` of s' there in m/rad."""

    time: float
    step: float


def velocity_jumps_ahead(
    law: Law, angle: float, speed: float, duration: float
) -> tuple[VelocityJump, ...]:
    """The joints with a jump of s' that ``duration`` s from ``angle`` (rad) on own, in order."""
    if not law.velocity_jumps:
        return ()
    found: list[VelocityJump] = []
    # A substitute law has none but those that its ramp owns.
    slack = SLACK if law.repeats else 0.0
    end = speed * duration - slack
    first = math.floor(angle / TURN)
    for turn in count(first - 1) if law.repeats else (0,):
        for piece, step in law.velocity_jumps.items():
            ahead = law.joints[piece] + turn * TURN - angle
            if ahead >= end:
                return tuple(found)
            if ahead >= -slack:
                found.append(VelocityJump(_arrival(law, angle, speed, ahead, piece), step))
    return tuple(found)


def _arrival(law: Law, angle: float, speed: float, ahead: float, piece: int) -> float:
    """Time (s) at which the cam is at a joint, and by rounding not before it."""
    time = max(0.0, ahead) / speed
    for _ in range(8):
        at = angle + speed * time
        if law.piece(at - math.floor(at / TURN) * TURN) != (piece - 1) % law.spans.size:
            break
        time += math.ulp(at) / speed
    return time


def short_of_velocity_jump(law: Law, angle: float) -> float:
    """The angle (rad), or where a jump of s' belongs to what follows, the angle just before it."""
    if not (law.velocity_jumps and law.repeats):
        return angle
    turn = math.floor(angle / TURN + SLACK)
    for piece in law.velocity_jumps:
        joint = law.joints[piece] + turn * TURN
        if abs(joint - angle) <= SLACK:
            return joint - 4.0 * math.ulp(max(joint, TURN))
    return angle


#: What else there is for a law whose velocity jumps, where a model can be chosen.
OTHER_MODELS = (
    ", or one of the models elastic_stem, one_mass and two_mass, where it is an impact or lifts "
    "the follower off"
)


def require_continuous(law: Law) -> None:
    """Refuse a law whose lift itself jumps: no follower can be at two places at once."""
    if law.largest_step > TOLERANCE * float(np.abs(law.ordinates).max()):
        piece = int(np.abs(law.jumps(0)).argmax())
        raise DynamicsError(
            f"law {law.name!r}: lift jumps by {law.largest_step:.3g} m at "
            f"{math.degrees(law.joints[piece]):.3g}°; allowed: pieces that join, the last with "
            "the first"
        )


def require_smooth(law: Law, otherwise: str = OTHER_MODELS) -> None:
    """Refuse a law whose velocity jumps, an infinite force; ``otherwise`` is what is allowed."""
    require_continuous(law)
    if law.velocity_jumps:
        piece = max(law.velocity_jumps, key=lambda i: abs(law.velocity_jumps[i]))
        raise DynamicsError(
            f"law {law.name!r}: velocity jumps by {law.velocity_jumps[piece]:.3g} m/rad at "
            f"{math.degrees(law.joints[piece]):.3g}°, an infinite force in this model; allowed: "
            f"segments that join with one slope{otherwise}"
        )

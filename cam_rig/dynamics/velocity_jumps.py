"""Velocity jumps of a law: the jumps in an interval of the run, and their times.

A law has a velocity jump at a joint of two polynomial pieces if its slope s' changes there. A jump
at the border of two intervals belongs to the later one. An interval from cam angle a to b contains
the joints in [a − ε, b − ε), ε = `JOINT_ATOL_RAD`. Exactly one of two adjacent intervals contains
each joint, whatever the rounding of its angle. A joint before the start of its interval is passed
at time 0.
"""

from __future__ import annotations

import math
from itertools import count
from typing import NamedTuple

import numpy as np

from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.laws.law import JUMP_RTOL
from cam_rig.units import TURN

#: Largest rounding error of the cam angle at the border of two intervals, rad. It is that of an
#: angle of 1e5 turns that is stored in one float.
JOINT_ATOL_RAD = 1e-9
#: Largest difference of the cam angles (rad) of two events, for example a lift-off and a velocity
#: jump, that count as simultaneous.
SAME_ANGLE_RAD = 1e-12


class VelocityJump(NamedTuple):
    """Joint of the law, which the cam will pass, at which the slope s' jumps."""

    time: float  #: time at which the cam passes the joint, since the start of the interval, s
    step: float  #: change of s' at the joint, m/rad


def velocity_jumps_ahead(
    law: Law, angle: float, speed: float, duration: float
) -> tuple[VelocityJump, ...]:
    """Return the velocity jumps of a law in an interval, in the order of time.

    The interval starts at the cam angle ``angle`` (rad) and takes ``duration`` s at ``speed``
    rad/s. A jump at its end belongs to the next interval and is not included.
    """
    if not law.velocity_jumps:
        return ()
    jumps: list[VelocityJump] = []
    # A substitute law contains only the jumps of its ramp.
    slack = JOINT_ATOL_RAD if law.repeats else 0.0
    end = speed * duration - slack
    first = math.floor(angle / TURN)
    for turn in count(first - 1) if law.repeats else (0,):
        for piece, step in law.velocity_jumps.items():
            ahead = law.joints[piece] + turn * TURN - angle
            if ahead >= end:
                return tuple(jumps)
            if ahead >= -slack:
                jumps.append(VelocityJump(_arrival_time(law, angle, speed, ahead, piece), step))
    return tuple(jumps)


def _arrival_time(law: Law, angle: float, speed: float, ahead: float, piece: int) -> float:
    """Return the time (s) at which the cam reaches the joint at the start of a piece.

    ``ahead`` is the angle (rad) to the joint. The time is increased until the rounded cam angle is
    not before the joint.
    """
    time = max(0.0, ahead) / speed
    for _ in range(8):
        theta = angle + speed * time
        if law.piece(theta - math.floor(theta / TURN) * TURN) != (piece - 1) % law.spans.size:
            break
        time += math.ulp(theta) / speed
    return time


def step_before_velocity_jump(law: Law, angle: float) -> float:
    """Return a cam angle (rad), decreased slightly if the law's velocity jumps there.

    The motion at the end of an interval is evaluated at this angle. It is then the motion before
    the jump, because a jump there belongs to the next interval.
    """
    if not (law.velocity_jumps and law.repeats):
        return angle
    turn = math.floor(angle / TURN + JOINT_ATOL_RAD)
    for piece in law.velocity_jumps:
        joint = law.joints[piece] + turn * TURN
        if abs(joint - angle) <= JOINT_ATOL_RAD:
            return joint - 4.0 * math.ulp(max(joint, TURN))
    return angle


#: Remedy in the error message of `require_smooth`, if another model can be chosen.
OTHER_MODELS_REMEDY = (
    ", or one of the models elastic_stem, one_mass and two_mass, where it is an impact or lifts "
    "the follower off"
)


def require_continuous(law: Law) -> None:
    """Raise a `DynamicsError` if the lift of a law jumps, which no follower can do."""
    if law.largest_step > JUMP_RTOL * float(np.abs(law.ordinates).max()):
        piece = int(np.abs(law.jumps(0)).argmax())
        raise DynamicsError(
            f"law {law.name!r}: lift jumps by {law.largest_step:.3g} m at "
            f"{math.degrees(law.joints[piece]):.3g}°; allowed: pieces that join, the last with "
            "the first"
        )


def require_smooth(law: Law, otherwise: str = OTHER_MODELS_REMEDY) -> None:
    """Raise a `DynamicsError` if the velocity of a law jumps.

    A velocity jump needs an infinite force. ``otherwise`` is the remedy at the end of the message.
    """
    require_continuous(law)
    if law.velocity_jumps:
        piece = max(law.velocity_jumps, key=lambda i: abs(law.velocity_jumps[i]))
        raise DynamicsError(
            f"law {law.name!r}: velocity jumps by {law.velocity_jumps[piece]:.3g} m/rad at "
            f"{math.degrees(law.joints[piece]):.3g}°, an infinite force in this model; allowed: "
            f"segments that join with one slope{otherwise}"
        )

"""What ends contact in the one-mass model: the cam would have to pull the follower.

What ends a flight is the same for both models that leave the cam: `cam_rig.dynamics.landing`.
"""

from __future__ import annotations

import math

from cam_rig.dynamics.contact_force import loss_intervals
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.laws import Law
from cam_rig.units import TURN

#: Angle (rad) of a loss interval too short to lift anything but a rounding error.
GRAZE = 1e-9


def next_lift_off(
    law: Law, parameters: FollowerParameters, speed: float, angle: float, time: float
) -> float:
    """Time (s) of the next lift-off, infinity when the cam never has to pull.

    Parameters
    ----------
    speed : rad/s
    angle, time : cam angle (rad) and time (s) from which contact holds
    """
    losses = loss_intervals(law, parameters, speed)
    turn = math.floor(angle / TURN) * TURN
    for start, stop in (*losses, *((a + TURN, b + TURN) for a, b in losses)):
        if turn + stop - angle > GRAZE:
            return time + max(0.0, (turn + start - angle) / speed)
    return math.inf

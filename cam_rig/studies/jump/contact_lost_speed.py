"""The speed from which a model that holds the follower on the cam is no longer valid."""

from __future__ import annotations

import math

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.studies.jump.rigid import rigid_jump_speed
from cam_rig.studies.jump.search import SLOWEST, force_run, sought_speed
from cam_rig.units import RPM

#: Length of the run from rest, s, as in Table 2.
FROM_REST = 1.7


def contact_lost_speed(law: Law, rig: RigConfig) -> float:
    """Jump speed (rad/s) on a rig: 0 where contact is lost at any speed, ∞ where at none.

    That of two masses from rest, or of one rigid mass on a rig that does not say how they split.
    """
    if law.velocity_jumps:  # where the velocity jumps down the follower lifts off
        return 0.0
    follower = rig.follower
    if None in (follower.roller_share, follower.stem_stiffness, follower.stem_damping):
        rigid = FollowerParameters.from_rig(rig)
        return 0.0 if rigid.preload == 0.0 else rigid_jump_speed(law, rigid)
    parameters = TwoMassParameters.from_rig(rig)
    try:
        return sought_speed(law, parameters, FROM_REST)
    except DynamicsError:  # below the slowest speed that is looked at, or above the fastest
        slow = force_run(law, parameters, FROM_REST).lowest(SLOWEST * RPM)
        return 0.0 if slow <= 0.0 else math.inf

"""Jump speed on any rig: two masses if the rig splits its mass, else one rigid mass.

One mass does not vibrate. It loses contact at the speed where m s'' Ω² + c s' Ω + k s + preload = 0
(eq. 9 of the paper, F = 0), from rest as in steady state.
"""

from __future__ import annotations

import math

from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump, rigid_jump_speed, rigid_min_force
from cam_rig.dynamics.jump.two_masses import (
    FASTEST,
    FROM_REST,
    SLOWEST,
    Jump,
    find_jump_speed,
    find_two_mass_jump,
    force_run,
    keeps_contact,
    loses_contact,
    require_run,
)
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import RPM, FloatArray

#: Parameters of a follower that has a jump speed.
AnyFollower = TwoMassParameters | FollowerParameters

#: Description of a follower with two masses.
TWO_MASSES = "two masses"


def follower_of(rig: RigConfig) -> AnyFollower:
    """Return two masses; one if the rig has neither ``roller_share`` nor ``stem_damping``."""
    follower = rig.follower
    if follower.roller_share is None and follower.stem_damping is None:
        return FollowerParameters.from_rig(rig)
    return TwoMassParameters.from_rig(rig)


def described(parameters: AnyFollower) -> str:
    """Return the kind of follower as text."""
    return TWO_MASSES if isinstance(parameters, TwoMassParameters) else "one rigid mass"


def described_run(parameters: AnyFollower, duration: float | None) -> str:
    """Return follower and run as text: ``duration`` s from rest, or in steady state for None."""
    name = described(parameters)
    if name != TWO_MASSES:
        return f"{name}, from rest as in steady state"
    return f"{name}, in steady state" if duration is None else f"{name}, {duration:g} s from rest"


def find_jump(law: Law, parameters: AnyFollower, duration: float | None = FROM_REST) -> Jump:
    """Return the lowest speed at which contact is lost, and its first loss.

    The run takes ``duration`` s from rest, or is in steady state for None. One rigid mass does not
    vibrate, so its result does not depend on the duration.
    """
    if duration is not None:
        require_run(duration)
    require_smooth(law, "; where it falls contact is lost at any speed")
    if isinstance(parameters, TwoMassParameters):
        return find_two_mass_jump(law, parameters, duration)
    speed, angle = rigid_jump(law, parameters)
    if speed < SLOWEST * RPM:
        raise loses_contact(law)
    if speed > FASTEST * RPM:
        raise keeps_contact(law)
    return Jump(speed, angle, angle / speed)


def contact_lost_speed(law: Law, rig: RigConfig) -> float:
    """Return the jump speed (rad/s) on a rig, from rest.

    It is 0 if contact is lost at any speed, and infinite if it is lost at none.
    """
    if law.velocity_jumps:  # where the velocity jumps down the follower lifts off
        return 0.0
    follower = rig.follower
    if None in (follower.roller_share, follower.stem_stiffness, follower.stem_damping):
        return rigid_jump_speed(law, FollowerParameters.from_rig(rig))
    parameters = TwoMassParameters.from_rig(rig)
    try:
        return find_jump_speed(law, parameters, FROM_REST)
    except DynamicsError:  # below the slowest speed of the search, or above the fastest
        force = force_run(law, parameters, FROM_REST).min_output(SLOWEST * RPM)
        return 0.0 if force <= 0.0 else math.inf


def min_force(
    law: Law, parameters: AnyFollower, duration: float | None, speeds: FloatArray
) -> FloatArray:
    """Return the least contact force (N) of a run at speeds (rad/s), ``(n,)``.

    It is zero at the jump speed.
    """
    if isinstance(parameters, TwoMassParameters):
        return force_run(law, parameters, duration).min_outputs(speeds)
    return rigid_min_force(law, parameters, speeds)


# Jump speeds of a law on one rig, or on many rigs that differ in numbers of their follower.

"""Jump speed of a rig's follower, with two masses or with one rigid mass.

The jump speed is the lowest cam speed at which the follower loses contact. A rig has two masses if
its file divides the mass of the follower. One mass does not vibrate. It loses contact at the lowest
cam speed Ω with m s'' Ω² + c s' Ω + k s + preload = 0 (eq. 9 of the paper with F = 0), which is the
same from rest and in steady state.
"""

from __future__ import annotations

import math

from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump, rigid_jump_speed, rigid_min_force
from cam_rig.dynamics.jump.two_masses import (
    MAX_RPM,
    MIN_RPM,
    REST_DURATION_S,
    Jump,
    find_jump_speed,
    find_two_mass_jump,
    force_run,
    lost_contact_error,
    no_jump_error,
    require_run,
)
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import RPM, FloatArray

#: Parameters of a follower that may leave the cam: two masses, or one rigid mass.
AnyFollower = TwoMassParameters | FollowerParameters

#: Text of `describe_follower` for a follower with two masses.
TWO_MASSES = "two masses"


def follower_of(rig: RigConfig) -> AnyFollower:
    """Return the parameters of the follower of a rig: two masses, or one rigid mass.

    It is one mass if the rig has neither ``roller_share`` nor ``stem_damping``.

    Raises
    ------
    ConfigError
        If a number that the follower needs is missing.
    """
    follower = rig.follower
    if follower.roller_share is None and follower.stem_damping is None:
        return FollowerParameters.from_rig(rig)
    return TwoMassParameters.from_rig(rig)


def describe_follower(parameters: AnyFollower) -> str:
    """Return the kind of the follower as text: "one rigid mass" or `TWO_MASSES`."""
    return TWO_MASSES if isinstance(parameters, TwoMassParameters) else "one rigid mass"


def describe_run(parameters: AnyFollower, duration: float | None) -> str:
    """Return the kind of the follower and of the run as text, for a report.

    The run lasts ``duration`` s from rest. None means the steady state.
    """
    name = describe_follower(parameters)
    if name != TWO_MASSES:
        return f"{name}, from rest as in steady state"
    return f"{name}, in steady state" if duration is None else f"{name}, {duration:g} s from rest"


def find_jump(law: Law, parameters: AnyFollower, duration: float | None = REST_DURATION_S) -> Jump:
    """Return the jump speed of a follower on a law, and the first loss of contact.

    Parameters
    ----------
    law : Law
        Motion law of the cam.
    parameters : TwoMassParameters or FollowerParameters
        Two masses, or one rigid mass. The result of one mass does not depend on the duration.
    duration : float or None, optional
        Duration of the run from rest in s, at most 60 (default: 1.7, as in Table 2 of the paper),
        or None for the steady state.

    Raises
    ------
    ConfigError
        If the duration is not allowed.
    NoJumpSpeedError
        If contact is lost at every speed, or is kept at every speed.
    DynamicsError
        If the velocity of the law jumps, or the search cannot determine the jump speed.

    References
    ----------
    Two masses: eq. 14-19 of the paper. One rigid mass: eq. 9 of the paper.
    """
    if duration is not None:
        require_run(duration)
    require_smooth(law, "; contact is lost at any speed if the velocity jumps down")
    if isinstance(parameters, TwoMassParameters):
        return find_two_mass_jump(law, parameters, duration)
    speed, angle = rigid_jump(law, parameters)
    if speed < MIN_RPM * RPM:
        raise lost_contact_error(law)
    if speed > MAX_RPM * RPM:
        raise no_jump_error(law)
    return Jump(speed, angle, angle / speed)


def find_contact_loss_speed(law: Law, rig: RigConfig) -> float:
    """Return the jump speed (rad/s) of a rig's follower on a law, in a run from rest.

    It is 0 if contact is lost at every speed, also because the velocity of the law jumps. It is
    infinite if contact is kept at every speed. The run lasts `REST_DURATION_S`.
    """
    if law.velocity_jumps:  # the follower lifts off at a joint if the velocity jumps down
        return 0.0
    follower = rig.follower
    if None in (follower.roller_share, follower.stem_stiffness, follower.stem_damping):
        return rigid_jump_speed(law, FollowerParameters.from_rig(rig))
    parameters = TwoMassParameters.from_rig(rig)
    try:
        return find_jump_speed(law, parameters, REST_DURATION_S)
    except DynamicsError:  # the jump speed is outside the range of the search
        force = force_run(law, parameters, REST_DURATION_S).min_output(MIN_RPM * RPM)
        return 0.0 if force <= 0.0 else math.inf


def min_force(
    law: Law, parameters: AnyFollower, duration: float | None, speeds: FloatArray
) -> FloatArray:
    """Return the least contact force (N) of a run at each of n cam speeds, shape (n,).

    It is zero at the jump speed. ``speeds`` is in rad/s, shape (n,). The run lasts ``duration`` s
    from rest. None means the steady state.
    """
    if isinstance(parameters, TwoMassParameters):
        return force_run(law, parameters, duration).min_outputs(speeds)
    return rigid_min_force(law, parameters, speeds)

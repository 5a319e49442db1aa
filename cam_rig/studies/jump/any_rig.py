"""The jump speed on any rig: of two masses where the rig splits its mass, else of one rigid mass.

One mass does not vibrate: contact is lost where its inertia takes all of the spring's force,
m s'' Ω² + c s' Ω + k s + preload = 0 (eq. 9 of the paper, F = 0), from rest as in steady state.
"""

from __future__ import annotations

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.studies.jump.jump_speed import Jump, jump_speed, require_run
from cam_rig.studies.jump.rigid import rigid_jump, rigid_least
from cam_rig.studies.jump.search import (
    FASTEST,
    SLOWEST,
    force_run,
    keeps_contact,
    loses_contact,
)
from cam_rig.units import RPM

#: What a rig gives to a jump speed, and what each is called.
AnyFollower = TwoMassParameters | FollowerParameters
TWO_MASSES, ONE_MASS = "two masses", "one rigid mass"


def follower_of(rig: RigConfig) -> AnyFollower:
    """Two masses, or one where the rig has neither ``roller_share`` nor ``stem_damping``.

    Raises
    ------
    ConfigError : the rig has one of them, and not the other
    """
    follower = rig.follower
    if follower.roller_share is None and follower.stem_damping is None:
        return FollowerParameters.from_rig(rig)
    return TwoMassParameters.from_rig(rig)


def described(parameters: AnyFollower) -> str:
    """Which follower it is, in words."""
    return TWO_MASSES if isinstance(parameters, TwoMassParameters) else ONE_MASS


def described_run(parameters: AnyFollower, duration: float | None) -> str:
    """Which follower, and how it runs: ``duration`` s from rest, or in steady state for None.

    Examples
    --------
    >>> import cam_rig
    >>> described_run(follower_of(cam_rig.load_rig("paper_table2")), 1.7)
    'two masses, 1.7 s from rest'
    """
    name = described(parameters)
    if name == ONE_MASS:
        return f"{name}, from rest as in steady state"
    return f"{name}, in steady state" if duration is None else f"{name}, {duration:g} s from rest"


def find_jump(law: Law, parameters: AnyFollower, duration: float | None) -> Jump:
    """The lowest speed at which contact is lost.

    Parameters
    ----------
    duration : s of a run from rest at θ = 0; None for the steady state. One mass is the same in
        both; its time is that of the angle in the first turn

    Raises
    ------
    DynamicsError : contact is lost at every speed or at none; or no steady state

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    >>> follower = follower_of(cam_rig.load_rig("tm21"))
    >>> described(follower), round(find_jump(law, follower, None).rpm, 2)
    ('one rigid mass', 438.29)
    """
    if isinstance(parameters, TwoMassParameters):
        return jump_speed(law, parameters, duration)
    if duration is not None:
        require_run(duration)
    require_smooth(law, "; where it falls contact is lost at any speed")
    speed, angle = rigid_jump(law, parameters)
    if parameters.preload == 0.0 or speed < SLOWEST * RPM:
        raise loses_contact(law)
    if speed > FASTEST * RPM:
        raise keeps_contact(law)
    return Jump(speed, angle, angle / speed)


def least_force(
    law: Law, parameters: AnyFollower, duration: float | None, speeds: FloatArray
) -> FloatArray:
    """The least contact force (N) of a run at speeds (rad/s), ``(n,)``: zero at the jump speed."""
    if isinstance(parameters, TwoMassParameters):
        return force_run(law, parameters, duration).least(speeds)
    return rigid_least(law, parameters, speeds)

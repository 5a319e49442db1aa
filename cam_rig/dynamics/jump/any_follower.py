"""The jump speed on any rig: of two masses where the rig splits its mass, else of one rigid mass.

One mass does not vibrate: contact is lost where its inertia takes all of the spring's force,
m s'' Ω² + c s' Ω + k s + preload = 0 (eq. 9 of the paper, F = 0), from rest as in steady state.
"""

from __future__ import annotations

from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import jump_speed as jump_of_parameters
from cam_rig.dynamics.jump.jump_speed import require_run, rigid_jump, rigid_least
from cam_rig.dynamics.jump.search import (
    FASTEST,
    SLOWEST,
    Jump,
    force_run,
    keeps_contact,
    loses_contact,
)
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import RPM, FloatArray

#: What a rig gives to a jump speed, and what each is called.
AnyFollower = TwoMassParameters | FollowerParameters

TWO_MASSES = "two masses"


def follower_of(rig: RigConfig) -> AnyFollower:
    """Two masses, or one where the rig has neither ``roller_share`` nor ``stem_damping``."""
    follower = rig.follower
    if follower.roller_share is None and follower.stem_damping is None:
        return FollowerParameters.from_rig(rig)
    return TwoMassParameters.from_rig(rig)


def described(parameters: AnyFollower) -> str:
    """Which follower it is, in words."""
    return TWO_MASSES if isinstance(parameters, TwoMassParameters) else "one rigid mass"


def described_run(parameters: AnyFollower, duration: float | None) -> str:
    """Which follower, and how it runs: ``duration`` s from rest, or in steady state for None."""
    name = described(parameters)
    if name != TWO_MASSES:
        return f"{name}, from rest as in steady state"
    return f"{name}, in steady state" if duration is None else f"{name}, {duration:g} s from rest"


def find_jump(law: Law, parameters: AnyFollower, duration: float | None) -> Jump:
    """The lowest speed at which contact is lost, in ``duration`` s from rest or steady for None."""
    if isinstance(parameters, TwoMassParameters):
        return jump_of_parameters(law, parameters, duration)
    if duration is not None:
        require_run(duration)
    require_smooth(law, "; where it falls contact is lost at any speed")
    speed, angle = rigid_jump(law, parameters)
    if speed < SLOWEST * RPM:
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


# The jump speed of a law on a rig, or on many that differ in numbers of their follower.

"""The jump speed on any rig: of two masses where the rig splits its mass, else of one rigid mass.

One mass does not vibrate: contact is lost where its inertia takes all of the spring's force,
m s'' Ω² + c s' Ω + k s + preload = 0 (eq. 9 of the paper, F = 0), from rest as in steady state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

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
from cam_rig.dynamics.two_mass.masses import TwoMassParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import Column, Records, Result
from cam_rig.units import RPM, FloatArray


@dataclass(frozen=True, repr=False)
class JumpSpeed(Jump, Result):
    """A jump speed: ``rpm``, ``speed`` (rad/s), and where contact is lost.

    ``angle`` (rad of cam angle in its turn) and ``time`` (s, from rest or from the beginning of a
    turn) are those of the first lift-off. ``duration`` (s) is the run's; None is steady state.
    """

    schema = "cam_rig.jump_speed.1"
    drawn_by = "cam_rig.dynamics.jump.figures:figure"
    columns: ClassVar = {
        "jump_speed": (
            Column("cam", of="law.name"),
            Column("rpm", "rpm", ".2f", "jump speed"),
            Column("angle", "°", ".1f", "cam angle"),
            Column("time", "s", ".3f"),
        )
    }

    law: Law
    rig: RigConfig
    duration: float | None

    def tables(self) -> list[Records]:
        """One row."""
        caption = f"On rig {self.rig.name}: {described_run(follower_of(self.rig), self.duration)}"
        return [self.table("jump_speed", caption, [self], single=True)]

    def __repr__(self) -> str:
        """What and where, in rpm and degrees."""
        where = f"contact lost at {math.degrees(self.angle):.1f}° after {self.time:.3g} s"
        return f"JumpSpeed({self.law.name}: {self.rpm:.2f} rpm, {where})"


#: What a rig gives to a jump speed, and what each is called.
AnyFollower = TwoMassParameters | FollowerParameters

TWO_MASSES, ONE_MASS = "two masses", "one rigid mass"


def follower_of(rig: RigConfig) -> AnyFollower:
    """Two masses, or one where the rig has neither ``roller_share`` nor ``stem_damping``."""
    follower = rig.follower
    if follower.roller_share is None and follower.stem_damping is None:
        return FollowerParameters.from_rig(rig)
    return TwoMassParameters.from_rig(rig)


def described(parameters: AnyFollower) -> str:
    """Which follower it is, in words."""
    return TWO_MASSES if isinstance(parameters, TwoMassParameters) else ONE_MASS


def described_run(parameters: AnyFollower, duration: float | None) -> str:
    """Which follower, and how it runs: ``duration`` s from rest, or in steady state for None."""
    name = described(parameters)
    if name == ONE_MASS:
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

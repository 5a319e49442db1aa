"""What a bounce map goes over: the cam's speed; or, at one speed, a number of the follower."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.rigid_mass import rigid_jump
from cam_rig.dynamics.jump.two_masses import NoJumpSpeedError, force_run
from cam_rig.dynamics.kinetostatic import force_extremes
from cam_rig.laws import Law
from cam_rig.show.result import Column
from cam_rig.studies.bounce.motion import Bouncing
from cam_rig.units import RPM, to_rpm

#: What is swept: heading, unit as shown, what one of it is in SI.
SPEED, RESTITUTION, PRELOAD, MASS = "rpm", "restitution", "preload", "mass"
SWEPT = {
    SPEED: ("speed", "rpm", RPM),
    RESTITUTION: ("restitution", "", 1.0),
    PRELOAD: ("preload", "N", 1.0),
    MASS: ("mass", "kg", 1.0),
}


@dataclass(frozen=True)
class OperatingPoint:
    """A follower, and the cam's speed (rad/s)."""

    parameters: Bouncing
    speed: float

    @property
    def rpm(self) -> float:
        """The cam's speed, rpm: the number that was given, whose last digit rad/s round."""
        return float(f"{to_rpm(self.speed):.15g}")

    @property
    def restitution(self) -> float | None:
        """Of a landing."""
        return self.parameters.restitution

    @property
    def preload(self) -> float:
        """Of the return spring at zero lift, N."""
        return self.parameters.preload

    @property
    def mass(self) -> float:
        """Of the follower, kg; of two masses both."""
        p = self.parameters
        return p.roller_mass + p.end_mass if isinstance(p, TwoMassParameters) else p.mass


def point_columns(digits: str = ".6g") -> tuple[Column, ...]:
    """A column for each that may be swept; people see the one that is, by default the speed."""
    return tuple(
        Column(key, unit, digits, heading, of=f"point.{key}", hidden=key != SPEED)
        for key, (heading, unit, _) in SWEPT.items()
    )


@dataclass(frozen=True)
class Sweep:
    """What is swept, from an operating point on; its values are in SI, speeds in rad/s."""

    base: OperatingPoint
    over: str = SPEED

    def at(self, value: float) -> OperatingPoint:
        """Where what is swept has a value; a `DynamicsError` where it cannot."""
        if self.over == SPEED:
            return replace(self.base, speed=value)
        p = self.base.parameters
        numbers: dict[str, Any] = {self.over: value}
        if self.over == MASS and isinstance(p, TwoMassParameters):  # split as it was
            share = p.roller_mass / self.base.mass
            numbers = {"roller_mass": share * value, "end_mass": (1.0 - share) * value}
        return replace(self.base, parameters=replace(p, **numbers))

    def value(self, point: OperatingPoint) -> float:
        """What an operating point has of it."""
        return float(getattr(point, self.over)) if self.over != SPEED else point.speed

    def words(self, value: float) -> str:
        """A value as people read it: 418.803 rpm, or preload 12.75 N."""
        heading, unit, one = SWEPT[self.over]
        name = "" if self.over == SPEED else f"{heading} "
        return f"{name}{value / one:.6g} {unit}".strip()

    def size(self, value: float) -> float:
        """By which changes of it are measured."""
        return 1.0 if self.over == RESTITUTION else value or 1.0

    def lift_off(self, law: Law, values: Sequence[float]) -> float:
        """The value at which settled contact is first lost; among some that rise, but for a speed.

        It is 0 where a velocity jump of the cam throws the follower at any, and NaN where contact
        is lost, or kept, at all of them.
        """
        if law.velocity_jumps:
            return 0.0 if self.over == SPEED else math.nan
        p = self.base.parameters
        if self.over == SPEED:
            if not isinstance(p, TwoMassParameters):
                return rigid_jump(law, p)[0]
            try:
                return find_jump(law, p, None).speed
            except NoJumpSpeedError as none:
                return none.speed
        found = [self._least_force(law, value) for value in values]
        for i in np.flatnonzero(np.diff(np.sign(found))).tolist():
            ends = values[i], values[i + 1]
            return float(brentq(lambda value: self._least_force(law, value), *ends, xtol=1e-15))
        return math.nan

    def _least_force(self, law: Law, value: float) -> float:
        point = self.at(value)
        if isinstance(point.parameters, TwoMassParameters):
            return force_run(law, point.parameters, None).min_output(point.speed)
        return force_extremes(law, point.parameters, point.speed)[0]

"""Quantity that a bounce map varies: the cam speed, or a number of the follower.

The number of the follower is its restitution, preload or mass, at one cam speed.
"""

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

#: Key of the cam speed as the swept quantity.
SPEED = "rpm"
#: Key of the restitution as the swept quantity.
RESTITUTION = "restitution"
#: Key of the preload as the swept quantity.
PRELOAD = "preload"
#: Key of the mass as the swept quantity.
MASS = "mass"
#: Heading, displayed unit, and size of this unit in SI, of each quantity that can be swept.
SWEPT = {
    SPEED: ("speed", "rpm", RPM),
    RESTITUTION: ("restitution", "", 1.0),
    PRELOAD: ("preload", "N", 1.0),
    MASS: ("mass", "kg", 1.0),
}


@dataclass(frozen=True)
class OperatingPoint:
    """Follower parameters and cam speed (rad/s) of one run."""

    parameters: Bouncing
    speed: float

    @property
    def rpm(self) -> float:
        """Cam speed in rpm, rounded to 15 digits.

        The conversion from rad/s preserves this number of digits.
        """
        return float(f"{to_rpm(self.speed):.15g}")

    @property
    def restitution(self) -> float | None:
        """Coefficient of restitution of a landing, None if the rig does not define it."""
        return self.parameters.restitution

    @property
    def preload(self) -> float:
        """Force (N) of the return spring at zero lift."""
        return self.parameters.preload

    @property
    def mass(self) -> float:
        """Mass (kg) of the follower, the sum of both masses in the two-mass model."""
        p = self.parameters
        return p.roller_mass + p.end_mass if isinstance(p, TwoMassParameters) else p.mass


def point_columns(digits: str = ".6g") -> tuple[Column, ...]:
    """Return table columns for speed, restitution, preload and mass of a run.

    Only the column of the speed is displayed by default. ``digits`` is the number format.
    """
    return tuple(
        Column(key, unit, digits, heading, of=f"point.{key}", hidden=key != SPEED)
        for key, (heading, unit, _) in SWEPT.items()
    )


@dataclass(frozen=True)
class Sweep:
    """Quantity that a bounce map varies, together with all fixed quantities.

    ``parameter`` is the key of the varied quantity. ``base`` contains the follower and the cam
    speed, in which the varied quantity is replaced.
    """

    base: OperatingPoint
    parameter: str = SPEED

    def at(self, value: float) -> OperatingPoint:
        """Return the follower and cam speed at a value of the swept quantity.

        The value is in SI, a speed in rad/s.

        Raises
        ------
        DynamicsError
            If the value is invalid.
        """
        if self.parameter == SPEED:
            return replace(self.base, speed=value)
        p = self.base.parameters
        numbers: dict[str, Any] = {self.parameter: value}
        if self.parameter == MASS and isinstance(
            p, TwoMassParameters
        ):  # the ratio of the two masses is kept
            share = p.roller_mass / self.base.mass
            numbers = {"roller_mass": share * value, "end_mass": (1.0 - share) * value}
        return replace(self.base, parameters=replace(p, **numbers))

    def value(self, point: OperatingPoint) -> float:
        """Return the value (SI) of the swept quantity at an operating point."""
        return float(getattr(point, self.parameter)) if self.parameter != SPEED else point.speed

    def words(self, value: float) -> str:
        """Return a value of the swept quantity as text, such as ``preload 12.75 N``."""
        heading, unit, factor = SWEPT[self.parameter]
        name = "" if self.parameter == SPEED else f"{heading} "
        return f"{name}{value / factor:.6g} {unit}".strip()

    def size(self, value: float) -> float:
        """Return the scale (SI) by which changes of the swept quantity are divided.

        It is 1 for the restitution, else the given value (1 if the value is 0).
        """
        return 1.0 if self.parameter == RESTITUTION else value or 1.0

    def lift_off(self, law: Law, values: Sequence[float]) -> float:
        """Return the value of the swept quantity (SI) at which contact is first lost.

        Below it the motion is steady and in contact. For the cam speed it is the jump speed,
        computed exactly. For another swept quantity, ``values`` (SI, rising) are searched for the
        first change from contact to loss of contact. The result is 0 if the law's velocity has a
        jump, so that the follower is thrown off at any speed. It is NaN if contact is lost, or
        kept, at all values.
        """
        if law.velocity_jumps:
            return 0.0 if self.parameter == SPEED else math.nan
        p = self.base.parameters
        if self.parameter == SPEED:
            if not isinstance(p, TwoMassParameters):
                return rigid_jump(law, p)[0]
            try:
                return find_jump(law, p, None).speed
            except NoJumpSpeedError as error:
                return error.speed
        forces = [self._least_force(law, value) for value in values]
        for i in np.flatnonzero(np.diff(np.sign(forces))).tolist():
            ends = values[i], values[i + 1]
            return float(brentq(lambda value: self._least_force(law, value), *ends, xtol=1e-15))
        return math.nan

    def _least_force(self, law: Law, value: float) -> float:
        point = self.at(value)
        if isinstance(point.parameters, TwoMassParameters):
            return force_run(law, point.parameters, None).min_output(point.speed)
        return force_extremes(law, point.parameters, point.speed)[0]

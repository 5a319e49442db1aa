"""The quantities of a law that a design or a campaign may ask for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from cam_rig.units import RPM

Sense = Literal["<=", ">="]


@dataclass(frozen=True)
class DesignQuantity:
    """A quantity of a law.

    Parameters
    ----------
    title : in words
    unit : of tables and pictures
    units : unit of a request to SI
    where : what it is taken at: a speed or an angle, a range of them, an event's number, or nothing
    senses : the limits that can be kept; a goal minimises where ``<=`` is, else maximises
    goal : whether it may be one
    below : what a limit on it has to be less than, SI
    """

    title: str
    unit: str
    units: dict[str, float]
    where: Literal["", "rpm", "deg", "event"] = ""
    senses: tuple[Sense, ...] = ("<=",)
    goal: bool = True
    below: float = math.inf

    @property
    def shown(self) -> float:
        """One of ``unit`` in SI."""
        return self.units[self.unit]


def _per_rad(power: int) -> dict[str, float]:
    over = "/rad" if power == 1 else f"/rad^{power}"
    return {f"mm{over}": 1e-3, f"m{over}": 1.0, f"um{over}": 1e-6}


_LENGTH = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "µm": 1e-6, "cm": 1e-2}
_FORCE, SPEED_UNITS = {"N": 1.0, "kN": 1e3}, {"rpm": RPM, "rad/s": 1.0}
ANGLE_UNITS = {"deg": math.pi / 180.0, "rad": 1.0}
_TORQUE = {"N*m": 1.0, "Nm": 1.0, "N·m": 1.0, "mN*m": 1e-3}
_BOTH: tuple[Sense, ...] = ("<=", ">=")
QUANTITIES = {
    "jump_speed": DesignQuantity("jump speed from rest", "rpm", SPEED_UNITS, senses=(">=",)),
    "jump_speed_steady": DesignQuantity(
        "jump speed in steady state", "rpm", SPEED_UNITS, senses=(">=",)
    ),
    "jump_speed_rigid": DesignQuantity(
        "jump speed of one rigid mass", "rpm", SPEED_UNITS, senses=(">=",)
    ),
    "residual_vibration": DesignQuantity("residual vibration of one event", "um", _LENGTH, "rpm"),
    "peak_velocity": DesignQuantity("peak |s′|", "mm/rad", _per_rad(1)),
    "peak_acceleration": DesignQuantity("peak |s″|", "mm/rad^2", _per_rad(2)),
    "peak_jerk": DesignQuantity("peak |s‴|", "mm/rad^3", _per_rad(3)),
    "rms_acceleration": DesignQuantity("r.m.s. of s″", "mm/rad^2", _per_rad(2)),
    "peak_contact_force_rigid": DesignQuantity(
        "peak contact force of one rigid mass", "N", _FORCE, "rpm"
    ),
    "least_contact_force_rigid": DesignQuantity(
        "least contact force of one rigid mass", "N", _FORCE, "rpm", (">=",)
    ),
    "shaft_torque": DesignQuantity("peak |shaft torque|", "N*m", _TORQUE, "rpm"),
    "sound_level_rigid": DesignQuantity("sound level of one rigid mass", "dB", {"dB": 1.0}, "rpm"),
    "sound_level_with_jumps": DesignQuantity(
        "sound level with landings, mean power over speeds", "dB", {"dB": 1.0}, "rpm"
    ),
    "pressure_angle": DesignQuantity("pressure angle", "deg", ANGLE_UNITS, below=0.5 * math.pi),
    "radius_of_curvature": DesignQuantity(
        "least radius of curvature", "mm", _LENGTH, senses=(">=",)
    ),
    "event_angle": DesignQuantity(
        "span of event", "deg", ANGLE_UNITS, "event", _BOTH, goal=False, below=2.0 * math.pi
    ),
    "lift": DesignQuantity("lift", "mm", _LENGTH, "deg", _BOTH, goal=False),
    "velocity": DesignQuantity("s′", "mm/rad", _per_rad(1), "deg", _BOTH, goal=False),
    "acceleration": DesignQuantity("s″", "mm/rad^2", _per_rad(2), "deg", _BOTH, goal=False),
}
#: Quantities of either sign, or zero.
SIGNED = (
    "lift",
    "velocity",
    "acceleration",
    "least_contact_force",
    "least_contact_force_rigid",
    "sound_level",
    "sound_level_rigid",
    "sound_level_with_jumps",
    "lift_offs",
)
#: What `velocity`, ... are the derivatives of.
ORDERS = {"lift": 0, "velocity": 1, "acceleration": 2}

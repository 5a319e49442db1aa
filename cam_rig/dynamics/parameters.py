"""What a model may be given, in SI; all else is refused here, by name and limit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any, TypeGuard

import numpy as np

from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws.law import MAX_ANGLE
from cam_rig.schema import RigConfig
from cam_rig.schema.quantity import Quantity
from cam_rig.units import FloatArray

#: A number above zero is between these, one of either sign no farther from zero, all in SI.
LEAST, MOST = 1e-15, 1e15
#: Slowest and fastest cam, rad/s.
MIN_SPEED, MAX_SPEED = 1e-30, 1e9
#: Largest damping ratio of a rig's stem or shaft (assumed): one of a larger is rigid, and its
#: motion a polynomial in ever shorter windows.
MAX_DAMPING_RATIO = 10.0
#: What a number may be, by the words that say so.
LIMITS = {
    "> 0": (LEAST, MOST),
    "≥ 0": (0.0, MOST),
    "of either sign": (-MOST, MOST),
    "in [0, 1)": (0.0, math.nextafter(1.0, 0.0)),
}


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a finite real number."""
    return isinstance(value, (float, Real)) and math.isfinite(value)  # a float is told at once


def require_number(name: str, value: object, words: str) -> None:
    """Refuse what is not a finite number within the `LIMITS` of its ``words``."""
    low, high = LIMITS[words]
    if not (is_number(value) and low <= value <= high):
        limits = "" if words == "in [0, 1)" else f", {low:g} to {high:g}"
        raise DynamicsError(f"{name} is {value!r}; allowed: finite and {words}{limits}")


#: What a number of a follower or a shaft may be that need not be above zero.
NOT_ABOVE_ZERO = dict.fromkeys(("damping", "stem_damping", "shaft_damping", "preload"), "≥ 0")
NOT_ABOVE_ZERO |= {"restitution": "in [0, 1)", "motor_torque": "of either sign"}


def floats_of(numbers: Mapping[str, Any], *optional: str) -> dict[str, float | None]:
    """Numbers as floats, the first out of its limits refused; those ``optional`` may be None.

    Whole numbers would make integer matrices, and have the event search compiled once more.
    """
    for name, value in numbers.items():
        if value is not None or name not in optional:
            require_number(name, value, NOT_ABOVE_ZERO.get(name, "> 0"))
    return {name: None if value is None else float(value) for name, value in numbers.items()}


def require_angle(angle: object, name: str = "angle") -> None:
    """Refuse a cam angle (rad) that is not finite, or so large that its phase is lost."""
    if not (is_number(angle) and abs(angle) <= MAX_ANGLE):
        raise DynamicsError(
            f"{name} is {angle!r}; allowed: finite and up to {MAX_ANGLE:g} rad, beyond which "
            "the phase is lost"
        )


def require_turning(speed: object) -> None:
    """Refuse a cam that stands, turns backwards, or at no number at all; ``speed`` in rad/s."""
    if not (is_number(speed) and MIN_SPEED <= speed <= MAX_SPEED):
        raise DynamicsError(
            f"speed is {speed!r} rad/s; allowed: finite and above 0, "
            f"{MIN_SPEED:g} to {MAX_SPEED:g} rad/s"
        )


def row_of_numbers(name: str, values: object) -> FloatArray:
    """One row of finite numbers."""
    try:
        row = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise DynamicsError(f"{name} is {values!r}; allowed: a row of finite numbers") from None
    if row.ndim != 1 or not np.isfinite(row).all():
        wrong = row[~np.isfinite(row)] if row.ndim == 1 else row
        raise DynamicsError(f"{name}: has {wrong!r}; allowed: a row of finite numbers")
    return row


def state_of(values: object, size: int) -> FloatArray:
    """A model's state, ``(size,)``."""
    state = row_of_numbers("state", values)
    if state.size != size:
        raise DynamicsError(f"state: has {state.size} numbers; allowed: {size}")
    return state


def times_of(values: object, last: float = MOST) -> FloatArray:
    """Ascending times (s) from 0 to ``last``."""
    times = row_of_numbers("times", values)
    if times.size == 0:
        return times
    if np.any(times[1:] < times[:-1]):
        at = int(np.argmax(times[1:] < times[:-1]))
        raise DynamicsError(
            f"times: {times[at + 1]:.9g} s comes after {times[at]:.9g} s; allowed: ascending"
        )
    if times[0] < 0.0 or times[-1] > last:
        raise DynamicsError(
            f"times are {times[0]:.9g} to {times[-1]:.9g} s; allowed: 0 to {last:.9g} s"
        )
    return times


def si_or_none(number: Quantity | None) -> float | None:
    """The number in SI; None for one that a rig file leaves out."""
    return None if number is None else number.si


def told(name: str, value: float | None) -> float:
    """A number of the follower where it is used."""
    if value is None:
        raise ConfigError(f"follower.{name}: is missing; so add it to the rig's numbers")
    return value


@dataclass(frozen=True)
class FollowerParameters:
    """One mass on a closing spring, pressed on the cam."""

    mass: float  #: kg
    spring_stiffness: float  #: N/m, closing spring
    damping: float  #: N·s/m, follower to ground
    preload: float  #: N, spring and weight at zero lift
    #: N/m, what a landing compresses; None on a rig that does not tell it
    stem_stiffness: float | None = None
    restitution: float | None = 0.0  #: Newton's coefficient of a landing, 0 plastic; None as before

    def __post_init__(self) -> None:
        vars(self).update(floats_of(vars(self), "stem_stiffness", "restitution"))

    @classmethod
    def from_rig(cls, rig: RigConfig) -> FollowerParameters:
        """Take the numbers of a rig file; those that only some models need may be None."""
        follower = rig.follower
        return cls(
            mass=follower.mass.si,
            spring_stiffness=follower.spring_stiffness.si,
            damping=follower.damping.si,
            preload=follower.preload.si,
            stem_stiffness=si_or_none(follower.stem_stiffness),
            restitution=si_or_none(follower.restitution),
        )

    @classmethod
    def on_stem(cls, rig: RigConfig, by: str, instead: str = "") -> FollowerParameters:
        """Take the numbers of a rig file that must have a stem, for what is named by ``by``."""
        rig.need("stem_stiffness", by, instead)
        return cls.from_rig(rig)

    @property
    def stem(self) -> float:
        """The stem's stiffness, N/m; refused where it is None."""
        return told("stem_stiffness", self.stem_stiffness)

    @property
    def contact_time(self) -> float:
        """Duration of a landing's force pulse, s: half a period of the mass on the stem."""
        return math.pi * math.sqrt(self.mass / self.stem)

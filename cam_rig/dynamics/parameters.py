"""Parameters of the follower models in SI, and the checks of all model inputs.

Each check raises a `DynamicsError` with the name, the value and the limit of the input.
"""

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

#: Smallest parameter (SI) that is accepted if it must be positive.
MIN_POSITIVE = 1e-15
#: Largest absolute value of a parameter (SI) that is accepted.
MAX_NUMBER = 1e15
#: Lowest cam speed that is accepted, rad/s.
MIN_SPEED = 1e-30
#: Highest cam speed that is accepted, rad/s.
MAX_SPEED = 1e9
#: Largest accepted damping ratio of a rig's stem or shaft (assumed). A stem or shaft with a larger
#: ratio is practically rigid, and its motion would need ever shorter intervals of the solution.
MAX_DAMPING_RATIO = 10.0
#: Smallest and largest accepted number (SI) of each rule for a model input. The key, for example ">
#: 0", is the name of the rule and part of the error message.
LIMITS = {
    "> 0": (MIN_POSITIVE, MAX_NUMBER),
    "≥ 0": (0.0, MAX_NUMBER),
    "of either sign": (-MAX_NUMBER, MAX_NUMBER),
    "in [0, 1)": (0.0, math.nextafter(1.0, 0.0)),
}


def is_number(value: object) -> TypeGuard[float]:
    """Return True if a value is a finite real number."""
    # `float` first, because the abstract class `Real` is slow to check.
    return isinstance(value, (float, Real)) and math.isfinite(value)


def require_number(name: str, value: object, rule: str) -> None:
    """Raise a `DynamicsError` if a value violates a rule of `LIMITS`."""
    low, high = LIMITS[rule]
    if not (is_number(value) and low <= value <= high):
        limits = "" if rule == "in [0, 1)" else f", {low:g} to {high:g}"
        raise DynamicsError(f"{name} is {value!r}; allowed: finite and {rule}{limits}")


#: Rule of `LIMITS` for the numbers of a follower or a shaft that may be 0, by name. All other
#: numbers must be > 0.
RULES = dict.fromkeys(("damping", "stem_damping", "shaft_damping", "preload"), "≥ 0")
RULES |= {"restitution": "in [0, 1)", "motor_torque": "of either sign"}


def check_numbers(numbers: Mapping[str, Any], *optional: str) -> dict[str, float | None]:
    """Return the numbers of a follower or a shaft as floats, after a check of their limits.

    ``numbers`` are values (SI) by name. Numbers whose name is in ``optional`` may be None. Integers
    are converted, because they would make integer matrices, and numba would compile the event
    search once more for them.

    Raises
    ------
    DynamicsError
        If a number is not finite or outside its limits.
    """
    for name, value in numbers.items():
        if value is not None or name not in optional:
            require_number(name, value, RULES.get(name, "> 0"))
    return {name: None if value is None else float(value) for name, value in numbers.items()}


def require_angle(angle: object, name: str = "angle") -> None:
    """Raise a `DynamicsError` if a cam angle (rad) is not finite or above `MAX_ANGLE`.

    Above `MAX_ANGLE` the rounding of the angle is too large for the phase to be known.
    """
    if not (is_number(angle) and abs(angle) <= MAX_ANGLE):
        raise DynamicsError(
            f"{name} is {angle!r}; allowed: finite and up to {MAX_ANGLE:g} rad, beyond which "
            "the phase is lost"
        )


def require_turning(speed: object) -> None:
    """Raise a `DynamicsError` if a speed (rad/s) is not positive and within limits."""
    if not (is_number(speed) and MIN_SPEED <= speed <= MAX_SPEED):
        raise DynamicsError(
            f"speed is {speed!r} rad/s; allowed: finite and above 0, "
            f"{MIN_SPEED:g} to {MAX_SPEED:g} rad/s"
        )


def check_row(name: str, values: object) -> FloatArray:
    """Return a one-dimensional model input as an array of finite numbers, ``(n,)``.

    ``name`` is the name of the input in the error message.

    Raises
    ------
    DynamicsError
        If the values are not a one-dimensional sequence of finite numbers.
    """
    try:
        row = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise DynamicsError(f"{name} is {values!r}; allowed: a row of finite numbers") from None
    if row.ndim != 1 or not np.isfinite(row).all():
        wrong = row[~np.isfinite(row)] if row.ndim == 1 else row
        raise DynamicsError(f"{name}: has {wrong!r}; allowed: a row of finite numbers")
    return row


def check_state(values: object, size: int) -> FloatArray:
    """Return the state of a model as an array of finite numbers, ``(size,)``.

    Raises
    ------
    DynamicsError
        If the values are not ``size`` finite numbers.
    """
    state = check_row("state", values)
    if state.size != size:
        raise DynamicsError(f"state: has {state.size} numbers; allowed: {size}")
    return state


def check_times(values: object, last: float = MAX_NUMBER) -> FloatArray:
    """Return ascending times (s) between 0 and ``last`` as an array, ``(n,)``.

    Raises
    ------
    DynamicsError
        If a time is not finite or out of range, or the times do not ascend.
    """
    times = check_row("times", values)
    if times.size == 0:
        return times
    if np.any(times[1:] < times[:-1]):
        i = int(np.argmax(times[1:] < times[:-1]))
        raise DynamicsError(
            f"times: {times[i + 1]:.9g} s comes after {times[i]:.9g} s; allowed: ascending"
        )
    if times[0] < 0.0 or times[-1] > last:
        raise DynamicsError(
            f"times are {times[0]:.9g} to {times[-1]:.9g} s; allowed: 0 to {last:.9g} s"
        )
    return times


def si_or_none(number: Quantity | None) -> float | None:
    """Return the SI value of a number of a rig file, or None if the number is missing."""
    return None if number is None else number.si


def require_parameter(name: str, value: float | None) -> float:
    """Return a number of the follower, after a check that the rig file contains it.

    ``name`` is its key in the rig file.

    Raises
    ------
    ConfigError
        If the value is None.
    """
    if value is None:
        raise ConfigError(f"follower.{name}: is missing; add it to the numbers of the rig")
    return value


@dataclass(frozen=True)
class FollowerParameters:
    """Follower with one mass on a closing spring, pressed on the cam.

    Whole numbers are converted to floats.

    Parameters
    ----------
    mass : float
        Mass of the follower, kg, > 0.
    spring_stiffness : float
        Stiffness of the closing spring, N/m, > 0.
    damping : float
        Damping between follower and ground, N·s/m, ≥ 0.
    preload : float
        Force of spring and weight at zero lift, N, ≥ 0.
    stem_stiffness : float, optional
        Stiffness of the stem, which a landing compresses, N/m, > 0. None if the rig file does not
        contain it (default).
    restitution : float, optional
        Newton's coefficient of a landing, in [0, 1). 0 is a plastic landing (default), None if the
        rig file does not contain it.

    Raises
    ------
    DynamicsError
        If a number is not finite or outside its limits.
    """

    mass: float  #: mass of the follower, kg
    spring_stiffness: float  #: stiffness of the closing spring, N/m
    damping: float  #: damping between follower and ground, N·s/m
    preload: float  #: force of spring and weight at zero lift, N
    stem_stiffness: float | None = None  #: stiffness of the stem, N/m, or None
    restitution: float | None = 0.0  #: Newton's coefficient of a landing, or None

    def __post_init__(self) -> None:
        vars(self).update(check_numbers(vars(self), "stem_stiffness", "restitution"))

    @classmethod
    def from_rig(cls, rig: RigConfig) -> FollowerParameters:
        """Return the parameters of the follower of a rig, in SI.

        Numbers that only some models need may be None.
        """
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
        """Return the parameters of a rig that must have a stem stiffness.

        Parameters
        ----------
        rig : RigConfig
            The rig.
        by : str
            Name of the model or measure that needs the stem, for the error message.
        instead : str
            Remedy for the error message (default: empty).

        Raises
        ------
        ConfigError
            If the rig does not have a stem stiffness.
        """
        rig.need("stem_stiffness", by, instead)
        return cls.from_rig(rig)

    @property
    def stem(self) -> float:
        """Stiffness of the stem, N/m.

        Raises
        ------
        ConfigError
            If it is None.
        """
        return require_parameter("stem_stiffness", self.stem_stiffness)

    @property
    def contact_time(self) -> float:
        """Duration of the force pulse of a landing on the stem, s.

        It is half a period of the mass on the stem, π √(m/k_stem).
        """
        return math.pi * math.sqrt(self.mass / self.stem)

"""Jump speed of a law on one rig, or on many rigs that differ in their follower."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, overload

import numpy as np

from cam_rig.arguments import check_arguments, to_vector
from cam_rig.dynamics.free_masses import NEEDED_BY, ONE_MASS, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import describe_run, find_jump, follower_of
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S, Jump
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws.law import Law
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.rig import RigConfig
from cam_rig.show.result import Column, Records, Result
from cam_rig.simulation.inputs import LawOrCam, RequiredRig, resolve_law, resolve_rig
from cam_rig.units import FloatArray


@dataclass(frozen=True, repr=False)
class JumpSpeed(Jump, Result):
    """Jump speed of a law on a rig, with the first lift-off.

    The jump speed is ``rpm``, or ``speed`` in rad/s. ``angle`` (cam angle in its turn, rad) and
    ``time`` (since rest or since the start of a turn, s) are those of the first lift-off.
    ``duration`` is that of the run in s, or None in steady state. ``standard_error`` is that of the
    jump speed in rpm, or None without standard errors of the rig's numbers.
    """

    schema = "cam_rig.jump_speed.1"
    plot_function = "cam_rig.studies.jump.figures:jump_speed_figure"
    columns: ClassVar = {
        "jump_speed": (
            Column("cam", of="law.name"),
            Column("rpm", "rpm", ".2f", "jump speed"),
            Column("standard_error", "rpm", ".2f"),
            Column("angle", "°", ".1f", "cam angle"),
            Column("time", "s", ".3f"),
        )
    }

    law: Law
    rig: RigConfig
    duration: float | None
    standard_error: float | None = None

    def tables(self) -> list[Records]:
        """Return the table with the jump speed in its only row."""
        caption = f"On rig {self.rig.name}: {describe_run(follower_of(self.rig), self.duration)}"
        return [self.table("jump_speed", caption, [self], single=True)]

    def __repr__(self) -> str:
        """Return the law, its jump speed in rpm and the lift-off angle in degrees as text."""
        lift_off = f"contact lost at {math.degrees(self.angle):.1f}° after {self.time:.3g} s"
        error = "" if self.standard_error is None else f" ± {self.standard_error:.2g}"
        return f"JumpSpeed({self.law.name}: {self.rpm:.2f}{error} rpm, {lift_off})"


@dataclass(frozen=True)
class RigJump:
    """Jump speed on one of many rigs, with the parameters of its follower.

    `rpm`, `angle` and `time` are NaN if there is no jump speed. `reason` then states why.
    """

    mass: float  #: Mass of the follower, kg.
    spring_stiffness: float  #: Stiffness of the closing spring, N/m.
    damping: float  #: Damping between the end mass and ground, N·s/m.
    preload: float  #: Preload of the closing spring, N.
    rpm: float  #: Jump speed, rpm.
    angle: float  #: Cam angle of the first lift-off within the turn, rad.
    time: float  #: Time of the first lift-off, s.
    reason: str  #: Reason for a missing jump speed, empty if there is one.


@dataclass(frozen=True, repr=False)
class JumpSpeeds(Result):
    """Jump speeds of one law on many rigs, one element of ``rows`` per rig.

    ``duration`` is that of the runs in s, or None in steady state.
    """

    schema = "cam_rig.jump_speeds.1"
    columns: ClassVar = {
        "jump_speeds": (
            Column("mass", "kg", ".4g"),
            Column("spring_stiffness", "N/m", ".5g", "spring"),
            Column("damping", "N·s/m", ".4g"),
            Column("preload", "N", ".4g"),
            Column("rpm", "rpm", ".2f", "jump speed"),
            Column("angle", "°", ".1f", "cam angle"),
            Column("time", "s", ".3f"),
            Column("reason", doc="why there is no jump speed; else empty"),
        )
    }

    law: Law
    rig: RigConfig
    duration: float | None
    rows: tuple[RigJump, ...]

    @property
    def rpm(self) -> FloatArray:
        """Jump speeds in rpm, shape (n,), NaN for a rig without jump speed."""
        return np.array([row.rpm for row in self.rows])

    def tables(self) -> list[Records]:
        """Return the table of jump speeds, with one row per rig."""
        run = describe_run(follower_of(self.rig), self.duration)
        caption = f"{self.law.name} on rigs as {self.rig.name}: {run}"
        return [self.table("jump_speeds", caption, self.rows)]

    def __repr__(self) -> str:
        """Return the law, the number of jump speeds and their range as text."""
        speeds = self.rpm[np.isfinite(self.rpm)]
        span = f", {speeds.min():.2f} to {speeds.max():.2f} rpm" if speeds.size else ""
        return f"JumpSpeeds({self.law.name}: {speeds.size} of {len(self.rows)} rigs{span})"


#: Type of an argument with a parameter of the follower in SI units: one value for all rigs, an
#: array with one value per rig, or None for the value of the rig file.
Numbers = FloatArray | float | None


@overload
def jump_speed(
    law: LawOrCam,
    rig: RequiredRig,
    *,
    duration: float | None = ...,
    standard_errors: Mapping[str, float] | None = ...,
) -> JumpSpeed: ...


@overload
def jump_speed(
    law: LawOrCam,
    rig: RequiredRig,
    *,
    duration: float | None = ...,
    mass: Numbers = ...,
    spring_stiffness: Numbers = ...,
    damping: Numbers = ...,
    preload: Numbers = ...,
) -> JumpSpeeds: ...


@check_arguments
def jump_speed(
    law: LawOrCam,
    rig: RequiredRig,
    *,
    duration: float | None = REST_DURATION_S,
    mass: Numbers = None,
    spring_stiffness: Numbers = None,
    damping: Numbers = None,
    preload: Numbers = None,
    standard_errors: Mapping[str, float] | None = None,
) -> JumpSpeed | JumpSpeeds:
    """Find the lowest speed at which the follower loses contact.

    The follower has two masses if the rig contains their split, else one rigid mass, which does not
    vibrate. If parameters of the follower are given as arrays, the result has one row per rig. Each
    row is bitwise equal to the result for that rig alone. The computation takes about a second for
    a hundred rigs.

    Parameters
    ----------
    law : Law, Cam, str or Path
        Motion law, or a cam: its name in ``config/cams``, its path, or the object.
    rig : Rig, str or Path
        Rig: its name in ``config/rigs``, its path, or the object. It has two masses if it contains
        ``roller_share`` and ``stem_damping``, else one.
    duration : float or None
        Duration in s of runs from rest at cam angle 0 at constant speed, to 60 s. None for the
        steady state (default: 1.7 s).
    mass, spring_stiffness, damping, preload : ndarray or float, optional
        Numbers of the follower in kg, N/m, N·s/m and N, shape (n,), or one number for all rigs
        (default: the rig's number).
    standard_errors : mapping of str to float, optional
        Standard errors of independent numbers of the follower in SI units, such as
        ``{"mass": 0.004, "preload": 0.3}``. The result then contains the standard error of the jump
        speed, to first order. It cannot be combined with arrays.

    Returns
    -------
    JumpSpeed or JumpSpeeds
        Jump speed of the rig, or of each rig if a number of the follower is given.

    Raises
    ------
    ConfigError
        An argument has another type, the rig has only one of the two numbers, the arrays have
        different lengths, the duration is above 60 s, or a standard error is not that of a number
        of the rig.
    DynamicsError
        Contact is lost or kept at every speed, or a steady state does not exist. With arrays the
        row of the rig contains the reason instead.

    Examples
    --------
    >>> import cam_rig, numpy as np
    >>> round(cam_rig.jump_speed("poly345", "paper_table2").rpm, 2)
    413.44
    >>> preloads = np.array([20.0, 30.6, 45.0])
    >>> cam_rig.jump_speed("poly345", "paper_table2", preload=preloads).rpm.round(1).tolist()
    [344.9, 413.4, 417.2]
    >>> cam_rig.jump_speed("poly345", "tm21", standard_errors={"mass": 0.01, "preload": 0.5})
    JumpSpeed(poly345: 438.29 ± 1.7 rpm, contact lost at 241.2° after 0.0917 s)
    """
    law, rig = resolve_law(law), resolve_rig(rig, law)
    numbers = {
        "mass": mass,
        "spring_stiffness": spring_stiffness,
        "damping": damping,
        "preload": preload,
    }
    changed = {name: value for name, value in numbers.items() if value is not None}
    if changed and standard_errors:
        raise ConfigError(f"standard_errors cannot be combined with {', '.join(changed)}")
    if changed:
        return _jump_speeds(law, rig, duration, changed)
    jump = find_jump(law, follower_of(rig), duration)
    error = None if not standard_errors else _standard_error(law, rig, duration, standard_errors)
    return JumpSpeed(jump.speed, jump.angle, jump.time, law, rig, duration, error)


#: Step of a difference quotient, as a fraction of the standard error of the number. The jump speed
#: is computed to 1e-9 or better.
STEP_RATIO = 0.01


def _standard_error(
    law: Law, rig: RigConfig, duration: float | None, errors: Mapping[str, float]
) -> float:
    """Return the standard error (rpm) of the jump speed: √Σ(∂n/∂x · error of x)².

    The derivatives are central difference quotients.
    """
    changes = []
    for name, error in errors.items():
        number = getattr(rig.follower, name, None)
        if not isinstance(number, Quantity) or not 0.0 <= error < math.inf:
            known = ", ".join(key for key, value in rig.follower if value is not None)
            raise ConfigError(
                f"standard_errors must be numbers of at least 0 by the keys {known}, "
                f"got {name}: {error:g}"
            )
        step = STEP_RATIO * error
        if step == 0.0:
            continue
        low, high = (
            find_jump(law, follower_of(rig.with_follower(**{name: value})), duration).rpm
            for value in (max(number.si - step, 0.0), number.si + step)
        )
        changes.append((high - low) / (step + min(step, number.si)) * error)
    return math.hypot(*changes)


def _jump_speeds(
    law: Law, rig: RigConfig, duration: float | None, numbers: Mapping[str, FloatArray | float]
) -> JumpSpeeds:
    """Return the jump speed of each rig, with the follower's parameters ``numbers``.

    ``numbers`` are values or arrays in SI by name. Raises ConfigError for arrays of different
    length.
    """
    columns = [to_vector(name, x) for name, x in numbers.items()]
    try:
        arrays = np.broadcast_arrays(*columns)
    except ValueError:
        sizes = ", ".join(f"{name} {np.size(x)}" for name, x in numbers.items())
        raise ConfigError(f"the arrays must have the same size, got {sizes}") from None
    rows = []
    for values in zip(*(array.tolist() for array in arrays), strict=True):
        rows.append(_rig_jump(law, rig, duration, dict(zip(numbers, values, strict=True))))
    return JumpSpeeds(law, rig, duration, tuple(rows))


def _rig_jump(
    law: Law, rig: RigConfig, duration: float | None, changed: dict[str, float]
) -> RigJump:
    """Return the jump speed of a rig with some parameters of its follower replaced.

    ``changed`` are the new values in SI by name. If there is no jump speed, the result contains the
    reason.
    """
    base = follower_of(rig)
    defaults = {x: getattr(base, x) for x in ("spring_stiffness", "damping", "preload")}
    displayed = {"mass": rig.follower.mass.si, **defaults, **changed}
    numbers = dict[str, Any](changed)
    if "mass" in numbers and isinstance(base, TwoMassParameters):
        roller = numbers.pop("mass") * rig.need("roller_share", NEEDED_BY, ONE_MASS).si
        numbers |= {"roller_mass": roller, "end_mass": changed["mass"] - roller}
    try:
        jump = find_jump(law, replace(base, **numbers), duration)
    except CamRigError as error:
        return RigJump(**displayed, rpm=math.nan, angle=math.nan, time=math.nan, reason=str(error))
    return RigJump(**displayed, rpm=jump.rpm, angle=jump.angle, time=jump.time, reason="")

"""Parameters of a follower in a fit: limits, search variables, and the follower."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import ConfigError
from cam_rig.units import FloatArray

Follower = FollowerParameters | TwoMassParameters


@dataclass(frozen=True)
class ParameterLimits:
    """Unit and limits of a follower parameter in a rig file.

    ``low`` and ``high`` are the smallest and largest allowed values in ``unit``. ``logarithm`` is
    True if the search variable of a fit is the logarithm of the value.
    """

    unit: str
    low: float
    high: float
    logarithm: bool = False


#: Unit and limits of each parameter of a follower, by its key in a rig file. The limits only
#: exclude values that would overflow. They are far outside the values of any real follower.
PARAMETERS = {
    "mass": ParameterLimits("kg", 1e-6, 1e6, logarithm=True),
    "spring_stiffness": ParameterLimits("N/m", 1e-6, 1e12, logarithm=True),
    "preload": ParameterLimits("N", 0.0, 1e9),
    "damping": ParameterLimits("N*s/m", 0.0, 1e9),
    "restitution": ParameterLimits("1", 0.0, 0.95),
    "stem_stiffness": ParameterLimits("N/m", 1.0, 1e15, logarithm=True),
    "roller_share": ParameterLimits("1", 0.01, 0.99),
    "stem_damping": ParameterLimits("N*s/m", 0.0, 1e9),
}
#: Rig-file keys of the parameters of a follower with one rigid mass.
ONE_MASS = ("mass", "spring_stiffness", "preload", "damping", "restitution")
#: Rig-file keys of the parameters of a follower with two masses and an elastic stem between them.
TWO_MASSES = (*ONE_MASS, "stem_stiffness", "roller_share", "stem_damping")
#: Rig-file keys of the parameters that only a follower with two masses has.
TWO_MASS_ONLY = ("roller_share", "stem_damping")


def check_fixed(fixed: Mapping[str, float], model: str | None) -> None:
    """Raise a `ConfigError` if a fixed parameter value is not allowed.

    ``fixed`` are values in SI by rig-file key. A value must be within the limits of `PARAMETERS`.
    The keys of `TWO_MASS_ONLY` require ``model`` to be two_mass.
    """
    for name, value in fixed.items():
        limits = PARAMETERS[name]
        if not limits.low <= value <= limits.high:
            raise ConfigError(
                f"{name} must be between {limits.low:g} and {limits.high:g} {limits.unit}, got "
                f"{value:g}"
            )
    for name in TWO_MASS_ONLY:
        if name in fixed and model != "two_mass":
            raise ConfigError(f"{name} requires two masses and a stem; use --model two_mass")


def build_follower(values: dict[str, float], stem_stiffness: float | None) -> Follower:
    """Return the follower with the given parameter values in SI.

    The keys of ``values`` are those of a rig file. The follower has two masses if they contain
    ``roller_share``, otherwise one. ``stem_stiffness`` (N/m) is used for one mass only. There it
    affects only the force pulse of a landing.
    """
    common = {name: values[name] for name in ("damping", "preload", "restitution")}
    mass, spring_stiffness = values["mass"], values["spring_stiffness"]
    if "roller_share" not in values:
        return FollowerParameters(
            mass=mass,
            spring_stiffness=spring_stiffness,
            stem_stiffness=stem_stiffness,
            **common,
        )
    roller_mass = values["roller_share"] * mass
    return TwoMassParameters(
        roller_mass=roller_mass,
        end_mass=mass - roller_mass,
        stem_stiffness=values["stem_stiffness"],
        spring_stiffness=spring_stiffness,
        stem_damping=values["stem_damping"],
        **common,
    )


def to_search(name: str, value: float) -> float:
    """Convert a parameter value (SI) to its search variable in a fit.

    This is the logarithm of the value if `PARAMETERS` sets ``logarithm``, otherwise the value
    itself.
    """
    return float(np.log(value)) if PARAMETERS[name].logarithm else value


def from_search(names: Iterable[str], x: FloatArray) -> dict[str, float]:
    """Return parameter values (SI) by name for the search variables of a fit.

    ``x`` has the shape ``(n,)`` for n names, or is longer. The variables after the first n are
    ignored.
    """
    pairs = zip(names, x.tolist(), strict=False)
    return {n: float(np.exp(v)) if PARAMETERS[n].logarithm else v for n, v in pairs}


def parameter_slope(name: str, value: float) -> float:
    """Return the derivative of a parameter value with respect to its search variable.

    It converts a standard error of the search variable to one of the value. ``value`` is in SI.
    """
    return value if PARAMETERS[name].logarithm else 1.0


def search_limits(names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper limits of search variables, ``(n,)`` each.

    ``names`` are the n parameters.
    """
    low = [to_search(name, PARAMETERS[name].low) for name in names]
    return np.array(low), np.array([to_search(name, PARAMETERS[name].high) for name in names])


def search_scale(name: str, x: float) -> float:
    """Return the scale of a search variable.

    The steps of difference quotients are relative to it. ``x`` is the value of the search variable.
    """
    return 1.0 if PARAMETERS[name].logarithm else max(abs(x), 1.0)

"""The numbers of a cam, a rig and a scene by their paths, and the configs with other numbers.

Paths are as the files have them: ``rig.follower.mass``, ``cam.segments[1].span``,
``scene.sample_rate``; and `PROFILE` for the errors of a manufactured cam.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.schema.explain import explain
from cam_rig.schema.quantity import ORIGINS, UNITS, Quantity
from cam_rig.schema.segments.base import quantities
from cam_rig.schema.studies.campaign import PERCENT, Variation

Config = TypeVar("Config", bound=BaseModel)
#: Errors of a manufactured cam, with the dimension of each: see `profile_errors`.
PROFILE = {
    "profile.size": "length",
    "profile.eccentricity.amplitude": "length",
    "profile.eccentricity.phase": "angle",
    "profile.waviness.amplitude": "length",
    "profile.waviness.wavelength": "angle",
    "profile.waviness.phase": "angle",
}
_TOKEN = re.compile(r"[A-Za-z_]\w*|\[\d+\]")
#: SI unit of a dimension: the one with the factor 1.
_SI = {
    dimension: next(u for u, f in units.items() if f == 1.0) for dimension, units in UNITS.items()
}


@dataclass(frozen=True)
class CampaignInput:
    """One number that varies: its path, the base's number (SI) and its dimension."""

    path: str
    base: float
    dimension: str
    variation: Variation

    @property
    def si_unit(self) -> str:
        """Unit of the number in rows."""
        return _SI[self.dimension]

    @property
    def column(self) -> str:
        """Its column in a dataset, a plain name: ``rig_follower_mass``."""
        return re.sub(r"\W+", "_", self.path).strip("_")

    @property
    def factor(self) -> float:
        """What one of the variation's unit is in SI: of the base's number where it is relative."""
        if self.variation.unit == PERCENT:
            return 0.01 * abs(self.base)
        return UNITS[self.dimension][self.variation.unit]

    @property
    def origin(self) -> float:
        """What the variation's numbers count from, SI: zero, or the base's number for percents."""
        return self.base if self.variation.unit == PERCENT else 0.0

    @property
    def mean(self) -> float:
        """Of a distribution, SI."""
        own = self.variation.mean
        return self.base if own is None else own * self.factor


def paths_of(configs: Mapping[str, BaseModel]) -> dict[str, tuple[float, str]]:
    """Every number that can vary, SI, with its dimension; a list's numbers one by one."""
    found: dict[str, tuple[float, str]] = {path: (0.0, kind) for path, kind in PROFILE.items()}
    for name, config in configs.items():
        for path, number in quantities(config, f"{name}."):
            dimension = next(key for key, units in UNITS.items() if number.unit in units)
            if isinstance(number.raw, list):
                for i, value in enumerate(number.si_list):
                    found[f"{path}[{i}]"] = value, dimension
            else:
                found[path] = number.si, dimension
    return found


def input_of(
    path: str, variation: Variation, known: Mapping[str, tuple[float, str]]
) -> CampaignInput:
    """One input, checked against the base.

    Raises
    ------
    ConfigError : no such number, or a unit of another dimension
    """
    if path not in known:
        roots = sorted({key.split(".")[0] for key in known})
        hint = _hint(path, known)
        raise ConfigError(
            f"vary.{path}: the base has no such number{hint}; allowed: a number of "
            f"{', '.join(roots)} by its path, such as rig.follower.preload"
        )
    base, dimension = known[path]
    if variation.unit == PERCENT:
        if base == 0.0:
            raise ConfigError(f"vary.{path}: is 0 in the base; allowed: a unit, and no percents")
    elif variation.unit not in UNITS[dimension]:
        article = "an" if dimension[0] in "aeiou" else "a"
        raise ConfigError(
            f"vary.{path}: has unit {variation.unit!r}, not {article} {dimension}; allowed: %, "
            f"{', '.join(UNITS[dimension])}"
        )
    return CampaignInput(path, base, dimension, variation)


def _hint(path: str, known: Mapping[str, object]) -> str:
    """The number that a path goes beyond, or those it stops short of; else the likeliest."""
    beyond = [key for key in known if path.startswith(f"{key}.")]
    short = [key for key in known if key.startswith(f"{path}.")]
    if len(found := beyond or short) > 1:
        return f" (did you mean one of {', '.join(found)}?)"
    return did_you_mean(found[0] if found else path, known)


def with_numbers(config: Config, numbers: Mapping[str, float]) -> Config:
    """A config with other numbers (SI) by their paths below it.

    Raises
    ------
    ConfigError : a number that the config may not have
    """
    if not numbers:
        return config
    data = config.model_dump(exclude_none=True)
    for path, value in numbers.items():
        _put(data, _TOKEN.findall(path), value)
    try:
        return type(config).model_validate(data)
    except ValidationError as error:
        raise ConfigError(explain(error, type(config))) from None


def _put(node: Any, tokens: list[str], value: float) -> None:
    """Put a number (SI) where a path leads; what is on the way is this config's own copy."""
    for token in tokens:
        if isinstance(node, dict) and "unit" in node and token.startswith("["):
            break
        node = node[int(token[1:-1])] if token.startswith("[") else node[token]
    origin = next(key for key in ORIGINS if key in node)
    factor = Quantity(**{"assumed": 0.0, "unit": node["unit"]}).factor
    if isinstance(node[origin], list):
        node[origin] = copy.copy(node[origin])
        node[origin][int(tokens[-1][1:-1])] = value / factor
    else:
        node[origin] = value / factor

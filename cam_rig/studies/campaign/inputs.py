"""The numbers of a cam, a rig and a scene by their paths, and the configs with other numbers.

Paths are as the files have them: ``rig.follower.mass``, ``cam.segments[1].span``,
``scene.sample_rate``; and `PROFILE` for the errors of a manufactured cam.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.laws import Law, bernstein
from cam_rig.schema.explain import validated
from cam_rig.schema.quantity import FACTORS, ORIGINS, UNITS
from cam_rig.schema.segment_base import quantities
from cam_rig.studies.campaign.schema import PERCENT, Variation
from cam_rig.units import TURN, FloatArray

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

    @property
    def endless(self) -> bool:
        """Whether its distribution has no ends."""
        return self.variation.normal is not None and self.variation.within is None


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
    """One input, checked against the base."""
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
    """A config with other numbers (SI) by their paths below it."""
    if not numbers:
        return config
    data = _own(config)
    for path, value in numbers.items():
        _put(data, _TOKEN.findall(path), value)
    return validated(type(config), data)


def _own(node: Any) -> Any:
    """A list, or the fields of a model, to be changed; what they hold stays as it is."""
    if isinstance(node, list):
        return list(node)
    return {key: one for key, one in dict(node).items() if one is not None}


def _put(node: Any, tokens: list[str], value: float) -> None:
    """Put a number (SI) where a path leads; what is on the way becomes this config's own copy."""
    for token in tokens:
        if isinstance(node, dict) and "unit" in node and token.startswith("["):
            break
        key = int(token[1:-1]) if token.startswith("[") else token
        node[key] = node = _own(node[key])
    origin, factor = next(key for key in ORIGINS if key in node), FACTORS[node["unit"]]
    if isinstance(node[origin], list):
        node[origin] = list(node[origin])
        node[origin][int(tokens[-1][1:-1])] = value / factor
    else:
        node[origin] = value / factor


# Errors of a manufactured cam, added to its law as a piecewise polynomial.

#: Pieces of a wave.
PER_WAVE = 12
#: A wave closes the turn over so many wavelengths, at the turn's end.
CLOSING_WAVES = 2.0
#: Shortest wavelength, rad (0.1°), and longest (a turn).
SHORTEST, LONGEST = TURN / 3600.0, TURN
#: Degree of the pieces that carry sines.
DEGREE = 5
#: Ordinates of the step 35 t⁴ − 84 t⁵ + 70 t⁶ − 20 t⁷ and of its slope and curvature.
_STEP = np.array([35.0, -84.0, 70.0, -20.0])


def require_wavelength(wavelength: float) -> None:
    """Refuse a wavelength (rad) that cannot be followed."""
    if not SHORTEST * (1.0 - 1e-9) <= wavelength <= LONGEST * (1.0 + 1e-9):
        raise ConfigError(
            f"profile.waviness.wavelength: is {math.degrees(wavelength):.6g} deg; allowed: "
            f"{math.degrees(SHORTEST):.6g} to {math.degrees(LONGEST):.6g} deg"
        )


@dataclass(frozen=True)
class ProfileErrors:
    """Errors of one cam: lengths in m, angles in rad of cam angle; a phase is that at θ = 0."""

    size: float = 0.0
    eccentricity: float = 0.0
    eccentricity_phase: float = 0.0
    waviness: float = 0.0
    wavelength: float | None = None
    waviness_phase: float = 0.0

    @classmethod
    def of(cls, numbers: Mapping[str, float]) -> ProfileErrors:
        """From numbers (SI) by their paths below ``profile``."""
        own = {path.replace(".amplitude", "").replace(".", "_"): x for path, x in numbers.items()}
        if (wavelength := own.pop("waviness_wavelength", None)) is not None:
            require_wavelength(wavelength)
        return cls(**own, wavelength=wavelength)

    @property
    def _step(self) -> float:
        """Longest piece, rad."""
        waves = [TURN] if self.eccentricity else []
        waves += [self.wavelength] if self.waviness and self.wavelength else []
        return min(waves, default=math.inf) / PER_WAVE

    def added_to(self, law: Law) -> Law:
        """The law with the errors, of degree 5 at least.

        Its pieces are cut into equal parts, `PER_WAVE` of a wave at least, and each part takes the
        quintic with the error's value, slope and curvature at both its ends: C2 at every joint, and
        the error itself but for |Δs| ≤ h⁶ M/46080 and |Δs''| ≤ h⁴ M/1920, M its largest sixth
        derivative (Birkhoff and Priver 1967). Of a wave a sin kθ that is 4.5e-7 a, and 3.9e-5 of
        its a k²; in the closing up to five times as much. The law itself is kept exactly.
        """
        if not (self.eccentricity or self.waviness):
            ordinates = law.ordinates + self.size if self.size else law.ordinates
            return Law(law.name, law.breaks, ordinates)
        counts = np.ceil(law.spans / self._step * (1.0 - 1e-12)).astype(int)
        own, breaks = bernstein.cut(law.ordinates, law.breaks, counts)
        degree = max(DEGREE, law.degree)
        ordinates = bernstein.elevate(own, degree) + self.ordinates(breaks, degree)
        return Law(law.name, breaks, ordinates)

    def at(self, angle: FloatArray) -> FloatArray:
        """Value (m), slope (m/rad) and curvature (m/rad²) of the errors at cam angles, (3, n).

        A wave that goes into the turn a whole number of times is a sine all around. Any other
        would step at the turn's end: over the last two wavelengths it passes smoothly (C3) into
        the sine that began a turn ahead, a blend no larger than either.
        """
        found = np.zeros((3, angle.size))
        if self.eccentricity:
            found += _sine(self.eccentricity, TURN, self.eccentricity_phase, angle)
        found[0] += self.size
        if self.waviness and self.wavelength:
            found += self._wave(angle, self.wavelength)
        return found

    def _wave(self, angle: FloatArray, wavelength: float) -> FloatArray:
        closing = min(CLOSING_WAVES * wavelength, TURN)
        found = _sine(self.waviness, wavelength, self.waviness_phase, angle)
        blended = angle > TURN - closing
        own, angle = found[:, blended], angle[blended]
        ahead = _sine(self.waviness, wavelength, self.waviness_phase, angle - TURN)
        t = np.clip((angle - (TURN - closing)) / closing, 0.0, 1.0)
        powers = np.stack([t**k for k in range(2, 8)])
        step = _STEP @ powers[2:]
        slope = (_STEP * [4, 5, 6, 7]) @ powers[1:5] / closing
        curvature = (_STEP * [12, 20, 30, 42]) @ powers[:4] / closing**2
        gap = ahead - own
        own[0] += step * gap[0]
        own[1] += step * gap[1] + slope * gap[0]
        own[2] += step * gap[2] + 2.0 * slope * gap[1] + curvature * gap[0]
        found[:, blended] = own
        return found

    def ordinates(self, ends: FloatArray, degree: int) -> FloatArray:
        """Of the quintics between neighbouring angles ``(n + 1,)``, ``(degree + 1, n)``."""
        value, slope, curvature = self.at(ends)
        h = np.diff(ends)
        left = [value[:-1], value[:-1] + slope[:-1] * h / 5.0]
        left.append(2.0 * left[1] - left[0] + curvature[:-1] * h**2 / 20.0)
        right = [value[1:], value[1:] - slope[1:] * h / 5.0]
        right.append(2.0 * right[1] - right[0] + curvature[1:] * h**2 / 20.0)
        return bernstein.elevate(np.stack([*left, *right[::-1]]), degree)


def _sine(amplitude: float, wavelength: float, phase: float, angle: FloatArray) -> FloatArray:
    """Value, slope and curvature of a sine, ``(3, n)``."""
    k = TURN / wavelength
    sine, cosine = np.sin(k * angle + phase), np.cos(k * angle + phase)
    return np.asarray(amplitude * np.stack([sine, k * cosine, -(k**2) * sine]))

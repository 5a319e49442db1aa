"""Inputs of a campaign: the numbers of cam, rig and scene that it varies.

The path of an input has the names of the file: ``rig.follower.mass``, ``cam.segments[1].span``,
``scene.sample_rate``. `PROFILE` has the paths of the manufacturing errors of a cam, which no file
contains.
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
from cam_rig.schema.explain import validate_data
from cam_rig.schema.quantity import FACTORS, ORIGINS, UNITS
from cam_rig.schema.segment_base import iterate_quantities
from cam_rig.studies.campaign.schema import PERCENT, Variation
from cam_rig.units import TURN, FloatArray

Config = TypeVar("Config", bound=BaseModel)
#: Physical dimension of each manufacturing error of a cam profile, by the path of the campaign
#: input. `ProfileErrors` explains the errors.
PROFILE = {
    "profile.size": "length",
    "profile.eccentricity.amplitude": "length",
    "profile.eccentricity.phase": "angle",
    "profile.waviness.amplitude": "length",
    "profile.waviness.wavelength": "angle",
    "profile.waviness.phase": "angle",
}

#: Pattern of one element of an input's path, such as ``rig.follower.mass``: a name, or an index in
#: brackets.
_TOKEN = re.compile(r"[A-Za-z_]\w*|\[\d+\]")
#: SI unit of each physical dimension, such as length: the unit with the factor 1.
_SI = {
    dimension: next(u for u, f in units.items() if f == 1.0) for dimension, units in UNITS.items()
}


@dataclass(frozen=True)
class CampaignInput:
    """Number of the cam, the rig or the scene that a campaign varies.

    ``path`` is its path, such as ``rig.follower.mass``, ``base`` its value (SI) in the files on
    which the campaign is based, and ``dimension`` its physical dimension, such as length.
    ``variation`` defines the values that it takes.
    """

    path: str
    base: float
    dimension: str
    variation: Variation

    @property
    def si_unit(self) -> str:
        """SI unit of the input, which is its unit in the dataset."""
        return _SI[self.dimension]

    @property
    def column(self) -> str:
        """Name of the input's column in the dataset, such as ``rig_follower_mass``."""
        return re.sub(r"\W+", "_", self.path).strip("_")

    @property
    def factor(self) -> float:
        """SI value of the unit in which the variation is given.

        For a variation in percent it is 1 % of the number in the base.
        """
        if self.variation.unit == PERCENT:
            return 0.01 * abs(self.base)
        return UNITS[self.dimension][self.variation.unit]

    @property
    def origin(self) -> float:
        """Value (SI) to which the numbers of the variation are added.

        It is the value in the base files for a variation in percent, otherwise 0.
        """
        return self.base if self.variation.unit == PERCENT else 0.0

    @property
    def mean(self) -> float:
        """Mean of the distribution of an input, SI.

        The default is the value in the files on which the campaign is based.
        """
        mean = self.variation.mean
        return self.base if mean is None else mean * self.factor

    @property
    def endless(self) -> bool:
        """True if the distribution of the input has no smallest and largest value."""
        return self.variation.normal is not None and self.variation.within is None


def paths_of(configs: Mapping[str, BaseModel]) -> dict[str, tuple[float, str]]:
    """Return all numbers that a campaign can vary: value (SI) and dimension by path.

    ``configs`` maps ``cam``, ``rig`` and ``scene`` to their configurations. Each number of a list
    has a separate path.
    """
    numbers: dict[str, tuple[float, str]] = {path: (0.0, kind) for path, kind in PROFILE.items()}
    for name, config in configs.items():
        for path, number in iterate_quantities(config, f"{name}."):
            dimension = next(key for key, units in UNITS.items() if number.unit in units)
            if isinstance(number.raw, list):
                for i, value in enumerate(number.si_list):
                    numbers[f"{path}[{i}]"] = value, dimension
            else:
                numbers[path] = number.si, dimension
    return numbers


def input_of(
    path: str, variation: Variation, numbers: Mapping[str, tuple[float, str]]
) -> CampaignInput:
    """Return the input with a path, checked against the numbers of the base.

    ``numbers`` are the numbers that can vary, as returned by `paths_of`.

    Raises
    ------
    ConfigError
        If the base has no such number, or the unit does not match.
    """
    if path not in numbers:
        roots = sorted({key.split(".")[0] for key in numbers})
        hint = _hint(path, numbers)
        raise ConfigError(
            f"vary.{path}: the base has no such number{hint}; use the path of a number of "
            f"{', '.join(roots)}, such as rig.follower.preload"
        )
    base, dimension = numbers[path]
    if variation.unit == PERCENT:
        if base == 0.0:
            raise ConfigError(f"vary.{path} is 0 in the base, so it cannot vary in %; use a unit")
    elif variation.unit not in UNITS[dimension]:
        raise ConfigError(
            f"vary.{path}: the unit must be one of %, {', '.join(UNITS[dimension])}, got "
            f"{variation.unit!r}"
        )
    return CampaignInput(path, base, dimension, variation)


def _hint(path: str, numbers: Mapping[str, object]) -> str:
    """Return a text that suggests numbers with a similar path, or an empty text."""
    shorter = [key for key in numbers if path.startswith(f"{key}.")]
    longer = [key for key in numbers if key.startswith(f"{path}.")]
    if len(matches := shorter or longer) > 1:
        return f" (did you mean one of {', '.join(matches)}?)"
    return did_you_mean(matches[0] if matches else path, numbers)


def with_numbers(config: Config, numbers: Mapping[str, float]) -> Config:
    """Return a copy of a configuration with other numbers (SI) at given paths.

    The paths are relative to the configuration. Without numbers, the configuration itself is
    returned.
    """
    if not numbers:
        return config
    data = _copy(config)
    for path, value in numbers.items():
        _set(data, _TOKEN.findall(path), value)
    return validate_data(type(config), data)


def _copy(node: Any) -> Any:
    """Return a shallow copy of a list, or a model as a dict without entries of None."""
    if isinstance(node, list):
        return list(node)
    return {key: value for key, value in dict(node).items() if value is not None}


def _set(node: Any, tokens: list[str], value: float) -> None:
    """Set the number at a path of nested data to a value (SI).

    ``node`` is the data, and ``tokens`` are the elements of the path. The containers along the path
    are copied, so that the original data are not changed.
    """
    for token in tokens:
        if isinstance(node, dict) and "unit" in node and token.startswith("["):
            break
        key = int(token[1:-1]) if token.startswith("[") else token
        node[key] = node = _copy(node[key])
    origin, factor = next(key for key in ORIGINS if key in node), FACTORS[node["unit"]]
    if isinstance(node[origin], list):
        node[origin] = list(node[origin])
        node[origin][int(tokens[-1][1:-1])] = value / factor
    else:
        node[origin] = value / factor


# Manufacturing errors of a cam profile, which are added to its law as polynomial pieces.

#: Smallest number of polynomial pieces with which one wavelength of a profile error is represented.
PER_WAVE = 12
#: Number of wavelengths at the end of a turn over which a waviness is blended into that of the next
#: turn, so that it has no step.
CLOSING_WAVES = 2.0
#: Shortest allowed wavelength of a waviness, rad: 0.1°.
SHORTEST = TURN / 3600.0
#: Longest allowed wavelength of a waviness, rad: one turn.
LONGEST = TURN
#: Degree of the polynomial pieces that approximate sinusoidal profile errors.
DEGREE = 5
#: Coefficients of the blending function 35 t⁴ − 84 t⁵ + 70 t⁶ − 20 t⁷, which rises from 0 to 1.
_BLEND_COEFFICIENTS = np.array([35.0, -84.0, 70.0, -20.0])


def require_wavelength(wavelength: float) -> None:
    """Raise a `ConfigError` if a wavelength (rad) of a waviness is out of range."""
    if not SHORTEST * (1.0 - 1e-9) <= wavelength <= LONGEST * (1.0 + 1e-9):
        raise ConfigError(
            f"profile.waviness.wavelength must be between {math.degrees(SHORTEST):.6g} and "
            f"{math.degrees(LONGEST):.6g} deg, got {math.degrees(wavelength):.6g}"
        )


@dataclass(frozen=True)
class ProfileErrors:
    """Manufacturing errors of the profile of one cam, added to its law.

    ``size`` is a constant offset, ``eccentricity`` the amplitude of one wave per turn, and
    ``waviness`` the amplitude of waves of ``wavelength``. Lengths are in m, wavelength and phases
    in rad of cam angle. A phase is that at θ = 0.
    """

    size: float = 0.0
    eccentricity: float = 0.0
    eccentricity_phase: float = 0.0
    waviness: float = 0.0
    wavelength: float | None = None
    waviness_phase: float = 0.0

    @classmethod
    def of(cls, numbers: Mapping[str, float]) -> ProfileErrors:
        """Create profile errors from values (SI) by the path of the campaign input.

        The paths are those of `PROFILE` without ``profile.``.
        """
        fields = {
            path.replace(".amplitude", "").replace(".", "_"): x for path, x in numbers.items()
        }
        if (wavelength := fields.pop("waviness_wavelength", None)) is not None:
            require_wavelength(wavelength)
        return cls(**fields, wavelength=wavelength)

    @property
    def _step(self) -> float:
        """Longest polynomial piece (rad) that represents the errors accurately.

        It is infinite for a constant error.
        """
        waves = [TURN] if self.eccentricity else []
        waves += [self.wavelength] if self.waviness and self.wavelength else []
        return min(waves, default=math.inf) / PER_WAVE

    def add_to(self, law: Law) -> Law:
        """Return the law plus the errors, as polynomial pieces of degree 5 or higher.

        The pieces of the law are cut into equal parts, at least `PER_WAVE` per wavelength. The
        error of each part is the quintic with the error's value, slope and curvature at both ends.
        It is C2 at every joint. It differs from the exact error by |Δs| ≤ h⁶ M/46080 and |Δs''| ≤
        h⁴ M/1920, where h is the length of the part and M the largest sixth derivative (Birkhoff
        and Priver 1967). For a wave a sin kθ these are 4.5e-7 a, and 3.9e-5 of a k², and up to five
        times as much in the closing range. The law itself is represented exactly.
        """
        if not (self.eccentricity or self.waviness):
            ordinates = law.ordinates + self.size if self.size else law.ordinates
            return Law(law.name, law.breaks, ordinates)
        counts = np.ceil(law.spans / self._step * (1.0 - 1e-12)).astype(int)
        cut_ordinates, breaks = bernstein.cut(law.ordinates, law.breaks, counts)
        degree = max(DEGREE, law.degree)
        ordinates = bernstein.elevate(cut_ordinates, degree) + self.ordinates(breaks, degree)
        return Law(law.name, breaks, ordinates)

    def at(self, angle: FloatArray) -> FloatArray:
        """Return the error and its first two derivatives at cam angles (rad), ``(3, n)``.

        The units are m, m/rad and m/rad².

        A wave with a whole number of wavelengths per turn is a sine. Any other wave would have a
        step at the end of the turn. It is therefore blended over the last two wavelengths (C3) into
        the sine that starts one turn later. The blend is not larger than either sine.
        """
        errors = np.zeros((3, angle.size))
        if self.eccentricity:
            errors += _sine(self.eccentricity, TURN, self.eccentricity_phase, angle)
        errors[0] += self.size
        if self.waviness and self.wavelength:
            errors += self._wave(angle, self.wavelength)
        return errors

    def _wave(self, angle: FloatArray, wavelength: float) -> FloatArray:
        closing = min(CLOSING_WAVES * wavelength, TURN)
        wave = _sine(self.waviness, wavelength, self.waviness_phase, angle)
        blended = angle > TURN - closing
        blend, angle = wave[:, blended], angle[blended]
        next_turn = _sine(self.waviness, wavelength, self.waviness_phase, angle - TURN)
        t = np.clip((angle - (TURN - closing)) / closing, 0.0, 1.0)
        powers = np.stack([t**k for k in range(2, 8)])
        step = _BLEND_COEFFICIENTS @ powers[2:]
        slope = (_BLEND_COEFFICIENTS * [4, 5, 6, 7]) @ powers[1:5] / closing
        curvature = (_BLEND_COEFFICIENTS * [12, 20, 30, 42]) @ powers[:4] / closing**2
        gap = next_turn - blend
        blend[0] += step * gap[0]
        blend[1] += step * gap[1] + slope * gap[0]
        blend[2] += step * gap[2] + 2.0 * slope * gap[1] + curvature * gap[0]
        wave[:, blended] = blend
        return wave

    def ordinates(self, ends: FloatArray, degree: int) -> FloatArray:
        """Return the error as polynomial pieces: Bernstein ordinates (m).

        ``ends`` ``(n + 1,)`` are the cam angles (rad) at the ends of the pieces. The result is
        ``(degree + 1, n)``. Each piece is a quintic, elevated to ``degree``.
        """
        value, slope, curvature = self.at(ends)
        h = np.diff(ends)
        left = [value[:-1], value[:-1] + slope[:-1] * h / 5.0]
        left.append(2.0 * left[1] - left[0] + curvature[:-1] * h**2 / 20.0)
        right = [value[1:], value[1:] - slope[1:] * h / 5.0]
        right.append(2.0 * right[1] - right[0] + curvature[1:] * h**2 / 20.0)
        return bernstein.elevate(np.stack([*left, *right[::-1]]), degree)


def _sine(amplitude: float, wavelength: float, phase: float, angle: FloatArray) -> FloatArray:
    """Return value, slope and curvature of a sine wave at cam angles, ``(3, n)``.

    Amplitude in m, wavelength, phase and angles in rad.
    """
    k = TURN / wavelength
    sine, cosine = np.sin(k * angle + phase), np.cos(k * angle + phase)
    return np.asarray(amplitude * np.stack([sine, k * cosine, -(k**2) * sine]))

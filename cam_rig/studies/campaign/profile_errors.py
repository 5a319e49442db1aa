"""Errors of a manufactured cam, added to its law as a piecewise polynomial.

They are errors of the lift that the follower is given: of size (the same all around), eccentricity
(once a turn) and waviness (a sine of the cam angle).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN

#: Pieces of a wave.
PER_WAVE = 12
#: A wave closes the turn over so many wavelengths, at the turn's end.
CLOSING_WAVES = 2.0
#: Shortest wavelength, rad (0.1°), and longest (a turn).
SHORTEST, LONGEST = TURN / 3600.0, TURN
#: Degree of the pieces that carry sines.
DEGREE = 5
#: Ordinates of the step 35 t⁴ − 84 t⁵ + 70 t⁶ − 20 t⁷ and of its slope and bend.
_STEP = np.array([35.0, -84.0, 70.0, -20.0])


def require_wavelength(wavelength: float) -> None:
    """Refuse a wavelength (rad) that cannot be followed.

    Raises
    ------
    ConfigError : shorter than `SHORTEST`, or longer than `LONGEST`
    """
    if not SHORTEST * (1.0 - 1e-9) <= wavelength <= LONGEST * (1.0 + 1e-9):
        raise ConfigError(
            f"profile.waviness.wavelength: is {math.degrees(wavelength):.6g} deg; allowed: "
            f"{math.degrees(SHORTEST):.6g} to {math.degrees(LONGEST):.6g} deg"
        )


@dataclass(frozen=True)
class ProfileErrors:
    """Errors of one cam: lengths in m, angles in rad of cam angle; a phase is that at θ = 0.

    ``wavelength`` is None where there is no waviness.
    """

    size: float = 0.0
    eccentricity: float = 0.0
    eccentricity_phase: float = 0.0
    waviness: float = 0.0
    wavelength: float | None = None
    waviness_phase: float = 0.0

    @classmethod
    def of(cls, numbers: Mapping[str, float]) -> ProfileErrors:
        """From numbers (SI) by their paths below ``profile``.

        Raises
        ------
        ConfigError : a wavelength that cannot be followed
        """
        wavelength = numbers.get("waviness.wavelength")
        if wavelength is not None:
            require_wavelength(wavelength)
        return cls(
            size=numbers.get("size", 0.0),
            eccentricity=numbers.get("eccentricity.amplitude", 0.0),
            eccentricity_phase=numbers.get("eccentricity.phase", 0.0),
            waviness=numbers.get("waviness.amplitude", 0.0),
            wavelength=wavelength,
            waviness_phase=numbers.get("waviness.phase", 0.0),
        )

    @property
    def eccentric(self) -> ProfileErrors:
        """The eccentricity alone."""
        return ProfileErrors(
            eccentricity=self.eccentricity, eccentricity_phase=self.eccentricity_phase
        )

    @property
    def wavy(self) -> ProfileErrors:
        """The waviness alone."""
        return replace(self, size=0.0, eccentricity=0.0)

    @property
    def _step(self) -> float:
        """Longest piece, rad."""
        waves = [TURN] if self.eccentricity else []
        waves += [self.wavelength] if self.waviness and self.wavelength else []
        return min(waves, default=math.inf) / PER_WAVE

    def added_to(self, law: Law) -> Law:
        """The law with the errors, of degree 5 at least.

        Its pieces are cut into equal parts, `PER_WAVE` of a wave at least, and each part takes the
        quintic that has the error's value, slope and bend at both its ends: C2 at every joint, and
        the error itself but for |Δs| ≤ h⁶ M/46080 and |Δs''| ≤ h⁴ M/1920, M its largest sixth
        derivative (Birkhoff and Priver 1967). Of a wave a sin kθ that is 4.5e-7 a, and 3.9e-5 of
        its a k²; in the closing up to five times as much. The law itself is kept exactly.
        """
        if not (self.eccentricity or self.waviness):
            ordinates = law.ordinates + self.size if self.size else law.ordinates
            return Law(law.name, law.breaks, ordinates)
        counts = np.ceil(law.spans / self._step * (1.0 - 1e-12)).astype(int)
        breaks, columns = [np.zeros(1)], []
        degree = max(DEGREE, law.degree)
        for i, count in enumerate(counts.tolist()):
            ends = np.linspace(law.breaks[i], law.breaks[i + 1], count + 1)
            breaks.append(ends[1:])
            parts = np.einsum("cqp,p->qc", _cuts(law.degree, count), law.ordinates[:, i])
            columns.append(bernstein.elevate(parts, degree) + self.ordinates(ends, degree))
        return Law(law.name, np.concatenate(breaks), np.concatenate(columns, axis=1))

    def at(self, angle: FloatArray) -> FloatArray:
        """Value (m), slope (m/rad) and bend (m/rad²) of the errors at cam angles of a turn, (3, n).

        A wave that goes into the turn a whole number of times is a sine all around. Any other
        would step at the turn's end: over the last two wavelengths it passes smoothly (C3) into
        the sine that began a turn ahead, a blend no larger than either.
        """
        found = _sine(self.eccentricity, TURN, self.eccentricity_phase, angle)
        found[0] += self.size
        if self.waviness and self.wavelength:
            found += self._wave(angle, self.wavelength)
        return found

    def _wave(self, angle: FloatArray, wavelength: float) -> FloatArray:
        closing = min(CLOSING_WAVES * wavelength, TURN)
        own = _sine(self.waviness, wavelength, self.waviness_phase, angle)
        ahead = _sine(self.waviness, wavelength, self.waviness_phase, angle - TURN)
        t = np.clip((angle - (TURN - closing)) / closing, 0.0, 1.0)
        powers = np.stack([t**k for k in range(2, 8)])
        step = _STEP @ powers[2:]
        slope = (_STEP * [4, 5, 6, 7]) @ powers[1:5] / closing
        bend = (_STEP * [12, 20, 30, 42]) @ powers[:4] / closing**2
        gap = ahead - own
        own[0] += step * gap[0]
        own[1] += step * gap[1] + slope * gap[0]
        own[2] += step * gap[2] + 2.0 * slope * gap[1] + bend * gap[0]
        return own

    def ordinates(self, ends: FloatArray, degree: int) -> FloatArray:
        """Of the quintics between neighbouring angles ``(n + 1,)``, ``(degree + 1, n)``."""
        value, slope, bend = self.at(ends)
        h = np.diff(ends)
        left = [value[:-1], value[:-1] + slope[:-1] * h / 5.0]
        left.append(2.0 * left[1] - left[0] + bend[:-1] * h**2 / 20.0)
        right = [value[1:], value[1:] - slope[1:] * h / 5.0]
        right.append(2.0 * right[1] - right[0] + bend[1:] * h**2 / 20.0)
        return bernstein.elevate(np.stack([*left, *right[::-1]]), degree)


def _sine(amplitude: float, wavelength: float, phase: float, angle: FloatArray) -> FloatArray:
    """Value, slope and bend of a sine, ``(3, n)``."""
    k = TURN / wavelength
    sine, cosine = np.sin(k * angle + phase), np.cos(k * angle + phase)
    return np.asarray(amplitude * np.stack([sine, k * cosine, -(k**2) * sine]))


@lru_cache(maxsize=256)
def _cuts(degree: int, count: int) -> FloatArray:
    """Matrices ``(count, p + 1, p + 1)`` that take a piece's ordinates to those of equal parts."""
    unit = np.eye(degree + 1)
    return np.stack([bernstein.restrict(unit, k / count, (k + 1) / count) for k in range(count)])

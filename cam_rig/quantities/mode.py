"""The one mode of a follower that stays on the cam, and the speeds at which it is excited most.

The end mass vibrates about its static place: η̈ + 2ζω η̇ + ω² η = d₁ ṡ + d₂ s̈.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import ConfigError
from cam_rig.units import TURN, FloatArray

#: Speeds a beat: the largest between two of them is missed by 0.4 % at most; and of a range, most.
A_BEAT, MAX_SPEEDS = 32, 4096


@dataclass(frozen=True)
class Mode:
    """One mode in contact: λ (1/s), its drive by ṡ and s̈, and what it adds to the contact force.

    Parameters
    ----------
    rate : λ, the one of positive imaginary part
    drive : d₁ (1/s) and d₂
    state : what η and η̇ add to the contact force, N/m and N·s/m
    motion : what s, ṡ and s̈ do
    constant : N
    """

    rate: complex
    drive: tuple[float, float]
    state: tuple[float, float]
    motion: tuple[float, float, float]
    constant: float

    @property
    def shown(self) -> complex:
        """What an amplitude adds to the contact force, half of it."""
        return self.state[0] + self.state[1] * self.rate

    @classmethod
    def of(cls, p: TwoMassParameters | FollowerParameters) -> Mode:
        """Of two masses, or of one on its elastic stem (eq. 5 of the paper)."""
        if isinstance(p, TwoMassParameters):
            mass, stiffness = p.end_mass, p.stiffness
            damping, share, roller = p.stem_damping + p.damping, p.share, p.roller_mass
            stem, stem_damping, pressed = p.stem_stiffness, p.stem_damping, p.share
        else:
            mass, stiffness = p.mass, p.spring_stiffness + p.stem
            damping, share, roller = p.damping, p.stem / stiffness, 0.0
            stem, stem_damping, pressed = p.stem, 0.0, 1.0
        half = 0.5 * damping / mass
        square = stiffness / mass - half**2
        if square <= 0.0:
            raise ConfigError(
                f"the stem does not vibrate: its damping is {damping:g} N·s/m; allowed for a "
                f"residual vibration: below {2.0 * math.sqrt(stiffness * mass):.4g} N·s/m"
            )
        left = p.spring_stiffness / stiffness
        return cls(
            rate=complex(-half, math.sqrt(square)),
            drive=((stem_damping - damping * share) / mass, -share),
            state=(-stem, -stem_damping),
            motion=(stem * left, stem_damping * left, roller),
            constant=p.preload * pressed,
        )


def speeds_of(mode: Mode, longest: float, low: float, high: float) -> FloatArray:
    """Speeds (rad/s) of a range, falling and even in 1/Ω, so many a beat of an event (rad)."""
    if low == high:
        return np.array([low])
    beats = longest * mode.rate.imag * (1.0 / low - 1.0 / high) / TURN
    count = min(MAX_SPEEDS, max(8, math.ceil(beats * A_BEAT)))
    return np.asarray(1.0 / np.linspace(1.0 / high, 1.0 / low, count + 1))


def peaks(speeds: FloatArray, amplitudes: FloatArray, above: float) -> FloatArray:
    """Where a curve ``(n,)`` over speeds even in 1/Ω is highest, at peaks above a value, rad/s.

    Of a parabola through the squares at three speeds; an end that is the highest is one too.
    """
    padded = np.pad(amplitudes, 1, constant_values=-np.inf)
    at = np.flatnonzero(
        (amplitudes >= padded[:-2]) & (amplitudes >= padded[2:]) & (amplitudes > above)
    )
    inner = (at > 0) & (at < amplitudes.size - 1)
    below, here, beyond = (amplitudes[(at[inner] + k)] ** 2 for k in (-1, 0, 1))
    bend = 2.0 * here - below - beyond
    shift = np.divide(0.5 * (beyond - below), bend, out=np.zeros(bend.size), where=bend > 0.0)
    found = 1.0 / speeds[at]
    found[inner] += shift * (1.0 / speeds[at[inner] + 1] - found[inner])
    return np.asarray(1.0 / found)

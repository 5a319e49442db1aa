"""The follower in the air: m ÿ + c ẏ + k y + preload = 0, in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.dynamics.block import FloatArray
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.laws import bernstein

#: Degree of the power series that stands for the motion within a window of `Flight.window`.
SERIES_DEGREE = 14


@dataclass(frozen=True)
class Flight:
    """Free motion from displacement ``start`` (m) and velocity ``velocity`` (m/s) at t = 0."""

    parameters: FollowerParameters
    start: float
    velocity: float

    @property
    def window(self) -> float:
        """Time (s) within which the series of `SERIES_DEGREE` is exact to rounding."""
        p = self.parameters
        return 0.5 / max(math.sqrt(p.spring_stiffness / p.mass), p.damping / p.mass)

    def state(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement (m) and velocity (m/s) at times since the flight began, s."""
        p = self.parameters
        decay = 0.5 * p.damping / p.mass
        square = p.spring_stiffness / p.mass
        rest = -p.preload / p.spring_stiffness
        offset = self.start - rest
        cosine, sine = _cosine_and_sine(square - decay**2, time)
        envelope = np.exp(-decay * time)
        y = rest + envelope * (offset * cosine + (self.velocity + decay * offset) * sine)
        v = envelope * (self.velocity * cosine - (square * offset + decay * self.velocity) * sine)
        return y, v

    def motion(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Displacement, velocity and acceleration (m/s²) at times since the flight began."""
        p = self.parameters
        y, v = self.state(time)
        return y, v, -(p.spring_stiffness * y + p.damping * v + p.preload) / p.mass

    def ordinates(self, begin: float, end: float) -> FloatArray:
        """Bernstein ordinates of the displacement on [begin, end], no longer than `window`.

        The exponential's power series about ``begin``, in which each term follows from the two
        before it by the equation of motion, written in the Bernstein basis.
        """
        p = self.parameters
        length = end - begin
        y, v = self.state(np.array([begin]))
        terms = np.empty(SERIES_DEGREE + 1)
        terms[0], terms[1] = y[0], v[0] * length
        for i in range(SERIES_DEGREE - 1):
            spring = p.spring_stiffness * terms[i] + (p.preload if i == 0 else 0.0)
            pull = p.damping * (i + 1) * terms[i + 1] * length + spring * length**2
            terms[i + 2] = -pull / (p.mass * (i + 1) * (i + 2))
        return _bernstein_from_powers() @ terms


def _cosine_and_sine(square: float, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """cos(wt) and sin(wt)/w for w² = ``square`` of either sign, or none."""
    if square > 0.0:
        w = np.sqrt(square)
        return np.cos(w * time), np.sin(w * time) / w
    if square < 0.0:
        w = np.sqrt(-square)
        return np.cosh(w * time), np.sinh(w * time) / w
    return np.ones_like(time), time


@lru_cache(maxsize=1)
def _bernstein_from_powers() -> FloatArray:
    """Matrix that rewrites Σ aᵢ uⁱ of degree `SERIES_DEGREE` in the Bernstein basis."""
    n = SERIES_DEGREE
    matrix = np.zeros((n + 1, n + 1))
    for j in range(n + 1):
        matrix[j, : j + 1] = bernstein.binomials(j) / bernstein.binomials(n)[: j + 1]
    return matrix

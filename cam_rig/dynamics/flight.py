"""The follower in the air: m ÿ + c ẏ + k y + preload = 0, in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cam_rig.dynamics.impulse import response
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import FloatArray

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

    @cached_property
    def largest_acceleration(self) -> float:
        """What |ÿ| (m/s²) does not exceed: neither does the energy."""
        p = self.parameters
        pull = p.spring_stiffness * self.start + p.preload
        energy = pull**2 + p.spring_stiffness * p.mass * self.velocity**2
        fastest = math.sqrt(energy / (p.spring_stiffness * p.mass))
        return (math.sqrt(energy) + p.damping * fastest) / p.mass

    def state(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement (m) and velocity (m/s) at times since the flight began, s.

        y = y₀ + v₀ S − a₀ C and ẏ = v₀ Ṡ − a₀ S with the impulse response S, its integral C and
        the deceleration at the start a₀ = (k y₀ + preload)/m, which stays exact for any spring.
        """
        p = self.parameters
        pull = (p.spring_stiffness * self.start + p.preload) / p.mass
        impulse, rate, step = response(p.damping / p.mass, p.spring_stiffness / p.mass, time)
        return (
            self.start + self.velocity * impulse - pull * step,
            self.velocity * rate - pull * impulse,
        )

    def motion(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Displacement, velocity and acceleration (m/s²) at times since the flight began."""
        p = self.parameters
        y, v = self.state(time)
        return y, v, -(p.spring_stiffness * y + p.damping * v + p.preload) / p.mass

    def ordinates(self, begin: float, end: float) -> FloatArray:
        """Bernstein ordinates of the displacement on [begin, end], no longer than `window`.

        The exponential's power series about ``begin``, written in the Bernstein basis.
        """
        y, v = self.state(np.array([begin]))
        terms = _series(self.parameters) @ np.array([y[0], v[0], 1.0])
        powers = (end - begin) ** np.arange(SERIES_DEGREE + 1.0)
        return np.asarray(_bernstein_from_powers() @ (terms * powers))


@lru_cache(maxsize=64)
def _series(parameters: FollowerParameters) -> FloatArray:
    """What y, ẏ and the preload add to each term of the power series, ``(n + 1, 3)``.

    Each term follows from the two before it by the equation of motion.
    """
    p = parameters
    terms = np.zeros((SERIES_DEGREE + 1, 3))
    terms[0, 0] = terms[1, 1] = 1.0
    for i in range(SERIES_DEGREE - 1):
        pull = p.damping * (i + 1) * terms[i + 1] + p.spring_stiffness * terms[i]
        pull[2] += p.preload if i == 0 else 0.0
        terms[i + 2] = -pull / (p.mass * (i + 1) * (i + 2))
    return terms


@lru_cache(maxsize=1)
def _bernstein_from_powers() -> FloatArray:
    """Matrix that rewrites Σ aᵢ uⁱ of degree `SERIES_DEGREE` in the Bernstein basis."""
    n = SERIES_DEGREE
    matrix = np.zeros((n + 1, n + 1))
    for j in range(n + 1):
        matrix[j, : j + 1] = bernstein.binomials(j) / bernstein.binomials(n)[: j + 1]
    return matrix

"""Masses in the air: ẋ = A x + b, in closed form, in pairs of states.

A is brought to pairs, each a mass on a spring and a damper of its own, q̈ + 2δ q̇ + κ q = const.
Their response is exact for every damping, critical or not, and every spring, next to none too. What
is reckoned is how far the masses have come, not where they are from where they would rest, which a
weak spring puts far away.
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any

import numpy as np

from cam_rig.units import FloatArray


@cache
def linalg() -> Any:
    """`scipy.linalg`, imported by the first call: many scenes need none of it."""
    return importlib.import_module("scipy.linalg")


#: Below this time, in units of the fastest rate, the power series is used.
SHORT = 0.5
#: Terms of the series: 0.5^18/18! is far below rounding.
TERMS = 18

Response = tuple[FloatArray, FloatArray, FloatArray]


def response(damping: float, stiffness: float, time: FloatArray) -> Response:
    """Impulse response S (s), Ṡ (1) and its integral C (s²) at times in s; 2δ in 1/s, κ in 1/s²."""
    time = np.asarray(time, dtype=np.float64)
    short = max(math.sqrt(stiffness), damping) * time <= SHORT
    if short.all():
        return _series(damping, stiffness, time)
    if not short.any():
        return _long(damping, stiffness, time)
    out = np.empty((3, time.size))
    out[:, short] = _series(damping, stiffness, time[short])
    out[:, ~short] = _long(damping, stiffness, time[~short])
    return out[0], out[1], out[2]


def _long(damping: float, stiffness: float, time: FloatArray) -> Response:
    decay = 0.5 * damping
    square = stiffness - decay**2
    if square > 0.0:
        return _oscillating(decay, square, stiffness, time)
    return _creeping(decay, math.sqrt(-square), stiffness, time)


def _series(damping: float, stiffness: float, time: FloatArray) -> Response:
    """Taylor series; the times are below `SHORT` over the fastest rate."""
    found = np.vander(time, TERMS + 1, increasing=True) @ _terms(damping, stiffness)
    return found[:, 0], found[:, 1], found[:, 2]


@lru_cache(maxsize=256)
def _terms(damping: float, stiffness: float) -> FloatArray:
    """Coefficients of S, Ṡ and C, ``(TERMS + 1, 3)``: they follow from the equation of motion."""
    terms = [0.0, 0.0, 0.5]
    for i in range(1, TERMS - 1):
        pull = damping * (i + 1) * terms[i + 1] + stiffness * terms[i]
        terms.append(-pull / ((i + 1) * (i + 2)))
    step = np.array(terms)
    order = np.arange(TERMS + 1.0)
    impulse = np.append(step[1:] * order[1:], 0.0)
    rate = np.append(impulse[1:] * order[1:], 0.0)
    return np.stack([impulse, rate, step], axis=1)


def _oscillating(decay: float, square: float, stiffness: float, time: FloatArray) -> Response:
    w = math.sqrt(square)
    envelope = np.exp(-decay * time)
    impulse = envelope * np.sin(w * time) / w
    rate = envelope * np.cos(w * time) - decay * impulse
    return impulse, rate, (1.0 - rate - 2.0 * decay * impulse) / stiffness


def _creeping(decay: float, root: float, stiffness: float, time: FloatArray) -> Response:
    """Overdamped or critical: rates λ₁ ≤ λ₂, never a growing exponential."""
    fast = decay + root
    slow = stiffness / fast
    apart = 2.0 * root
    growth = -np.expm1(-apart * time) / apart if apart > 0.0 else time
    impulse = np.exp(-slow * time) * growth
    rate = np.exp(-fast * time) - slow * impulse
    if slow > 0.1 * fast:
        return impulse, rate, (1.0 - rate - 2.0 * decay * impulse) / stiffness
    settled = -np.expm1(-slow * time) / slow if slow > 0.0 else time
    return impulse, rate, (settled + np.expm1(-fast * time) / fast) / apart


#: Degree of the acceleration's power series within a window, and |A| t of the window: what is left
#: out is 2^25/25!, below a rounding.
SERIES_DEGREE, REACH = 24, 2.0
#: Takes a power series to ordinates: C(i, j)/C(n, j).
OF_POWERS = np.array(
    [
        [math.comb(i, j) / math.comb(SERIES_DEGREE, j) for j in range(SERIES_DEGREE + 1)]
        for i in range(SERIES_DEGREE + 1)
    ]
)


def window_series(matrix: FloatArray, row: FloatArray, window: float) -> FloatArray:
    """``(SERIES_DEGREE + 1, n)``: takes x to the ordinates of row · e^{At} x in a window (s)."""
    terms = [row]
    for j in range(SERIES_DEGREE):
        terms.append(terms[-1] @ matrix * (window / (j + 1)))
    return np.asarray(OF_POWERS @ np.array(terms))


@dataclass(frozen=True, eq=False)
class Pairs:
    """x = V ξ with ξ in pairs (q, q̇), each q̈ = −κ q − 2δ q̇ but for a constant."""

    shapes: FloatArray  #: V, ``(n, n)``
    inverse: FloatArray  #: of V
    damping: FloatArray  #: 2δ, 1/s, ``(n / 2,)``
    stiffness: FloatArray  #: κ, 1/s², ``(n / 2,)``


@dataclass(frozen=True, eq=False)
class FreeSystem:
    """The masses in the air; their states are places and velocities in turn."""

    matrix: FloatArray  #: A, ``(n, n)``
    load: FloatArray  #: b, ``(n,)``
    #: what the states contribute to the place of the mass that meets the cam, ``(n,)``
    row: FloatArray
    #: ``(k, n)``: takes ẋ to a vector whose length that mass's acceleration never exceeds
    energy: FloatArray
    #: None where they are too much alike; then it goes by the exponential of the matrix
    pairs: Pairs | None

    @cached_property
    def window(self) -> float:
        """Time (s) within which the series of `SERIES_DEGREE` is exact to rounding."""
        pulls = np.abs(self.matrix[1::2, ::2]).sum(axis=1)  # of places on accelerations
        scale = np.tile([1.0, 1.0 / np.sqrt(pulls.max())], self.load.size // 2)
        return REACH / float(np.linalg.norm(scale[:, None] * self.matrix / scale, 2))

    @cached_property
    def series(self) -> FloatArray:
        """``(SERIES_DEGREE + 1, n)``: takes ẋ to the acceleration's ordinates in a window."""
        return window_series(self.matrix, self.row @ self.matrix, self.window)

    def rates(self, start: FloatArray) -> FloatArray:
        """ẋ of a state, ``(n,)``."""
        return np.asarray(self.matrix @ start + self.load)

    def moved(self, start: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """X − x₀ and ẋ, ``(n, len(times))`` each, at times in s after the state ``start``."""
        if self.pairs is None:
            return self._by_exponential(start, times)
        pairs = self.pairs
        place, velocity = (pairs.inverse @ start).reshape(-1, 2).T
        gain, push = (pairs.inverse @ self.load).reshape(-1, 2).T
        rate = velocity + gain
        pull = pairs.stiffness * place - push - pairs.damping * gain
        force = -pairs.stiffness * place - pairs.damping * velocity + push
        way, ways = (np.empty((start.size, times.size)) for _ in range(2))
        for i, (damping, stiffness) in enumerate(zip(pairs.damping, pairs.stiffness, strict=True)):
            impulse, slope, step = response(float(damping), float(stiffness), times)
            way[2 * i] = rate[i] * impulse - pull[i] * step
            way[2 * i + 1] = force[i] * impulse - stiffness * rate[i] * step
            ways[2 * i] = rate[i] * slope - pull[i] * impulse
            ways[2 * i + 1] = force[i] * slope - stiffness * rate[i] * impulse
        return pairs.shapes @ way, pairs.shapes @ ways

    def _by_exponential(
        self, start: FloatArray, times: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        n, rates = start.size, self.rates(start)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n], matrix[:n, n] = self.matrix, rates
        flows = linalg().expm(matrix[None] * times[:, None, None])
        return flows[:, :n, n].T, (flows[:, :n, :n] @ rates).T


@dataclass(frozen=True, eq=False)
class Flight:
    """Free motion.

    Gap and its rate are given where they are known better than as the difference of two places:
    at a lift-off the gap is not one.
    """

    system: FreeSystem
    start: FloatArray  #: state at t = 0, ``(n,)``
    gap: float | None = None  #: how far the mass is from the cam then, m
    gap_rate: float | None = None  #: how fast it lifts off, m/s

    @property
    def known(self) -> tuple[float, ...]:
        """Gap and its rate, or nothing where they are not known."""
        return () if self.gap is None or self.gap_rate is None else (self.gap, self.gap_rate)

    def motion(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Displacement (m), velocity (m/s) and acceleration (m/s²) of the mass at times in s."""
        s = self.system
        way, rates = s.moved(self.start, times)
        place = s.row @ self.start + s.row @ way
        return np.asarray(place), np.asarray(s.row @ rates), np.asarray(s.row @ s.matrix @ rates)


def free_motion(matrix: FloatArray, start: FloatArray, times: FloatArray) -> FloatArray:
    """e^{At} z at any times (s), ``(n, len(times))``; z is ``(n,)``, or ``(n, len(times))``.

    For two states by Cayley-Hamilton, e^{At} = (Ṡ + 2δS) I + S A with the impulse response S of the
    characteristic equation; for more by one exponential a time.
    """
    starts = start[:, None] if start.ndim == 1 else start
    if starts.shape[0] != 2:
        flows = linalg().expm(matrix[None] * times[:, None, None])
        return np.asarray(np.matmul(flows, starts.T[:, :, None])[:, :, 0].T)
    (a, b), (c, d) = matrix.tolist()
    damping, stiffness = -(a + d), a * d - b * c
    impulse, rate, _ = response(damping, stiffness, times)
    return np.asarray(starts * (rate + damping * impulse) + (matrix @ starts) * impulse)

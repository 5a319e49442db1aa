"""The impulse response of a mass on spring and damper, accurate for every damping and time.

S solves S̈ + 2δ Ṡ + κ S = 0 with S(0) = 0, Ṡ(0) = 1; C is its integral. The textbook forms lose
their digits, or overflow, where the spring is soft, the damping strong or critical, or the time
short; each range therefore has its own form.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray

#: Below this time, in units of the fastest rate, the power series is used.
SHORT = 0.5
#: Terms of the series: 0.5^18/18! is far below rounding.
TERMS = 18

Response = tuple[FloatArray, FloatArray, FloatArray]


def response(damping: float, stiffness: float, time: FloatArray) -> Response:
    """S (s), Ṡ (1) and C (s²) at times in s.

    Parameters
    ----------
    damping : 2δ = c/m in 1/s
    stiffness : κ = k/m in 1/s²
    """
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

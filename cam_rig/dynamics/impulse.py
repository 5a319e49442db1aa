"""The impulse response of a mass on spring and damper, accurate for every damping and time.

S solves S̈ + 2δ Ṡ + κ S = 0 with S(0) = 0, Ṡ(0) = 1; C is its integral. The textbook forms lose
their digits, or overflow, where the spring is soft, the damping strong or critical, or the time
short; each range therefore has its own form.
"""

from __future__ import annotations

import math

import numpy as np

from cam_rig.laws.bernstein import FloatArray

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
    out = np.empty((3, time.size))
    out[:, short] = _series(damping, stiffness, time[short])
    if not short.all():
        decay = 0.5 * damping
        square = stiffness - decay**2
        long = time[~short]
        if square > 0.0:
            out[:, ~short] = _oscillating(decay, square, stiffness, long)
        else:
            out[:, ~short] = _creeping(decay, math.sqrt(-square), stiffness, long)
    return out[0], out[1], out[2]


def _series(damping: float, stiffness: float, time: FloatArray) -> Response:
    """Taylor series of C, whose coefficients follow from the equation of motion."""
    terms = [0.0, 0.0, 0.5]
    for i in range(1, TERMS - 1):
        pull = damping * (i + 1) * terms[i + 1] + stiffness * terms[i]
        terms.append(-pull / ((i + 1) * (i + 2)))
    step = np.array(terms)
    order = np.arange(TERMS + 1.0)
    impulse = np.append(step[1:] * order[1:], 0.0)
    rate = np.append(impulse[1:] * order[1:], 0.0)
    powers = np.vander(time, TERMS + 1, increasing=True)
    found = powers @ np.stack([impulse, rate, step], axis=1)
    return found[:, 0], found[:, 1], found[:, 2]


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

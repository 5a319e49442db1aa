"""One mass on spring and damper, ẍ + 2δ ẋ + κ x = 0, at one time in plain numbers.

The forms, and where each of them keeps its digits, are those of
`cam_rig.dynamics.linear.impulse_response`, which does the same for many times at once.
"""

from __future__ import annotations

import math

#: Below this time, in units of the fastest rate, the power series is used, of so many terms.
SHORT, TERMS = 0.5, 18
#: Two terms of the series below this are the last: the first is 1.
LEAST = 2.0**-62

Response = tuple[float, float, float]


def impulse_at(damping: float, stiffness: float, time: float) -> Response:
    """S (s), Ṡ (1) and ∫S (s²) at a time in s; ``damping`` 2δ in 1/s, ``stiffness`` κ in 1/s²."""
    if max(math.sqrt(stiffness), damping) * time <= SHORT:
        return _series(damping * time, stiffness * time * time, time)
    decay = 0.5 * damping
    square = stiffness - decay * decay
    if square > 0.0:
        return _oscillating(decay, math.sqrt(square), stiffness, time)
    return _creeping(decay, math.sqrt(-square), stiffness, time)


def _series(damping: float, stiffness: float, time: float) -> Response:
    """Taylor's series in the time as the unit; its terms follow from the equation of motion."""
    before, term = 0.0, 1.0
    impulse, rate, step = 0.0, 0.0, 0.0
    for i in range(1, TERMS):
        impulse += term
        rate += i * term
        step += term / (i + 1)
        following = -(damping * i * term + stiffness * before) / (i * (i + 1))
        before, term = term, following
        if abs(before) + abs(term) < LEAST:
            break
    return impulse * time, rate, step * time * time


def _oscillating(decay: float, rate: float, stiffness: float, time: float) -> Response:
    envelope = math.exp(-decay * time)
    impulse = envelope * math.sin(rate * time) / rate
    slope = envelope * math.cos(rate * time) - decay * impulse
    return impulse, slope, (1.0 - slope - 2.0 * decay * impulse) / stiffness


def _creeping(decay: float, root: float, stiffness: float, time: float) -> Response:
    """Overdamped or critical: never a growing exponential."""
    fast = decay + root
    slow, apart = stiffness / fast, 2.0 * root
    growth = -math.expm1(-apart * time) / apart if apart > 0.0 else time
    impulse = math.exp(-slow * time) * growth
    slope = math.exp(-fast * time) - slow * impulse
    if slow > 0.1 * fast:
        return impulse, slope, (1.0 - slope - 2.0 * decay * impulse) / stiffness
    settled = -math.expm1(-slow * time) / slow if slow > 0.0 else time
    return impulse, slope, (settled + math.expm1(-fast * time) / fast) / apart

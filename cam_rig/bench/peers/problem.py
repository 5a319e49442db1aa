"""What a peer integrates: a smooth right-hand side with its Jacobian and its guard.

Everything is written in Python floats, the cheapest there is for a handful of states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.bench.cases.phase import BenchPhase
from cam_rig.bench.peers.intervals import PeerInterval, Scalar

Floats = Sequence[float]


@dataclass(frozen=True, eq=False)
class Problem:
    """q̇ = rate(t, q) while guard(t, q) > 0.

    Parameters
    ----------
    jacobian : of the rate; ``constant`` when it depends neither on t nor on q
    scale : ``(n,)`` usual size of each state, for the absolute tolerance
    """

    rate: Callable[[float, list[float]], Floats]
    jacobian: Callable[[float, list[float]], FloatArray]
    constant: bool
    guard: Callable[[float, list[float]], float] | None
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class Arrival:
    """Where an integration ended.

    ``states`` is ``(n, k)`` at those of the output times that were reached; ``hit`` says whether
    the guard ended it.
    """

    time: float
    state: list[float]
    states: FloatArray
    hit: bool


class Integrator(Protocol):
    """One peer with one tolerance."""

    def __call__(
        self, problem: Problem, state: Floats, begin: float, end: float, times: FloatArray
    ) -> Arrival:
        """Integrate from ``begin`` to ``end`` or to the guard; ``times`` lie in between."""
        ...


class PeerError(Exception):
    """A peer gave up: its own message."""


def linear_problem(phase: BenchPhase, interval: PeerInterval, scale: FloatArray) -> Problem:
    """One phase on one interval."""
    half = phase.size // 2
    jacobian = np.zeros((phase.size, phase.size))
    jacobian[:half, half:] = np.eye(half)
    jacobian[half:] = np.array(phase.rows, dtype=float)
    forces = [interval.function(row) for row in phase.drive]
    rate = _one_position(phase, forces[0]) if half == 1 else _two_positions(phase, forces)
    return Problem(rate, lambda t, q: jacobian, True, _guard(phase, interval), scale)


def _one_position(phase: BenchPhase, force: Scalar) -> Callable[[float, list[float]], Floats]:
    a, b = (float(x) for x in phase.rows[0])

    def rate(time: float, q: list[float]) -> Floats:
        x, v = q
        return v, a * x + b * v + force(time)

    return rate


def _two_positions(
    phase: BenchPhase, forces: list[Scalar]
) -> Callable[[float, list[float]], Floats]:
    a, b, c, d = (float(x) for x in phase.rows[0])
    e, f, g, h = (float(x) for x in phase.rows[1])
    one, two = forces

    def rate(time: float, q: list[float]) -> Floats:
        x, y, u, v = q
        return (
            u,
            v,
            a * x + b * y + c * u + d * v + one(time),
            e * x + f * y + g * u + h * v + two(time),
        )

    return rate


def _guard(
    phase: BenchPhase, interval: PeerInterval
) -> Callable[[float, list[float]], float] | None:
    if phase.guard is None:
        return None
    weights = [float(x) for x in phase.guard]
    used = [(i, w) for i, w in enumerate(weights) if w != 0.0]
    if not any(phase.guard_drive) and len(used) == 1:
        i, weight = used[0]
        return lambda time, q: weight * q[i]
    smooth = interval.function(phase.guard_drive)
    if not used:
        return lambda time, q: smooth(time)
    a, b = weights
    return lambda time, q: a * q[0] + b * q[1] + smooth(time)

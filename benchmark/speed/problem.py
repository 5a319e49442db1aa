"""Problem for a peer: smooth right-hand side, Jacobian and guard.

All numbers are Python floats, which are the fastest type for few states.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from benchmark.speed.models import BenchPhase
from cam_rig.laws import Law, bernstein
from cam_rig.units import FloatArray

# -- law for the peers: intervals between its joints, with fast scalar functions of time

Scalar = Callable[[float], float]

#: Derivatives up to this order are continuous inside an interval, to `SMOOTH`.
SMOOTH_ORDER = 4

#: Jump of a derivative, relative to its largest value, that counts as continuous.
SMOOTH = 1e-6


@dataclass(frozen=True, eq=False)
class PeerInterval:
    """Consecutive pieces of a law without a jump between them.

    Parameters ----------
    ends : ``(n,)`` end of each piece in s since the start of the interval
    series : ``(n, 4, p + 1)`` s, ṡ, s̈ and 1 of each piece in powers of the time since its middle
    """

    ends: FloatArray
    series: FloatArray

    @cached_property
    def duration(self) -> float:
        """Duration (s) of the interval."""
        return float(self.ends[-1])

    def function(self, weights: object) -> Scalar:
        """Return a weighted sum of s, ṡ, s̈ and 1 as a function of time."""
        ends = self.ends.tolist()
        starts = [0.0, *ends[:-1]]
        functions = [
            _horner(np.asarray(weights, dtype=float) @ series, 0.5 * (low + high), high - low)
            for series, low, high in zip(self.series, starts, ends, strict=True)
        ]
        if len(functions) == 1:
            return functions[0]
        inner, last = ends[:-1], functions

        def value(time: float) -> float:
            return last[bisect_right(inner, time)](time)

        return value


def _horner(coefficients: FloatArray, middle: float, width: float) -> Scalar:
    """Return a function for a polynomial without its negligible powers."""
    size = np.abs(coefficients) * (0.5 * width) ** np.arange(coefficients.size)
    needed = np.flatnonzero(size > 1e-18 * size.max())
    terms: list[float] = coefficients[: needed[-1] + 1 if needed.size else 1].tolist()
    first = terms[0]
    if len(terms) == 1:
        return lambda time: first
    if len(terms) <= 6:
        a, b, c, d, e, f = terms + [0.0] * (6 - len(terms))

        def quintic(time: float) -> float:
            x = time - middle
            return ((((f * x + e) * x + d) * x + c) * x + b) * x + a

        return quintic
    top, *lower = terms[::-1]

    def value(time: float) -> float:
        x, total = time - middle, top
        for term in lower:
            total = total * x + term
        return total

    return value


def _series(law: Law, piece: int, speed: float) -> FloatArray:
    """Return s, ṡ, s̈, 1 of a piece in powers of the time since its middle.

    The shape is ``(4, p + 1)``.
    """
    rows, scale, lift = law.ordinates[:, piece], 1.0, np.zeros(law.degree + 3)
    for order in range(law.degree + 1):
        lift[order] = scale * bernstein.evaluate(rows, np.array([0.5]))[0]
        rows = bernstein.derivative(rows)
        scale *= speed / law.spans[piece] / (order + 1)
    out = np.zeros((4, law.degree + 1))
    out[0] = lift[:-2]
    out[1] = (lift[1:] * np.arange(1, lift.size))[:-1]
    out[2] = (lift[2:] * np.arange(1, lift.size - 1) * np.arange(2, lift.size))[: law.degree + 1]
    out[3, 0] = 1.0
    return out


def joints(law: Law) -> FloatArray:
    """Return ``(n,)`` flags, True if a derivative jumps at the start of the piece."""
    flags = np.zeros(law.spans.size, dtype=bool)
    for order in range(1, SMOOTH_ORDER + 1):
        size = np.abs(law.derivative_ordinates(order)).max()
        flags |= np.abs(law.jumps(order)) > SMOOTH * size
    return flags


def intervals(law: Law, speed: float, turns: int) -> list[tuple[float, PeerInterval]]:
    """Return start (s) and interval for each interval of ``turns`` turns, in order.

    Intervals that repeat are the same object.
    """
    count, starts = law.spans.size, joints(law)
    runs: list[list[int]] = []
    for piece in range(turns * count):
        if not runs or starts[piece % count]:
            runs.append([])
        runs[-1].append(piece)
    made: dict[tuple[int, ...], PeerInterval] = {}
    period = float(law.breaks[-1]) / speed
    out = []
    for run in runs:
        pieces = tuple(piece % count for piece in run)
        if pieces not in made:
            series = np.stack([_series(law, piece, speed) for piece in pieces])
            made[pieces] = _merged(np.cumsum(law.spans[list(pieces)]) / speed, series)
        turn, piece = divmod(run[0], count)
        out.append((turn * period + float(law.breaks[piece]) / speed, made[pieces]))
    return out


def _merged(ends: FloatArray, series: FloatArray) -> PeerInterval:
    """Return an interval of the pieces. Dwells are merged into one piece."""
    if np.all(series[:, 1:3] == 0.0) and np.ptp(series[:, 0, 0]) == 0.0:
        return PeerInterval(ends[-1:], series[:1])
    return PeerInterval(ends, series)


Floats = Sequence[float]


class LinearSystem(NamedTuple):
    """Arrays of a linear phase on an interval, for peers without Python callbacks.

    Parameters ----------
    matrix : ``(n, n)`` Jacobian of the rate
    ends, middles : ``(p,)`` end and middle of each piece (s)
    forces : ``(p, n / 2, d + 1)`` forcing in powers of the time since the middle
    guard : ``(n,)`` weights of the guard, empty without one
    guard_forces : ``(p, d + 1)`` part of the guard that depends on time, in the same powers
    """

    matrix: FloatArray
    ends: FloatArray
    middles: FloatArray
    forces: FloatArray
    guard: FloatArray
    guard_forces: FloatArray


@dataclass(frozen=True, eq=False)
class Problem:
    """Initial value problem q̇ = rate(t, q) that ends when guard(t, q) becomes zero.

    Parameters ----------
    jacobian : Jacobian of the rate, ``constant`` if it depends neither on t nor on q
    scale : ``(n,)`` usual size of each state, for the absolute tolerance
    linear : arrays of the same problem, None if it is not linear
    """

    rate: Callable[[float, list[float]], Floats]
    jacobian: Callable[[float, list[float]], FloatArray]
    constant: bool
    guard: Callable[[float, list[float]], float] | None
    scale: FloatArray
    linear: LinearSystem | None = None


@dataclass(frozen=True, eq=False)
class Arrival:
    """End of an integration: time and state.

    ``states`` is ``(n, k)`` at the output times before the end. ``hit`` is True if the guard ended
    the integration.
    """

    time: float
    state: list[float]
    states: FloatArray
    hit: bool


class Integrator(Protocol):
    """Peer with a tolerance."""

    def __call__(
        self, problem: Problem, state: Floats, begin: float, end: float, times: FloatArray
    ) -> Arrival:
        """Integrate from ``begin`` to ``end``, or to a zero of the guard.

        ``times`` are output times between them.
        """
        ...


class PeerError(Exception):
    """Failure of a peer, with its message."""


def linear_problem(phase: BenchPhase, interval: PeerInterval, scale: FloatArray) -> Problem:
    """Return the problem of a linear phase on an interval."""
    half = phase.size // 2
    jacobian = np.zeros((phase.size, phase.size))
    jacobian[:half, half:] = np.eye(half)
    jacobian[half:] = np.array(phase.rows, dtype=float)
    forces = [interval.function(row) for row in phase.drive]
    rate = _one_position(phase, forces[0]) if half == 1 else _two_positions(phase, forces)
    system = _linear_system(phase, interval, jacobian)
    return Problem(rate, lambda t, q: jacobian, True, _guard(phase, interval), scale, system)


def _linear_system(phase: BenchPhase, interval: PeerInterval, jacobian: FloatArray) -> LinearSystem:
    starts = np.append(0.0, interval.ends[:-1])
    drive = np.array(phase.drive, dtype=float)
    return LinearSystem(
        matrix=jacobian,
        ends=interval.ends,
        middles=0.5 * (starts + interval.ends),
        forces=np.ascontiguousarray(drive @ interval.series),
        guard=np.array(() if phase.guard is None else phase.guard, dtype=float),
        guard_forces=np.array(phase.guard_drive, dtype=float) @ interval.series,
    )


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
    force_1, force_2 = forces

    def rate(time: float, q: list[float]) -> Floats:
        x, y, u, v = q
        return (
            u,
            v,
            a * x + b * y + c * u + d * v + force_1(time),
            e * x + f * y + g * u + h * v + force_2(time),
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

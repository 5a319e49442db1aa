"""A linear model on a turning cam: its exact response at any time, turn after turn.

ẋ = A x + G (s, ṡ, s̈) + g, at constant cam speed. The particular solutions of one turn are found
once (`propagator`); after that a state is a polynomial and an exponential.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm

from cam_rig.dynamics.exponential import free_motion
from cam_rig.dynamics.propagator import piece
from cam_rig.errors import DynamicsError
from cam_rig.laws import TURN, Law, bernstein
from cam_rig.laws.bernstein import FloatArray

#: A mode that a turn changes by less than this (in phase and size) is in resonance.
RESONANT = 1e-11


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of the turn with one polynomial X: x(t) = X + e^{At} z.

    ``low`` and ``span`` in rad of cam angle, ``length`` in s, ``particular`` ``(n, p + 1)``.
    """

    low: float
    span: float
    length: float
    law_piece: int
    particular: FloatArray
    flow: FloatArray

    def forced(self, time: FloatArray) -> FloatArray:
        """X at times in s since the part's start, ``(n, len(time))``."""
        return bernstein.evaluate(self.particular.T, time / self.length).T


@dataclass(frozen=True, eq=False)
class Run:
    """A part as it is passed: from ``begin`` to ``end`` (s since the walk's start).

    ``local`` is where in the part it begins, in s; ``free`` the state there, less X.
    """

    part: Part
    begin: float
    end: float
    local: float
    free: FloatArray


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """The response of one linear model to one law at one speed.

    Parameters
    ----------
    speed : rad/s, above 0
    matrix : A, ``(n, n)``
    drive : G, ``(n, 3)``, what s, ṡ and s̈ contribute
    constant : g, ``(n,)``
    """

    law: Law
    speed: float
    matrix: FloatArray
    drive: FloatArray
    constant: FloatArray

    def __post_init__(self) -> None:
        if not (np.isfinite(self.speed) and self.speed > 0.0):
            raise DynamicsError(f"speed is {self.speed!r} rad/s; allowed: finite and above 0")

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The parts of one turn in order."""
        weights = self.drive * self.speed ** np.arange(3)
        forcing = np.tensordot(weights, self.law.motion, axes=1) + self.constant[:, None, None]
        found = []
        for i, span in enumerate(self.law.spans):
            solved = piece(self.matrix, forcing[:, :, i], float(span) / self.speed)
            count = solved.particular.shape[0]
            for k in range(count):
                low = float(self.law.breaks[i] + span * (k / count))
                part = Part(
                    low, float(span) / count, solved.part, i, solved.particular[k], solved.part_flow
                )
                found.append(part)
        return tuple(found)

    def walk(self, start: FloatArray, angle: float, duration: float) -> Iterator[Run]:
        """Run after run from state ``start`` at cam angle ``angle`` (rad) for ``duration`` s."""
        turns = math.floor(angle / TURN)
        inside = angle - turns * TURN
        i = bisect_right(self.parts, inside, key=lambda part: part.low) - 1
        now, state = 0.0, start
        while now < duration:
            part = self.parts[i % len(self.parts)]
            low = part.low + (i // len(self.parts)) * TURN
            end = max(now, (low + part.span - inside) / self.speed)
            local = max(0.0, (inside - low) / self.speed + now)
            at = part.forced(np.array([local]))[:, 0] if local > 0.0 else part.particular[:, 0]
            free = state - at
            yield Run(part, now, min(end, duration), local, free)
            flow = part.flow if local == 0.0 else expm(self.matrix * (end - now))
            state = part.particular[:, -1] + flow @ free
            now, i = end, i + 1

    def states(self, start: FloatArray, angle: float, times: FloatArray) -> FloatArray:
        """States ``(n, len(times))`` at ascending times in s since ``angle``."""
        out = np.empty((start.size, times.size))
        last = float(times[-1]) if times.size else 0.0
        for run in self.walk(start, angle, np.nextafter(last, np.inf)):
            a, b = np.searchsorted(times, [run.begin, run.end])
            since = times[a:b] - run.begin
            out[:, a:b] = run.part.forced(run.local + since) + free_motion(
                self.matrix, run.free, since
            )
        return out

    def end(self, start: FloatArray, angle: float, duration: float) -> FloatArray:
        """State ``(n,)`` after ``duration`` s."""
        return self.states(start, angle, np.array([duration]))[:, 0]

    def periodic(self) -> FloatArray:
        """The state at θ = 0 that a turn brings back: one linear solve.

        Raises
        ------
        DynamicsError : an undamped mode at a harmonic of the speed; it grows turn after turn
        """
        size = self.constant.size
        flow, rest = np.eye(size), np.zeros(size)
        for part in self.parts:
            rest = part.particular[:, -1] + part.flow @ (rest - part.particular[:, 0])
            flow = part.flow @ flow
        gap = np.eye(size) - flow
        if np.abs(np.linalg.eigvals(gap)).min() < RESONANT:
            raise DynamicsError(
                f"no steady state at {self.speed:g} rad/s: a mode without damping is at a harmonic "
                "of the speed; allowed: damping, or another speed"
            )
        return np.asarray(np.linalg.solve(gap, rest))

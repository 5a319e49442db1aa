"""Residual vibration: the amplitude that an event alone leaves, at every speed of a range.

The amplitude is a function of 1/Ω as narrow in its spectrum as the event is long, so speeds even
in 1/Ω, so many a beat, miss little of it. A program is given a few of them, and then those at
which its law is worst, until none is worse.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy import sparse

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.studies.design.affine import Affine
from cam_rig.studies.design.constraints import SPARE, Asked
from cam_rig.studies.design.elastic.amplitude import EventVibration
from cam_rig.studies.design.elastic.mode import Cells
from cam_rig.studies.design.problem import DesignProblem
from cam_rig.studies.design.program import ProgramSolution, RowBlock
from cam_rig.units import TURN

#: Speeds a beat: the largest between two of them is missed by 0.1 % at most.
A_BEAT, FIRST_A_BEAT = 64, 4
#: A cut is made where the law exceeds what the program allowed by so much.
WORSE = 2e-4
#: Speeds of a range, at most.
MAX_SPEEDS = 4096


def speeds_of(problem: DesignProblem, low: float, high: float, a_beat: int = A_BEAT) -> FloatArray:
    """Speeds (rad/s) of a range, even in 1/Ω, so many a beat of the longest event."""
    if low == high:
        return np.array([low])
    longest = max(event.span for event in problem.space.events)
    beats = longest * problem.mode.rate.imag * (1.0 / low - 1.0 / high) / TURN
    count = min(MAX_SPEEDS, max(8, math.ceil(beats * a_beat)))
    return np.asarray(1.0 / np.linspace(1.0 / high, 1.0 / low, count + 1))


@lru_cache(maxsize=4)
def left(problem: DesignProblem, low: float, high: float) -> tuple[ComplexArray, ComplexArray]:
    """What each event leaves at the speeds: constants ``(e, n)``, matrices ``(e, n, m)``."""
    cells, speeds = Cells(problem.space, problem.mode, low), speeds_of(problem, low, high)
    events = range(len(problem.space.events))
    found = [
        [EventVibration(cells, speed).residual(e) for speed in speeds.tolist()] for e in events
    ]
    constant = np.array([[value.constant[0] for value in row] for row in found])
    return constant, np.array([[value.matrix[0] for value in row] for row in found])


@dataclass(eq=False)
class Residual:
    """Cones |2a| ≤ limit (or t) of every event at speeds of a range."""

    problem: DesignProblem
    asked: Asked
    hull: bool
    taken: set[tuple[int, int]] = field(default_factory=set)
    blocks: list[RowBlock] = field(default_factory=list)

    def __post_init__(self) -> None:
        term = self.asked.term
        self.speeds = speeds_of(self.problem, term.low, term.high)
        self.constant, self.matrix = left(self.problem, term.low, term.high)
        count = len(self.problem.space.events)
        step = A_BEAT // FIRST_A_BEAT
        self._add([(e, i) for e in range(count) for i in range(0, self.speeds.size, step)])

    def amplitudes(self, unknowns: FloatArray) -> FloatArray:
        """|2a| (m) of every event at every speed."""
        return np.asarray(2.0 * np.abs(self.constant + self.matrix @ unknowns))

    def cut(self, solution: ProgramSolution) -> bool:
        """Add the speeds at which the law is worst, if worse than allowed; whether there are."""
        allowed = self.asked.value
        if allowed is None:
            allowed = -solution.level * self.asked.scale
        found = self.amplitudes(solution.unknowns)
        padded = np.pad(found, ((0, 0), (1, 1)), constant_values=-np.inf)
        peak = (found >= padded[:, :-2]) & (found >= padded[:, 2:])
        worse = peak & (found > allowed * (1.0 + WORSE))
        chosen = [(int(e), int(i)) for e, i in zip(*np.nonzero(worse), strict=True)]
        new = [pair for pair in chosen if pair not in self.taken]
        if new:
            self._add(new)
        return bool(new)

    def _add(self, pairs: list[tuple[int, int]]) -> None:
        self.taken.update(pairs)
        size, scale = self.problem.space.unknowns, self.asked.scale
        constant = np.zeros((len(pairs), 3))
        matrix = np.zeros((len(pairs), 3, size))
        for k, (event, speed) in enumerate(pairs):
            value, row = self.constant[event, speed], self.matrix[event, speed]
            constant[k, 1:] = 2.0 * value.real / scale, 2.0 * value.imag / scale
            matrix[k, 1:] = 2.0 * row.real / scale, 2.0 * row.imag / scale
        weight = np.zeros((len(pairs), 3))
        weight[:, 0] = self.asked.weight
        if self.asked.value is not None:
            constant[:, 0] = self.asked.value / scale - (SPARE if self.hull else 0.0)
        rows = Affine(constant.ravel(), sparse.csr_array(matrix.reshape(-1, size)))
        self.blocks.append(RowBlock(self.asked.name, rows, weight.ravel(), "cone", 3))

"""Residual vibration: the amplitude that an event alone leaves, at every speed of a range.

The amplitude is a function of 1/Ω as narrow in its spectrum as the event is long, so speeds even
in 1/Ω, so many a beat, show where its peaks are; each is then looked at where it is highest. A
program is given a few speeds, and then those at which its law is worst, until none is worse.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy import sparse

from cam_rig.arrays import FloatArray
from cam_rig.studies.design.constraints import SPARE, Asked
from cam_rig.studies.design.elastic.amplitude import Linear
from cam_rig.studies.design.elastic.mode import Cells
from cam_rig.studies.design.problem import DesignProblem
from cam_rig.studies.design.programs.affine import Affine
from cam_rig.studies.design.programs.program import ProgramSolution, RowBlock
from cam_rig.units import TURN

#: Speeds a beat: the largest between two of them is missed by 0.4 % at most.
A_BEAT, FIRST_EVERY = 32, 8
#: Peaks that are looked at are no farther below what is allowed, on the grid.
MISSED = 0.01
#: A cut is made where the law exceeds what the program allowed by so much.
WORSE = 1e-4
#: Speeds of a range, at most, and numbers of a table of phases that is made at once.
MAX_SPEEDS, MAX_TABLE = 4096, 2_000_000


def speeds_of(problem: DesignProblem, low: float, high: float) -> FloatArray:
    """Speeds (rad/s) of a range, falling and even in 1/Ω, so many a beat of the longest event."""
    if low == high:
        return np.array([low])
    longest = max(event.span for event in problem.space.events)
    beats = longest * problem.mode.rate.imag * (1.0 / low - 1.0 / high) / TURN
    count = min(MAX_SPEEDS, max(8, math.ceil(beats * A_BEAT)))
    return np.asarray(1.0 / np.linspace(1.0 / high, 1.0 / low, count + 1))


def peaks(speeds: FloatArray, amplitudes: FloatArray, above: float) -> FloatArray:
    """Where a curve ``(n,)`` over speeds even in 1/Ω is highest, at peaks above a value, rad/s.

    Of a parabola through the squares at three speeds; an end that is the highest is one too.
    """
    padded = np.pad(amplitudes, 1, constant_values=-np.inf)
    at = np.flatnonzero(
        (amplitudes >= padded[:-2]) & (amplitudes >= padded[2:]) & (amplitudes > above)
    )
    inner = (at > 0) & (at < amplitudes.size - 1)
    below, here, beyond = (amplitudes[(at[inner] + k)] ** 2 for k in (-1, 0, 1))
    bend = 2.0 * here - below - beyond
    shift = np.divide(0.5 * (beyond - below), bend, out=np.zeros(bend.size), where=bend > 0.0)
    found = 1.0 / speeds[at]
    found[inner] += shift * (1.0 / speeds[at[inner] + 1] - found[inner])
    return np.asarray(1.0 / found)


@lru_cache(maxsize=4)
def left(problem: DesignProblem, low: float, high: float) -> list[Linear]:
    """What each event leaves at the speeds of a range."""
    cells, speeds = Cells(problem.space, problem.mode, low), speeds_of(problem, low, high)
    return [left_by_event(cells, e, speeds) for e in range(len(problem.space.events))]


def left_by_event(cells: Cells, event: int, speeds: FloatArray) -> Linear:
    """What an event alone leaves where it ends, as a function of the unknowns, at speeds (rad/s).

    The amplitude's integral, see `mode`, by Gauss points.
    """
    mode, (slope, bend, columns) = cells.mode, cells.driving[event]
    points, weights = cells.gauss
    width = cells.width(event)
    angles = (width * (np.arange(cells.count)[:, None] + points)).ravel()
    share = np.tile(weights, cells.count) * width / (mode.rate - mode.rate.conjugate())
    constant = np.zeros(speeds.size, complex)
    matrix = np.zeros((speeds.size, cells.space.unknowns), complex)
    step = max(1, MAX_TABLE // angles.size)
    for first in range(0, speeds.size, step):
        some = slice(first, first + step)
        rate = mode.rate / speeds[some, None]
        fading = np.exp(rate * (cells.space.events[event].span - angles)) * share
        of_slope, of_bend = fading * mode.drive[0], fading * (mode.drive[1] * speeds[some, None])
        constant[some] = of_slope @ slope.constant + of_bend @ bend.constant
        matrix[some, columns] = of_slope @ slope.matrix + of_bend @ bend.matrix
    return Linear(constant, matrix)


@dataclass(eq=False)
class Residual:
    """Cones |2a| ≤ limit (or t) of every event at speeds of a range."""

    problem: DesignProblem
    asked: Asked
    hull: bool
    blocks: list[RowBlock] = field(default_factory=list)

    def __post_init__(self) -> None:
        term = self.asked.term
        self.cells = Cells(self.problem.space, self.problem.mode, term.low)
        self.speeds = speeds_of(self.problem, term.low, term.high)
        self.left = left(self.problem, term.low, term.high)
        for linear in self.left:
            self._add(Linear(linear.constant[::FIRST_EVERY], linear.matrix[::FIRST_EVERY]))

    def cut(self, solution: ProgramSolution) -> bool:
        """Add the speeds at which the law is worst, if worse than allowed; whether there are."""
        allowed = self.asked.value
        if allowed is None:
            allowed = -solution.level * self.asked.scale
        elif self.hull:
            allowed *= 1.0 - WORSE
        cut = False
        for event, linear in enumerate(self.left):
            found = 2.0 * np.abs(linear(solution.unknowns))
            highest = left_by_event(
                self.cells, event, peaks(self.speeds, found, allowed * (1.0 - MISSED))
            )
            worse = 2.0 * np.abs(highest(solution.unknowns)) > allowed * (1.0 + WORSE)
            if worse.any():
                self._add(Linear(highest.constant[worse], highest.matrix[worse]))
                cut = True
        return cut

    def _add(self, at: Linear) -> None:
        count, size, scale = at.constant.size, self.problem.space.unknowns, self.asked.scale
        constant = np.zeros((count, 3))
        matrix = np.zeros((count, 3, size))
        for place, part in ((1, np.real), (2, np.imag)):
            constant[:, place] = 2.0 * part(at.constant) / scale
            matrix[:, place] = 2.0 * part(at.matrix) / scale
        weight = np.zeros((count, 3))
        weight[:, 0] = self.asked.weight
        if self.asked.value is not None:
            spare = 1.0 - WORSE if self.hull else 1.0
            constant[:, 0] = self.asked.value / scale * spare - (SPARE if self.hull else 0.0)
        rows = Affine(constant.ravel(), sparse.csr_array(matrix.reshape(-1, size)))
        self.blocks.append(RowBlock(self.asked.name, rows, weight.ravel(), "cone", 3))

"""The least output of one vibration mode over a run, at many speeds at once.

A turn is cut into cells, the law's pieces or parts of long ones. What the output does not fall
below in a cell is told for all cells, turns and speeds together: by the polynomial less the whole
amplitude, and by the values at the cell's ends less what a curve of bounded bend may sag between
them. Only cells that may hold the least of all are looked at closer, in smaller cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.dynamics.modal.cells import CellTables, LawCells, Looks, closer
from cam_rig.dynamics.modal.response import ModalResponse
from cam_rig.dynamics.modal.sums import carried
from cam_rig.laws import bernstein
from cam_rig.units import TURN

#: What a grid of speeds may miss of the vibration between them.
GRID_MISSES = 0.01
#: For a bound over many speeds a piece is cut into parts no wider than this part of a turn.
FEW_CELLS = 24
#: What is left of a start that has faded.
FADED = 1e-17
#: Cells of all speeds and turns that are held in memory together.
TOGETHER = 1 << 20


@dataclass(frozen=True, eq=False)
class ModalRun:
    """How long a model runs: ``duration`` s from rest at θ = 0, or settled for ever (None).

    ``looks`` counts the values that its least outputs are found by.
    """

    model: ModalResponse
    duration: float | None
    looks: Looks = field(default_factory=Looks)

    def turns(self, speeds: FloatArray, turn: ComplexArray) -> ComplexArray:
        """Amplitude at the start of each turn, ``(m, turns, 2)``; one turn adds ``turn`` (m, 2).

        Turns after one that differs from the steady state by rounding alone are left out.
        """
        model = self.model
        if self.duration is None:
            return model.steady(speeds, turn)[:, None]
        flow = model.fading(speeds, TURN)[:, 0]
        count = int(np.ceil(speeds.max() * self.duration / TURN))
        fading = math.log(max(float(np.abs(flow).max()), 1e-300))
        if fading < 0.0:
            count = min(count, 1 + math.ceil(math.log(FADED) / fading))
        found = np.empty((speeds.size, count, 2), dtype=np.complex128)
        found[:, 0] = model.from_rest(speeds)
        for i in range(1, count):
            found[:, i] = flow * found[:, i - 1] + turn
        return found

    def above(self, low: float, high: float) -> bool:
        """Whether the output is proved above zero at every speed from one to another (rad/s).

        Each term of the polynomial is taken at the speed where it is least, each joint's
        amplitude at the higher one, and none cancels another. False proves nothing.
        """
        model = self.model
        if not model.light:
            return False
        top = np.array([high])
        powers = model.powers(top)[0]
        slow = np.where(powers > 0.0, low ** np.arange(float(powers.size)), 0.0)
        piece, rising, falling = self._signed_terms
        forced = (slow @ rising + powers @ falling).reshape(piece.size, -1).min(axis=1)
        jumps, start = model.largest_state_jumps(high)
        rate = np.array([[float(model.rates[0].real) / high]])
        angles = model.law.breaks[1:]
        own = carried(np.roll(jumps, -1)[None], angles, rate)[0]
        turns = np.inf if self.duration is None else np.ceil(high * self.duration / TURN)
        fade = float(np.exp(rate[0, 0] * TURN))
        whole = min(turns, 1.0 / (1.0 - fade) if fade < 1.0 else np.inf) * own[-1]
        whole += 0.0 if self.duration is None else start
        amplitude = whole * np.exp(rate[0] * model.law.breaks[:-1]) + np.append(0.0, own[:-1])
        return bool((forced + model.constant > amplitude[piece]).all())

    @cached_property
    def _signed_terms(self) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
        """The terms' ordinates that are positive, and those that are not, in parts of pieces.

        In short parts ordinates are near the polynomial. First comes the piece of each part.
        """
        terms = self.model.terms
        counts = np.ceil(self.model.law.spans * (FEW_CELLS / TURN)).astype(int)
        parts = []
        for i, count in enumerate(counts.tolist()):
            rows = terms[:, i].T
            cuts = [(k / count, (k + 1) / count) for k in range(count)]
            parts += [bernstein.restrict(rows, *cut) if count > 1 else rows for cut in cuts]
        flat = np.stack(parts).transpose(2, 0, 1).reshape(len(terms), -1)
        piece = np.repeat(np.arange(counts.size), counts)
        return piece, np.maximum(flat, 0.0), np.minimum(flat, 0.0)

    def missed(self, speeds: FloatArray) -> FloatArray:
        """By how much the least output between two neighbouring speeds may lie lower, ``(m,)``."""
        return np.asarray(GRID_MISSES * self.tables(speeds).amplitudes.max(axis=1))

    def least(self, speeds: FloatArray) -> FloatArray:
        """Least output of the run at each speed, ``(m,)``, to rounding."""
        tables = self.tables(speeds)
        found = np.full(speeds.size, np.inf)
        few = max(1, TOGETHER // (speeds.size * tables.cells.piece.size))
        for first in range(0, tables.turns.shape[1], few):
            turns = slice(first, first + few)
            self.looks.take(tables.turns[:, turns, 0].size * tables.cells.piece.size)
            closer(tables, tables.candidates(turns, found), found, self.looks)
        return found

    def lowest(self, speed: float) -> float:
        """Least output at one speed."""
        return float(self.least(np.array([speed]))[0])

    def tables(self, speeds: FloatArray) -> CellTables:
        """What bounds the output in the cells of a turn."""
        own = self.model.since_turn(speeds)
        turns = self.turns(speeds, own[:, -1])
        return CellTables(self.model, self._cells, self.duration, speeds, turns, own[:, :-1])

    @cached_property
    def _cells(self) -> LawCells:
        return LawCells.of(self.model.law)

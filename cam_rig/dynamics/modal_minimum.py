"""Cells of a turn, what an output does not fall below in each, and the search in the lowest."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.modal_response import ModalResponse, carried
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN, ComplexArray, FloatArray

#: A cell is no wider than this part of a turn.
MIN_CELLS = 192
#: A cell that may hold the least value is cut into so many.
CUT = 8
#: A least value is found to this part of the output's size.
EXACT = 1e-13
#: A value in a cut costs as much as so many in the first cells.
COSTS = 4
#: Cuts until rounding decides: 8^17 is 2^51.
MAX_CUTS = 17

Indices = NDArray[np.intp]


class TooManyLooksError(DynamicsError):
    """A search came to no end within the values of the output that it may look at."""


@dataclass
class Looks:
    """How many values of the output were looked at, of as many as may be."""

    most: float = math.inf
    count: int = 0

    def take(self, count: int) -> None:
        """So many more."""
        self.count += count
        if self.count > self.most:
            raise TooManyLooksError(f"more than {self.most:g} values to look at")


@dataclass(frozen=True, eq=False)
class LawCells:
    """The pieces of a law, the long ones cut, ``(c,)``."""

    piece: Indices
    low: FloatArray  #: where in the piece, rad
    width: FloatArray  #: rad
    ends: FloatArray  #: the law's basis at both ends of each cell, ``(2, c, p + 1)``

    @classmethod
    def of(cls, law: Law) -> LawCells:
        """The cells of a law."""
        count = np.ceil(law.spans * (MIN_CELLS / TURN)).astype(int)
        piece = np.repeat(np.arange(law.spans.size), count)
        inner = np.arange(piece.size) - np.repeat(np.cumsum(count) - count, count)
        width = (law.spans / count)[piece]
        u = np.stack([inner, inner + 1.0]) / count[piece]
        ends = bernstein.basis(law.degree, u.ravel()).reshape(2, piece.size, -1)
        return cls(piece, inner * width, width, ends)


class Candidates(NamedTuple):
    """Cells of some turn at some speed, ``(n,)``."""

    row: Indices  #: which speed
    piece: Indices
    low: FloatArray  #: where in it, rad
    width: FloatArray  #: rad
    amplitude: ComplexArray  #: at the start of the piece, ``(n, 2)``


@dataclass(frozen=True, eq=False)
class CellTables:
    """What holds for cells ``(c,)`` at speeds ``(m,)``."""

    model: ModalResponse
    cells: LawCells
    duration: float | None
    speeds: FloatArray  #: rad/s
    turns: ComplexArray  #: amplitude where each turn of a run begins, ``(m, t, 2)``
    own: ComplexArray  #: what the turn's joints have added where each piece begins, ``(m, n, 2)``

    @cached_property
    def forced(self) -> FloatArray:
        """Ordinates of the polynomial part, ``(m, n, p + 1)``."""
        return self.model.forced(self.speeds)

    @cached_property
    def bends(self) -> FloatArray:
        """What |d²/dθ²| of the polynomial part does not exceed in each piece, ``(m, n)``."""
        degree = self.model.law.degree
        if degree < 2:
            return np.zeros(self.forced.shape[:2])
        change = np.abs(np.diff(self.forced, n=2, axis=2)).max(axis=2)
        return np.asarray(degree * (degree - 1) * change / self.model.law.spans**2)

    @cached_property
    def edges(self) -> tuple[FloatArray, FloatArray]:
        """The polynomial part at the begin and at the end of each cell, ``(m, c)`` each."""
        begin, end = self.cells.ends
        pieces = self.forced[:, self.cells.piece]
        return np.einsum("mcp,cp->mc", pieces, begin), np.einsum("mcp,cp->mc", pieces, end)

    @cached_property
    def amplitudes(self) -> FloatArray:
        """What the free vibration does not exceed in any turn in each piece, ``(m, n)``."""
        start = self.model.envelope(self.turns).max(axis=1)
        start = start[:, None] * self.model.decay(self.speeds, self.model.law.breaks[:-1])
        return np.asarray(start + self.model.envelope(self.own))

    @cached_property
    def floors(self) -> FloatArray:
        """What the output does not fall below in each cell, in any turn, ``(m, c)``."""
        piece = self.cells.piece
        sag = self.bends[:, piece] * self.cells.width**2 / 8.0
        return np.asarray(np.minimum(*self.edges) - sag - self.amplitudes[:, piece])

    @cached_property
    def slack(self) -> FloatArray:
        """How near the least value is found, ``(m,)``."""
        size = np.abs(self.forced).max(axis=(1, 2)) + self.amplitudes.max(axis=1)
        return np.asarray(EXACT * size)

    def candidates(self, turns: slice, found: FloatArray) -> Candidates:
        """Cells of these turns that may hold a value below ``found`` ``(m,)``, lowered first."""
        begin, end = self._values(turns)
        begin[self._over(turns)] = np.inf
        np.minimum(found, begin.min(axis=(1, 2)), out=found)
        sag = self.bends + self.amplitudes * (self.model.bend_rate / self.speeds[:, None]) ** 2
        sag = sag[:, self.cells.piece] * (self.cells.width**2 / 8.0)
        low = np.maximum(np.minimum(begin, end) - sag[:, None], self.floors[:, None])
        low[begin == np.inf] = np.inf
        row, turn, cell = np.nonzero(low < (found - self.slack)[:, None, None])
        turn += turns.start
        piece, width = self.cells.piece[cell], self.cells.width[cell]
        before = self.model.law.breaks[piece]
        amplitude = self.turns[row, turn] * self.model.fading_at(before / self.speeds[row])
        if self.duration is not None:
            left = self.speeds[row] * self.duration - before - self.cells.low[cell] - TURN * turn
            width = np.minimum(width, left)
        amplitude += self.own[row, piece]
        return Candidates(row, piece, self.cells.low[cell], width, amplitude)

    def _values(self, turns: slice) -> tuple[FloatArray, FloatArray]:
        """The output at the begin and at the end of each cell of these turns, ``(m, t, c)``."""
        cells, rates, shown = self.cells, *self.model.shares
        borders = np.append(self.model.law.breaks[cells.piece] + cells.low, TURN)
        slowness = 1.0 / self.speeds[:, None, None]
        share = np.exp(rates[:, None] * borders * slowness) * shown[:, None]
        share = np.concatenate([share.real, -share.imag], axis=1)
        start = self.turns[:, turns, : rates.size]
        of_turns = np.concatenate([start.real, start.imag], axis=2) @ share
        own = self.own[:, cells.piece, : rates.size]
        found = []
        for local, forced in zip((cells.low, cells.low + cells.width), self.edges, strict=True):
            here = np.exp(local[:, None] * rates * slowness) * own
            found.append((forced + (here @ shown).real)[:, None])
        return of_turns[:, :, :-1] + found[0], of_turns[:, :, 1:] + found[1]

    def _over(self, turns: slice) -> NDArray[np.bool_]:
        """Which cells of these turns begin after the run, ``(m, t, c)``."""
        count = self.turns[:, turns].shape[1]
        if self.duration is None:
            return np.zeros((self.speeds.size, count, self.cells.piece.size), dtype=bool)
        begin = self.model.law.breaks[self.cells.piece] + self.cells.low
        angles = TURN * np.arange(turns.start, turns.start + count)[:, None] + begin
        return np.asarray(angles >= (self.speeds * self.duration)[:, None, None])


def closer(tables: CellTables, candidates: Candidates, found: FloatArray, looks: Looks) -> None:
    """Lower ``found`` ``(m,)`` to the least value in the candidates, cut again and again."""
    model, cut = tables.model, np.arange(CUT + 1.0) / CUT
    for _ in range(MAX_CUTS):
        if candidates.row.size == 0:
            return
        looks.take(COSTS * candidates.row.size * cut.size)
        row, piece, low, width, amplitude = candidates
        speed, span = tables.speeds[row], model.law.spans[piece]
        local = low[:, None] + width[:, None] * cut
        basis = bernstein.basis(model.law.degree, (local / span[:, None]).ravel())
        basis = basis.reshape(*local.shape, -1)
        forced = np.einsum("ncp,np->nc", basis, tables.forced[row, piece])
        free = amplitude[:, None] * model.fading_at(local / speed[:, None])
        values = forced + (free @ model.shown).real
        np.minimum.at(found, row, values.min(axis=1))
        sag, width = tables.bends[row, piece][:, None], width / CUT
        by_amplitude = np.minimum(forced[:, :-1], forced[:, 1:]) - model.envelope(free[:, :-1])
        by_amplitude -= sag * width[:, None] ** 2 / 8.0
        sag = sag + model.bend(free[:, :-1]) / speed[:, None] ** 2
        by_values = np.minimum(values[:, :-1], values[:, 1:]) - sag * width[:, None] ** 2 / 8.0
        open_ = np.maximum(by_amplitude, by_values) < (found - tables.slack)[row][:, None]
        here, which = np.nonzero(open_)
        candidates = Candidates(
            row[here], piece[here], local[here, which], width[here], amplitude[here]
        )


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
    """A model's run, and its least output at many speeds at once."""

    model: ModalResponse
    duration: float | None  #: s from rest at θ = 0; None is settled for ever
    looks: Looks = field(default_factory=Looks)

    def turns(self, speeds: FloatArray, turn: ComplexArray) -> ComplexArray:
        """Amplitude where each turn begins until it is steady; a turn adds ``turn`` ``(m, 2)``."""
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
        """The piece of each short part, and the terms' positive and other ordinates in it."""
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

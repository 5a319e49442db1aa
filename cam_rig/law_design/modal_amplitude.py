"""The follower's vibration as a linear function of a design's unknowns, at one speed.

One complex
amplitude a with (η, η̇) = 2 Re a (1, λ) grows by ∫ e^{λ(t − τ)} (d₁ ṡ + d₂ s̈)/(λ − λ̄) dτ, which
is linear in the law; Gauss points in cells of little phase give it to rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cam_rig.errors import ConfigError
from cam_rig.law_design.convex_program import Affine
from cam_rig.law_design.space import Space
from cam_rig.laws import bernstein
from cam_rig.quantities.mode import Mode
from cam_rig.units import TURN, ComplexArray, FloatArray, to_rpm

#: Gauss points of a cell, and the phase (rad) of the vibration in it at most.
GAUSS, CELL_PHASE = 5, 0.3

#: Cells of an event, at most.
MAX_CELLS = 8000


class Dense(NamedTuple):
    """Values c + A x, A dense."""

    constant: FloatArray
    matrix: FloatArray

    @classmethod
    def of(cls, affine: Affine) -> Dense:
        """Of sparse rows."""
        return cls(affine.constant, affine.matrix.toarray())

    @classmethod
    def sum(cls, weights: FloatArray, parts: list[Dense]) -> Dense:
        """Parts times weights, added."""
        pairs = list(zip(weights.tolist(), parts, strict=True))
        return cls(sum(w * p.constant for w, p in pairs), sum(w * p.matrix for w, p in pairs))

    @classmethod
    def joined(cls, parts: list[Dense]) -> Dense:
        """The values of all, one after the other."""
        return cls(
            np.concatenate([part.constant for part in parts]),
            np.concatenate([part.matrix for part in parts]),
        )


class Stretch(NamedTuple):
    """A dwell, or (where it has a number) an event: from and to (rad), and a dwell's lift (m)."""

    start: float
    end: float
    event: int | None
    level: float


@dataclass(frozen=True, eq=False)
class Cells:
    """The events of a space in cells, the law in them, and the dwells between.

    ``slowest`` (rad/s) is the lowest speed at which they are fine enough.
    """

    space: Space
    mode: Mode
    slowest: float

    @cached_property
    def per_piece(self) -> int:
        """Cells of one piece, so that the phase in each is small at the slowest speed."""
        pieces = self.space.law_class.pieces
        phase = max(event.span for event in self.space.events) * self.mode.rate.imag / self.slowest
        found = max(2, math.ceil(phase / pieces / CELL_PHASE))
        if found * pieces > MAX_CELLS:
            raise ConfigError(
                f"the stem vibrates {phase / TURN:.4g} times in an event at "
                f"{to_rpm(self.slowest):.4g} rpm; allowed for a design: "
                f"{MAX_CELLS * CELL_PHASE / TURN:.4g} times; so stiff a stem is nearly rigid: "
                "jump_speed_rigid"
            )
        return found

    @property
    def count(self) -> int:
        """Cells of one event."""
        return self.per_piece * self.space.law_class.pieces

    def width(self, event: int) -> float:
        """Of the cells of an event, rad."""
        return self.space.events[event].span / self.count

    @cached_property
    def gauss(self) -> tuple[FloatArray, FloatArray]:
        """Gauss points of [0, 1] and their weights."""
        points, weights = np.polynomial.legendre.leggauss(GAUSS)
        return 0.5 * (points + 1.0), 0.5 * weights

    @cached_property
    def driving(self) -> list[tuple[Dense, Dense, NDArray[np.intp]]]:
        """Of each event s' and s'' at its Gauss points, and the unknowns that they depend on."""
        u = ((np.arange(self.per_piece)[:, None] + self.gauss[0]) / self.per_piece).ravel()
        found = []
        for index in range(len(self.space.events)):
            one, two = (Dense.of(self._in(index, order, u)) for order in (1, 2))
            columns = np.flatnonzero(one.matrix.any(axis=0) | two.matrix.any(axis=0))
            found.append(
                (
                    Dense(one.constant, one.matrix[:, columns]),
                    Dense(two.constant, two.matrix[:, columns]),
                    columns,
                )
            )
        return found

    @cached_property
    def motion(self) -> list[list[Dense]]:
        """Of each event s, s', s'' at the end of each of its cells, on the left of joints."""
        u = np.arange(1, self.per_piece + 1) / self.per_piece
        return [
            [Dense.of(self._in(index, order, u)) for order in range(3)]
            for index in range(len(self.space.events))
        ]

    def _in(self, event: int, order: int, u: FloatArray) -> Affine:
        """A derivative at u of every piece of an event."""
        degree, count = self.space.degree - order, self.space.law_class.pieces
        first = int(np.searchsorted(self.space.breaks, self.space.events[event].start))
        rows = slice(first * (degree + 1), (first + count) * (degree + 1))
        table = sparse.kron(sparse.eye(count), bernstein.basis(degree, u), "csr")
        return self.space.derivative(order).rows(rows).mapped(sparse.csr_array(table))

    @cached_property
    def stretches(self) -> list[Stretch]:
        """Dwells and events of a turn, one after the other."""
        found, at = [], 0.0
        for index, event in enumerate(self.space.events):
            found.append(Stretch(at, event.start, None, event.first[0]))
            at = event.start + event.span
            found.append(Stretch(event.start, at, index, 0.0))
        return [*found, Stretch(at, TURN, None, self.space.events[-1].last[0])]


# EventVibration and contact force at one speed, as functions of a design's unknowns.

#: Places a period at which the force in a dwell is looked at, and for how many periods.
PER_PERIOD, PERIODS = 32, 1.25


@dataclass(frozen=True, eq=False)
class Linear:
    """Complex values c + A x, dense, of unknowns ``(m,)``: ``constant`` ``(n,)``, ``matrix``."""

    constant: ComplexArray
    matrix: ComplexArray

    def __call__(self, unknowns: FloatArray) -> ComplexArray:
        """The values."""
        return np.asarray(self.constant + self.matrix @ unknowns)

    def carried(self, factor: ComplexArray) -> Linear:
        """The one (last) value times factors ``(n,)``."""
        return Linear(factor * self.constant[-1], factor[:, None] * self.matrix[-1])

    def __add__(self, other: Linear) -> Linear:
        return Linear(self.constant + other.constant, self.matrix + other.matrix)


@dataclass(frozen=True, eq=False)
class EventVibration:
    """Amplitudes a at one speed (rad/s), of (η, η̇) = 2 Re a (1, λ)."""

    cells: Cells
    speed: float

    @cached_property
    def rate(self) -> complex:
        """λ/Ω, of the cam angle."""
        return self.cells.mode.rate / self.speed

    def own(self, event: int) -> Linear:
        """What an event alone excites, at the end of each of its cells."""
        cells, mode = self.cells, self.cells.mode
        points, weights = cells.gauss
        width, count = cells.width(event), cells.count
        reached = np.exp(self.rate * width * (1.0 - points)) * weights * width
        reached /= mode.rate - mode.rate.conjugate()
        both = np.stack([reached.real, reached.imag])
        slope, bend, columns = cells.driving[event]
        drive = (mode.drive[0], mode.drive[1] * self.speed)
        constant = drive[0] * slope.constant + drive[1] * bend.constant
        matrix = drive[0] * slope.matrix + drive[1] * bend.matrix
        real, imag = np.moveaxis(both @ matrix.reshape(count, points.size, -1), 1, 0)
        added = np.zeros((count, cells.space.unknowns), complex)
        added[:, columns] = real + 1j * imag
        fading = np.exp(self.rate * width * np.arange(1, count + 1))
        alone = constant.reshape(count, -1) @ reached
        return Linear(
            fading * np.cumsum(alone / fading),
            fading[:, None] * np.cumsum(added / fading[:, None], axis=0),
        )


class FirstTurn(NamedTuple):
    """A first turn from rest: angles ``(n,)``, the force there, and the amplitude at its end.

    ``moving`` says which are in events.
    """

    angles: FloatArray
    moving: NDArray[np.bool_]
    force: Dense
    end: Linear


@dataclass(frozen=True, eq=False)
class ForceAtSpeed:
    """The contact force (N) at one speed (rad/s), at the ends of cells and early in each dwell.

    Later in a dwell the vibration has only faded. FirstTurn k of a run from rest has what the turns
    before have left; the infinite one is the steady state.
    """

    cells: Cells
    speed: float

    @cached_property
    def first(self) -> FirstTurn:
        """The turn from rest."""
        cells, vibration = self.cells, EventVibration(self.cells, self.speed)
        weights = np.array(cells.mode.motion) * self.speed ** np.arange(3.0)
        size, edge = cells.space.unknowns, 0.0
        last = Linear(np.zeros(1, complex), np.zeros((1, size), complex))
        angles, moving, force = [], [], []
        for stretch in cells.stretches:
            here = self._places(stretch)
            if here.size == 0:
                continue
            amplitude = last.carried(np.exp(vibration.rate * (here - edge)))
            if stretch.event is None:
                level = np.full(here.size, weights[0] * stretch.level)
                still = Dense(level, np.zeros((here.size, size)))
            else:
                amplitude += vibration.own(stretch.event)
                still = Dense.sum(weights, cells.motion[stretch.event])
                last, edge = amplitude, float(here[-1])
            angles.append(here)
            moving.append(np.full(here.size, stretch.event is not None))
            force.append(self._force(still, amplitude))
        end = last.carried(np.exp(vibration.rate * np.array([TURN - edge])))
        return FirstTurn(np.concatenate(angles), np.concatenate(moving), Dense.joined(force), end)

    def _force(self, still: Dense, amplitude: Linear) -> Dense:
        """Of a follower that does not vibrate, and what its vibration adds."""
        mode = self.cells.mode
        return Dense(
            still.constant + mode.constant + 2.0 * (mode.shown * amplitude.constant).real,
            still.matrix + 2.0 * (mode.shown * amplitude.matrix).real,
        )

    def _places(self, stretch: Stretch) -> FloatArray:
        """Angles of an event's cells, or in a dwell as long as the first periods take."""
        if stretch.event is not None:
            width = self.cells.width(stretch.event)
            return np.asarray(stretch.start + width * np.arange(1.0, self.cells.count + 1.0))
        period = TURN / self.cells.mode.rate.imag * self.speed
        steps = np.arange(1.0, PERIODS * PER_PERIOD + 1.0) * period / PER_PERIOD
        return stretch.start + steps[steps < stretch.end - stretch.start]

    @cached_property
    def _before(self) -> ComplexArray:
        """The force of one amplitude that is there where a turn begins, ``(n,)``."""
        mode = self.cells.mode
        return np.asarray(2.0 * mode.shown * np.exp(mode.rate / self.speed * self.first.angles))

    def _turns_before(self, turns: FloatArray) -> ComplexArray:
        """How many of the amplitudes that one turn leaves are there where each turn begins."""
        flow = np.exp(self.cells.mode.rate / self.speed * TURN)
        left = np.where(np.isinf(turns), 0.0, flow ** np.where(np.isinf(turns), 0.0, turns - 1.0))
        return np.asarray((1.0 - left) / (1.0 - flow))

    def values(self, unknowns: FloatArray, turns: FloatArray) -> FloatArray:
        """The force in each of some turns, ``(len(turns), n)``."""
        left = self.first.end(unknowns)[0] * self._turns_before(turns)
        force = self.first.force
        here = force.constant + force.matrix @ unknowns
        more = np.outer(left.real, self._before.real) - np.outer(left.imag, self._before.imag)
        return np.asarray(here + more)

    def rows(self, chosen: NDArray[np.intp], turn: float) -> Dense:
        """The same as a function of the unknowns, at some of the places of one turn."""
        before = self._before[chosen] * self._turns_before(np.array([turn]))[0]
        end, force = self.first.end, self.first.force
        return Dense(
            force.constant[chosen] + (before * end.constant[0]).real,
            force.matrix[chosen] + (before[:, None] * end.matrix[0]).real,
        )

"""The follower's vibration as a linear function of a design's unknowns, at one speed.

One complex amplitude a with (η, η̇) = 2 Re a (1, λ) grows by
∫ e^{λ(t − τ)} (d₁ ṡ + d₂ s̈)/(λ − λ̄) dτ, which is linear in the law; Gauss points in cells of
little phase give it to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cam_rig.errors import ConfigError
from cam_rig.laws import bernstein
from cam_rig.quantities.values import VibrationMode
from cam_rig.studies.design.convex_program import Affine
from cam_rig.studies.design.space import Space
from cam_rig.units import TURN, ComplexArray, FloatArray, to_rpm

#: Gauss points of a cell, and the phase (rad) of the vibration in it at most.
GAUSS, CELL_PHASE = 5, 0.3
#: Cells of an event, at most.
MAX_CELLS = 8000
#: Places a period at which the force in a dwell is looked at, and for how many periods.
PER_PERIOD, PERIODS = 32, 1.25


@dataclass(eq=False)
class Cells:
    """The events of a space in cells, fine enough for speeds down to the ``slowest`` (rad/s).

    The phase in each is small; an event has ``count`` cells. ``gauss`` are Gauss points of [0, 1]
    and their weights.
    """

    space: Space
    mode: VibrationMode
    slowest: float

    def __post_init__(self) -> None:
        pieces = self.space.law_class.pieces
        phase = max(event.span for event in self.space.events) * self.mode.rate.imag / self.slowest
        self.per_piece = max(2, math.ceil(phase / pieces / CELL_PHASE))
        self.count = self.per_piece * pieces
        if self.count > MAX_CELLS:
            raise ConfigError(
                f"the stem vibrates {phase / TURN:.4g} times in an event at "
                f"{to_rpm(self.slowest):.4g} rpm; allowed for a design: "
                f"{MAX_CELLS * CELL_PHASE / TURN:.4g} times; so stiff a stem is nearly rigid: "
                "jump_speed_rigid"
            )
        points, weights = np.polynomial.legendre.leggauss(GAUSS)
        self.gauss = 0.5 * (points + 1.0), 0.5 * weights

    def width(self, event: int) -> float:
        """Of the cells of an event, rad."""
        return self.space.events[event].span / self.count

    @cached_property
    def driving(self) -> list[tuple[Affine, Affine, NDArray[np.intp]]]:
        """Of each event s' and s'' at its Gauss points, and the unknowns that they depend on."""
        u = ((np.arange(self.per_piece)[:, None] + self.gauss[0]) / self.per_piece).ravel()
        found = []
        for index in range(len(self.space.events)):
            one, two = (self._in(index, order, u) for order in (1, 2))
            columns = np.flatnonzero(one.matrix.any(axis=0) | two.matrix.any(axis=0))
            few = [Affine(part.constant, part.matrix[:, columns]) for part in (one, two)]
            found.append((few[0], few[1], columns))
        return found

    @cached_property
    def motion(self) -> list[list[Affine]]:
        """Of each event s, s', s'' at the end of each of its cells, on the left of joints."""
        u = np.arange(1, self.per_piece + 1) / self.per_piece
        events = range(len(self.space.events))
        return [[self._in(index, order, u) for order in range(3)] for index in events]

    def _in(self, event: int, order: int, u: FloatArray) -> Affine:
        """A derivative at u of every piece of an event."""
        degree, count = self.space.degree - order, self.space.law_class.pieces
        first = int(np.searchsorted(self.space.breaks, self.space.events[event].start))
        rows = slice(first * (degree + 1), (first + count) * (degree + 1))
        table = sparse.kron(sparse.eye_array(count), bernstein.basis(degree, u), "csr")
        return self.space.derivative(order).rows(rows).mapped(table).dense()

    def stretches(self) -> Iterator[tuple[float, float, int | None]]:
        """Dwells and (with their number) events of a turn in turn, each from and to (rad)."""
        at = 0.0
        for index, event in enumerate(self.space.events):
            yield at, event.start, None
            at = event.start + event.span
            yield event.start, at, index
        yield at, TURN, None


class FirstTurn(NamedTuple):
    """From rest: angles ``(n,)``, which are in events, force there, amplitude at the end."""

    angles: FloatArray
    moving: NDArray[np.bool_]
    force: Affine
    end: Affine


@dataclass(frozen=True, eq=False)
class ForceAtSpeed:
    """The contact force (N) at one speed (rad/s), at the ends of cells and early in each dwell.

    Later in a dwell the vibration has only faded. Turn k of a run from rest has what the turns
    before have left; the infinite one is the steady state.
    """

    cells: Cells
    speed: float

    @cached_property
    def rate(self) -> complex:
        """λ/Ω, of the cam angle."""
        return self.cells.mode.rate / self.speed

    @cached_property
    def first(self) -> FirstTurn:
        """The turn from rest."""
        cells, mode = self.cells, self.cells.mode
        weights = (np.array(mode.motion) * self.speed ** np.arange(3.0)).tolist()
        size, edge = cells.space.unknowns, 0.0
        last = Affine(np.zeros(1, complex), np.zeros((1, size), complex))
        angles, moving, force = [], [], []
        for start, stop, event in cells.stretches():
            here = self._places(start, stop, event)
            if here.size == 0:
                continue
            amplitude = _carried(last, np.exp(self.rate * (here - edge)))
            if event is None:
                level = weights[0] * cells.space.start.at(start)[0]
                still = Affine(np.full(here.size, level), np.zeros((here.size, size)))
            else:
                amplitude += self._excited(event)
                lift, slope, curvature = cells.motion[event]
                still = lift * weights[0] + slope * weights[1] + curvature * weights[2]
                last, edge = amplitude, float(here[-1])
            angles.append(here)
            moving.append(np.full(here.size, event is not None))
            constant = 2.0 * (mode.shown * amplitude.constant).real
            matrix = 2.0 * (mode.shown * amplitude.matrix).real
            force.append(still.plus(mode.constant) + Affine(constant, matrix))
        end = _carried(last, np.exp(self.rate * np.array([TURN - edge])))
        return FirstTurn(np.concatenate(angles), np.concatenate(moving), Affine.stacked(force), end)

    def _excited(self, event: int) -> Affine:
        """The amplitude that an event alone excites, at the end of each of its cells."""
        cells, mode = self.cells, self.cells.mode
        points, weights = cells.gauss
        width, count = cells.width(event), cells.count
        reached = np.exp(self.rate * width * (1.0 - points)) * weights * width
        reached /= mode.rate - mode.rate.conjugate()
        both = np.stack([reached.real, reached.imag])
        slope, curvature, columns = cells.driving[event]
        drive = slope * mode.drive[0] + curvature * (mode.drive[1] * self.speed)
        real, imag = np.moveaxis(both @ drive.matrix.reshape(count, points.size, -1), 1, 0)
        added = np.zeros((count, cells.space.unknowns), complex)
        added[:, columns] = real + 1j * imag
        fading = np.exp(self.rate * width * np.arange(1, count + 1))
        alone = drive.constant.reshape(count, -1) @ reached
        return Affine(
            fading * np.cumsum(alone / fading),
            fading[:, None] * np.cumsum(added / fading[:, None], axis=0),
        )

    def _places(self, start: float, stop: float, event: int | None) -> FloatArray:
        """Angles of an event's cells, or in a dwell as long as the first periods take."""
        if event is not None:
            width = self.cells.width(event)
            return np.asarray(start + width * np.arange(1.0, self.cells.count + 1.0))
        period = TURN / self.cells.mode.rate.imag * self.speed
        steps = np.arange(1.0, PERIODS * PER_PERIOD + 1.0) * period / PER_PERIOD
        return start + steps[steps < stop - start]

    @cached_property
    def _before(self) -> ComplexArray:
        """The force of one amplitude that is there where a turn begins, ``(n,)``."""
        return np.asarray(2.0 * self.cells.mode.shown * np.exp(self.rate * self.first.angles))

    def _turns_before(self, turns: FloatArray) -> ComplexArray:
        """How many of the amplitudes that one turn leaves are there where each turn begins."""
        flow = np.exp(self.rate * TURN)
        left = np.where(np.isinf(turns), 0.0, flow ** np.where(np.isinf(turns), 0.0, turns - 1.0))
        return np.asarray((1.0 - left) / (1.0 - flow))

    def values(self, unknowns: FloatArray, turns: FloatArray) -> FloatArray:
        """The force in each of some turns, ``(len(turns), n)``."""
        left = self.first.end(unknowns)[0] * self._turns_before(turns)
        more = np.outer(left.real, self._before.real) - np.outer(left.imag, self._before.imag)
        return np.asarray(self.first.force(unknowns) + more)

    def rows(self, chosen: NDArray[np.intp], turn: float) -> Affine:
        """The same as a function of the unknowns, at some of the places of one turn."""
        before = self._before[chosen] * self._turns_before(np.array([turn]))[0]
        end, force = self.first.end, self.first.force.rows(chosen)
        matrix = (before[:, None] * end.matrix[0]).real
        return force + Affine((before * end.constant[0]).real, matrix)


def _carried(last: Affine, factor: ComplexArray) -> Affine:
    """The one (last) value times factors ``(n,)``."""
    return Affine(factor * last.constant[-1], factor[:, None] * last.matrix[-1])

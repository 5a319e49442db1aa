"""EventVibration and contact force at one speed, as functions of a design's unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.studies.design.elastic.mode import Cells, Dense, Stretch
from cam_rig.units import TURN

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

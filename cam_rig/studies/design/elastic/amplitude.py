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

    @classmethod
    def joined(cls, parts: list[Linear]) -> Linear:
        """The values of all, one after the other."""
        return cls(
            np.concatenate([part.constant for part in parts]),
            np.concatenate([part.matrix for part in parts]),
        )

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
    """A first turn from rest: angles ``(n,)``, amplitudes there and at its end, force without.

    ``moving`` says which are in events.
    """

    angles: FloatArray
    moving: NDArray[np.bool_]
    amplitude: Linear
    end: Linear
    still: Dense


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
        angles, moving, amplitudes, still = [], [], [], []
        for stretch in cells.stretches:
            here = self._places(stretch)
            if here.size == 0:
                continue
            amplitude = last.carried(np.exp(vibration.rate * (here - edge)))
            if stretch.event is None:
                level = np.full(here.size, weights[0] * stretch.level)
                still.append(Dense(level, np.zeros((here.size, size))))
            else:
                amplitude += vibration.own(stretch.event)
                still.append(Dense.sum(weights, cells.motion[stretch.event]))
                last, edge = amplitude, float(here[-1])
            angles.append(here)
            moving.append(np.full(here.size, stretch.event is not None))
            amplitudes.append(amplitude)
        end = last.carried(np.exp(vibration.rate * np.array([TURN - edge])))
        joined = Linear.joined(amplitudes), end, Dense.joined(still)
        return FirstTurn(np.concatenate(angles), np.concatenate(moving), *joined)

    def _places(self, stretch: Stretch) -> FloatArray:
        """Angles of an event's cells, or in a dwell as long as the first periods take."""
        if stretch.event is not None:
            width = self.cells.width(stretch.event)
            return np.asarray(stretch.start + width * np.arange(1.0, self.cells.count + 1.0))
        period = TURN / self.cells.mode.rate.imag * self.speed
        steps = np.arange(1.0, PERIODS * PER_PERIOD + 1.0) * period / PER_PERIOD
        return stretch.start + steps[steps < stretch.end - stretch.start]

    @cached_property
    def force(self) -> Dense:
        """The first turn's force."""
        mode, (_, _, amplitude, _, still) = self.cells.mode, self.first
        return Dense(
            still.constant + mode.constant + 2.0 * (mode.shown * amplitude.constant).real,
            still.matrix + 2.0 * (mode.shown * amplitude.matrix).real,
        )

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
        here = self.force.constant + self.force.matrix @ unknowns
        more = np.outer(left.real, self._before.real) - np.outer(left.imag, self._before.imag)
        return np.asarray(here + more)

    def rows(self, chosen: NDArray[np.intp], turn: float) -> Dense:
        """The same as a function of the unknowns, at some of the places of one turn."""
        before = self._before[chosen] * self._turns_before(np.array([turn]))[0]
        end = self.first.end
        return Dense(
            self.force.constant[chosen] + (before * end.constant[0]).real,
            self.force.matrix[chosen] + (before[:, None] * end.matrix[0]).real,
        )

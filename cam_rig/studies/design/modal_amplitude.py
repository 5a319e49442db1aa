"""Vibration of the follower at one speed, linear in the unknowns of a design.

The complex amplitude a, with (η, η̇) = 2 Re a (1, λ), grows by
∫ e^{λ(t − τ)} (d₁ ṡ + d₂ s̈)/(λ − λ̄) dτ. This is linear in the law. Gauss points in cells of small
phase give it to rounding.
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

#: Number of Gauss points per cell of an event.
GAUSS = 5
#: Largest phase (rad) by which the stem vibrates within a cell.
CELL_PHASE = 0.3
#: Largest number of cells per event.
MAX_CELLS = 8000
#: Number of points per period of the stem at which the force in a dwell is evaluated.
PER_PERIOD = 32
#: Number of periods of the stem from the start of a dwell in which the force is evaluated.
PERIODS = 1.25


@dataclass(eq=False)
class Cells:
    """Division of the events into cells in which the phase of the vibration is small.

    The phase is small at all speeds from ``slowest`` (rad/s) on. An event has ``count`` cells.
    ``gauss`` are the Gauss points of [0, 1] and their weights.
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
                f"the stem may vibrate {MAX_CELLS * CELL_PHASE / TURN:.4g} times in an event of a "
                f"design, got {phase / TURN:.4g} times at {to_rpm(self.slowest):.4g} rpm; such a "
                "stem is nearly rigid, so use jump_speed_rigid"
            )
        points, weights = np.polynomial.legendre.leggauss(GAUSS)
        self.gauss = 0.5 * (points + 1.0), 0.5 * weights

    def width(self, event: int) -> float:
        """Return the width of the cells of an event (by its index), rad."""
        return self.space.events[event].span / self.count

    @cached_property
    def driving(self) -> list[tuple[Affine, Affine, NDArray[np.intp]]]:
        """Slope s' and curvature s'' at the Gauss points of each event, and the unknowns.

        The unknowns are given by their indices.
        """
        u = ((np.arange(self.per_piece)[:, None] + self.gauss[0]) / self.per_piece).ravel()
        driving = []
        for index in range(len(self.space.events)):
            slope, curvature = (self._derivative_at(index, order, u) for order in (1, 2))
            columns = np.flatnonzero(slope.matrix.any(axis=0) | curvature.matrix.any(axis=0))
            reduced = [Affine(x.constant, x.matrix[:, columns]) for x in (slope, curvature)]
            driving.append((reduced[0], reduced[1], columns))
        return driving

    @cached_property
    def motion(self) -> list[list[Affine]]:
        """Motion s, s' and s'' of each event at the ends of its cells, left of joints."""
        u = np.arange(1, self.per_piece + 1) / self.per_piece
        events = range(len(self.space.events))
        return [[self._derivative_at(index, order, u) for order in range(3)] for index in events]

    def _derivative_at(self, event: int, order: int, u: FloatArray) -> Affine:
        """Return a derivative of s at the position u of every piece of an event.

        ``order`` is the order of the derivative.
        """
        degree, count = self.space.degree - order, self.space.law_class.pieces
        first = int(np.searchsorted(self.space.breaks, self.space.events[event].start))
        rows = slice(first * (degree + 1), (first + count) * (degree + 1))
        table = sparse.kron(sparse.eye_array(count), bernstein.basis(degree, u), "csr")
        return self.space.derivative(order).rows(rows).mapped(table).dense()

    def stretches(self) -> Iterator[tuple[float, float, int | None]]:
        """Yield start angle, end angle (rad) and index of each event and dwell in order.

        The index of a dwell is None.
        """
        angle = 0.0
        for index, event in enumerate(self.space.events):
            yield angle, event.start, None
            angle = event.start + event.span
            yield event.start, angle, index
        yield angle, TURN, None


class FirstTurn(NamedTuple):
    """First turn of a run from rest: angles ``(n,)``, contact force, final amplitude.

    ``moving`` is True at the angles within events.
    """

    angles: FloatArray
    moving: NDArray[np.bool_]
    force: Affine
    end: Affine


@dataclass(frozen=True, eq=False)
class ForceAtSpeed:
    """Contact force (N) of two masses at one speed (rad/s), linear in the unknowns.

    It is evaluated at the ends of cells and early in each dwell. Later in a dwell the vibration
    only decays. Turn k of a run from rest contains the remainder of the vibration of all earlier
    turns. Turn ∞ is the steady state.
    """

    cells: Cells
    speed: float

    @cached_property
    def rate(self) -> complex:
        """Growth rate λ/Ω of the complex amplitude per cam angle."""
        return self.cells.mode.rate / self.speed

    @cached_property
    def first(self) -> FirstTurn:
        """Contact force in the first turn of a run from rest."""
        cells, mode = self.cells, self.cells.mode
        weights = (np.array(mode.motion) * self.speed ** np.arange(3.0)).tolist()
        size, edge = cells.space.unknowns, 0.0
        last = Affine(np.zeros(1, complex), np.zeros((1, size), complex))
        angles, moving, force = [], [], []
        for start, stop, event in cells.stretches():
            theta = self._angles_of(start, stop, event)
            if theta.size == 0:
                continue
            amplitude = _scale_last(last, np.exp(self.rate * (theta - edge)))
            if event is None:
                level = weights[0] * cells.space.start.at(start)[0]
                static = Affine(np.full(theta.size, level), np.zeros((theta.size, size)))
            else:
                amplitude += self._amplitude_of_event(event)
                lift, slope, curvature = cells.motion[event]
                static = lift * weights[0] + slope * weights[1] + curvature * weights[2]
                last, edge = amplitude, float(theta[-1])
            angles.append(theta)
            moving.append(np.full(theta.size, event is not None))
            constant = 2.0 * (mode.force_factor * amplitude.constant).real
            matrix = 2.0 * (mode.force_factor * amplitude.matrix).real
            force.append(static.plus(mode.constant) + Affine(constant, matrix))
        end = _scale_last(last, np.exp(self.rate * np.array([TURN - edge])))
        return FirstTurn(np.concatenate(angles), np.concatenate(moving), Affine.stacked(force), end)

    def _amplitude_of_event(self, event: int) -> Affine:
        """Return the amplitude that an event excites by itself, at the ends of its cells."""
        cells, mode = self.cells, self.cells.mode
        points, weights = cells.gauss
        width, count = cells.width(event), cells.count
        response = np.exp(self.rate * width * (1.0 - points)) * weights * width
        response /= mode.rate - mode.rate.conjugate()
        parts = np.stack([response.real, response.imag])
        slope, curvature, columns = cells.driving[event]
        drive = slope * mode.drive[0] + curvature * (mode.drive[1] * self.speed)
        real, imag = np.moveaxis(parts @ drive.matrix.reshape(count, points.size, -1), 1, 0)
        added = np.zeros((count, cells.space.unknowns), complex)
        added[:, columns] = real + 1j * imag
        fading = np.exp(self.rate * width * np.arange(1, count + 1))
        constant = drive.constant.reshape(count, -1) @ response
        return Affine(
            fading * np.cumsum(constant / fading),
            fading[:, None] * np.cumsum(added / fading[:, None], axis=0),
        )

    def _angles_of(self, start: float, stop: float, event: int | None) -> FloatArray:
        """Return the cam angles (rad) at which the force is evaluated, shape ``(n,)``.

        In an event they are the ends of its cells. In a dwell (``event`` None) they are equally
        spaced over the first `PERIODS` periods of the stem. ``start`` and ``stop`` (rad) are the
        ends of the event or dwell.
        """
        if event is not None:
            width = self.cells.width(event)
            return np.asarray(start + width * np.arange(1.0, self.cells.count + 1.0))
        period = TURN / self.cells.mode.rate.imag * self.speed
        steps = np.arange(1.0, PERIODS * PER_PERIOD + 1.0) * period / PER_PERIOD
        return start + steps[steps < stop - start]

    @cached_property
    def _before(self) -> ComplexArray:
        """Contact force by a unit amplitude at the start of a turn, ``(n,)``."""
        return np.asarray(
            2.0 * self.cells.mode.force_factor * np.exp(self.rate * self.first.angles)
        )

    def _turns_before(self, turns: FloatArray) -> ComplexArray:
        """Return each turn's initial amplitude per unit of the first's final amplitude.

        ``turns`` are numbers of turns, ∞ for the steady state.
        """
        flow = np.exp(self.rate * TURN)
        decay = np.where(np.isinf(turns), 0.0, flow ** np.where(np.isinf(turns), 0.0, turns - 1.0))
        return np.asarray((1.0 - decay) / (1.0 - flow))

    def values(self, unknowns: FloatArray, turns: FloatArray) -> FloatArray:
        """Return the contact force (N) in each of several turns, ``(len(turns), n)``."""
        amplitude = self.first.end(unknowns)[0] * self._turns_before(turns)
        vibration = np.outer(amplitude.real, self._before.real) - np.outer(
            amplitude.imag, self._before.imag
        )
        return np.asarray(self.first.force(unknowns) + vibration)

    def rows(self, chosen: NDArray[np.intp], turn: float) -> Affine:
        """Return the contact force at some angles of one turn, linear in the unknowns.

        ``chosen`` are the indices of the angles, ``turn`` is ∞ for the steady state.
        """
        before = self._before[chosen] * self._turns_before(np.array([turn]))[0]
        end, force = self.first.end, self.first.force.rows(chosen)
        matrix = (before[:, None] * end.matrix[0]).real
        return force + Affine((before * end.constant[0]).real, matrix)


def _scale_last(last: Affine, factor: ComplexArray) -> Affine:
    """Return the last value of a function times the factors ``(n,)``."""
    return Affine(factor * last.constant[-1], factor[:, None] * last.matrix[-1])

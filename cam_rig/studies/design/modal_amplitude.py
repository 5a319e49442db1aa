"""Vibration of the follower at one speed, as a linear function of the law.

The vibration η of the end mass has the complex amplitude a, with (η, η̇) = 2 Re a (1, λ), where λ
is the eigenvalue of the mode. The law adds ∫ e^{λ(t − τ)} (d₁ ṡ + d₂ s̈)/(λ − λ̄) dτ to a, with two
drive factors d₁ and d₂. This integral is linear in the unknowns of a design. Gauss points in cells
of small phase compute it up to rounding.
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

#: Number of Gauss points per cell. Each event (motion between two dwells) is divided into equal
#: cells.
GAUSS = 5
#: Largest phase change (rad) of the stem's vibration within a cell, an interval of numerical
#: integration over the cam angle.
CELL_PHASE = 0.3
#: Largest number of cells (intervals of integration) per event, the motion between two dwells. It
#: limits time and memory.
MAX_CELLS = 8000
#: Number of points per period of the stem's vibration at which the force in a dwell is evaluated.
PER_PERIOD = 32
#: Number of periods of the stem's vibration after the start of a dwell in which the contact force
#: is evaluated. Later the vibration only decays.
PERIODS = 1.25


@dataclass(eq=False)
class Cells:
    """Division of the events of a law into cells for the integration of the vibration.

    An event is the motion between two dwells. It is divided into ``count`` cells of equal width,
    which are so small that the phase of the vibration changes little within a cell at all speeds
    from ``slowest`` (rad/s) up. ``gauss`` are the Gauss points of the interval [0, 1] and their
    weights.
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
        """Return the width (rad) of each cell of an event.

        ``event`` is the number of the event, from 0. An event is the motion between two dwells.
        """
        return self.space.events[event].span / self.count

    @cached_property
    def driving(self) -> list[tuple[Affine, Affine, NDArray[np.intp]]]:
        """Values of s' and s'' at the Gauss points of each event, as functions.

        There is one entry per event (motion between two dwells). It contains two functions, for s'
        and s'', and the indices of the unknowns that they depend on. The columns of the functions
        are these unknowns only.
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
        """Values of s, s' and s'' at the ends of the cells of each event, as functions.

        An event is the motion between two dwells. The functions are those of the design's unknowns.
        At a joint between two polynomial pieces they are left-hand limits.
        """
        u = np.arange(1, self.per_piece + 1) / self.per_piece
        events = range(len(self.space.events))
        return [[self._derivative_at(index, order, u) for order in range(3)] for index in events]

    def _derivative_at(self, event: int, order: int, u: FloatArray) -> Affine:
        """Return a derivative of s at the same positions of each piece of an event.

        ``event`` is the number of the event, from 0, and ``order`` the order of the derivative.
        ``u`` are the positions in a piece, from 0 to 1. An event is the motion between two dwells.
        """
        degree, count = self.space.degree - order, self.space.law_class.pieces
        first = int(np.searchsorted(self.space.breaks, self.space.events[event].start))
        rows = slice(first * (degree + 1), (first + count) * (degree + 1))
        table = sparse.kron(sparse.eye_array(count), bernstein.basis(degree, u), "csr")
        return self.space.derivative(order).rows(rows).mapped(table).dense()

    def stretches(self) -> Iterator[tuple[float, float, int | None]]:
        """Yield start angle, end angle (rad) and number of each event and dwell in order.

        Events are numbered from 0. The number is None for a dwell. An event is the motion between
        two dwells.
        """
        angle = 0.0
        for index, event in enumerate(self.space.events):
            yield angle, event.start, None
            angle = event.start + event.span
            yield event.start, angle, index
        yield angle, TURN, None


class FirstTurn(NamedTuple):
    """Contact force in the first turn of a run from rest.

    ``angles`` ``(n,)`` are the evaluated cam angles in rad, and ``moving`` is True for those within
    events. ``force`` is the contact force in N at the angles. ``end`` is the complex amplitude of
    the vibration at the end of the turn. Both are functions of the unknowns. An event is the motion
    between two dwells.
    """

    angles: FloatArray
    moving: NDArray[np.bool_]
    force: Affine
    end: Affine


@dataclass(frozen=True, eq=False)
class ForceAtSpeed:
    """Contact force (N) of two masses at one speed, linear in the unknowns.

    ``speed`` is in rad/s. The unknowns describe the law of a design. The force is evaluated at the
    ends of cells and early in each dwell, because later in a dwell the vibration only decays. Turns
    of a run from rest are counted from 1. Each turn contains the vibration that the earlier turns
    left. Turn ∞ is the steady state.
    """

    cells: Cells
    speed: float

    @cached_property
    def rate(self) -> complex:
        """Eigenvalue λ of the vibration divided by the speed, per rad of cam angle.

        Its real part is the growth rate of the amplitude (negative), its imaginary part the phase
        rate.
        """
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
        """Return the complex vibration amplitude that an event excites by itself.

        ``event`` is the number of the event (motion between two dwells). The result is a function
        of the unknowns, with one value per end of the event's cells. Vibration from before the
        event is not included.
        """
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
        ends of the event or dwell. An event is the motion between two dwells.
        """
        if event is not None:
            width = self.cells.width(event)
            return np.asarray(start + width * np.arange(1.0, self.cells.count + 1.0))
        period = TURN / self.cells.mode.rate.imag * self.speed
        steps = np.arange(1.0, PERIODS * PER_PERIOD + 1.0) * period / PER_PERIOD
        return start + steps[steps < stop - start]

    @cached_property
    def _before(self) -> ComplexArray:
        """Contact force (N) due to vibration that is left from before the turn.

        The values are for a unit amplitude at the start of the turn, complex with shape ``(n,)``,
        one per evaluated angle. For an amplitude a the force is the real part of a times this
        value.
        """
        return np.asarray(
            2.0 * self.cells.mode.force_factor * np.exp(self.rate * self.first.angles)
        )

    def _turns_before(self, turns: FloatArray) -> ComplexArray:
        """Return the vibration amplitude that earlier turns leave at the start of a turn.

        It is relative to the amplitude at the end of the first turn. ``turns`` are the numbers of
        the turns from 1, ∞ for the steady state. The result is complex, one value per number.
        """
        flow = np.exp(self.rate * TURN)
        decay = np.where(np.isinf(turns), 0.0, flow ** np.where(np.isinf(turns), 0.0, turns - 1.0))
        return np.asarray((1.0 - decay) / (1.0 - flow))

    def values(self, unknowns: FloatArray, turns: FloatArray) -> FloatArray:
        """Return the contact force (N) of a law in several turns, ``(len(turns), n)``.

        ``unknowns`` describe the law. The columns are the n evaluated angles of a turn.
        """
        amplitude = self.first.end(unknowns)[0] * self._turns_before(turns)
        vibration = np.outer(amplitude.real, self._before.real) - np.outer(
            amplitude.imag, self._before.imag
        )
        return np.asarray(self.first.force(unknowns) + vibration)

    def rows(self, chosen: NDArray[np.intp], turn: float) -> Affine:
        """Return the contact force (N) at some angles of one turn.

        It is a function of the unknowns. ``chosen`` are the indices of the angles. ``turn`` is the
        number of the turn from 1, ∞ for the steady state.
        """
        before = self._before[chosen] * self._turns_before(np.array([turn]))[0]
        end, force = self.first.end, self.first.force.rows(chosen)
        matrix = (before[:, None] * end.matrix[0]).real
        return force + Affine((before * end.constant[0]).real, matrix)


def _scale_last(last: Affine, factor: ComplexArray) -> Affine:
    """Return the last value of ``last`` times each of n complex factors.

    The result is an affine function with n values. It describes how a vibration amplitude at one
    angle decays to n later angles.
    """
    return Affine(factor * last.constant[-1], factor[:, None] * last.matrix[-1])

"""The least output of one vibration mode over a run, at many speeds at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.dynamics.modal.response import ModalResponse
from cam_rig.laws import bernstein
from cam_rig.units import TURN

#: Grid points a period of the mode, and at least, of a turn.
PER_PERIOD, MIN_PER_TURN = 24, 256
#: Points of a piece at which a bound looks at the polynomial.
BOUND_POINTS = 33
#: Points of a second look at one low point, and what the grid may miss of the vibration there.
CLOSER, GRID_MISSES = 65, 0.01


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A piece of the law at some of its points: polynomial ``(m, q)``, what an amplitude shows."""

    angles: FloatArray
    forced: FloatArray
    factors: ComplexArray

    @classmethod
    def of(cls, model: ModalResponse, speeds: FloatArray, piece: int, u: FloatArray) -> _Stretch:
        local = model.law.spans[piece] * u
        basis = bernstein.basis(model.law.degree, u)
        factors = model.fading(speeds, local) * model.shown
        if np.iscomplex(model.rates).all():  # of two conjugate rates one tells all
            factors = 2.0 * factors[:, :, :1]
        forced = model.forced(speeds, piece, basis)
        return cls(model.law.breaks[piece] + local, forced, factors)

    def values(self, amplitude: ComplexArray) -> FloatArray:
        """The output, ``(m, q)``, from amplitudes ``(m, 2)`` at the start of the piece."""
        out = self.forced.copy()
        for r in range(self.factors.shape[2]):
            out += (amplitude[:, None, r] * self.factors[:, :, r]).real
        return out


@dataclass(frozen=True, eq=False)
class ModalRun:
    """How long a model runs: ``duration`` s from rest at θ = 0, or settled for ever (None)."""

    model: ModalResponse
    duration: float | None

    def turns(self, speeds: FloatArray) -> Iterator[ComplexArray]:
        """Amplitude at the start of each turn, ``(m, 2)``."""
        model = self.model
        if self.duration is None:
            yield model.steady(speeds)
            return
        flow, turn = model.fading(speeds, TURN)[:, 0], model.since_turn(speeds)[:, -1]
        amplitude = model.from_rest(speeds)
        for _ in range(int(np.ceil(speeds.max() * self.duration / TURN))):
            yield amplitude
            amplitude = flow * amplitude + turn

    def bound(self, speeds: FloatArray) -> FloatArray:
        """What the output hardly falls below, ``(m,)``: polynomial less the whole amplitude.

        The polynomial is seen at points, so this is no proof: it only tells where to look.
        """
        model, amplitude = self.model, self._free_amplitude(speeds)
        basis = bernstein.basis(model.law.degree, np.linspace(0.0, 1.0, BOUND_POINTS))
        found = np.full(speeds.size, np.inf)
        for i in range(model.law.spans.size):
            lowest = model.forced(speeds, i, basis).min(axis=1) - amplitude[:, i]
            found = np.minimum(found, lowest)
        return found

    def missed(self, speeds: FloatArray) -> FloatArray:
        """By how much `least` may lie above the least output between grid points, ``(m,)``."""
        return np.asarray(GRID_MISSES * self._free_amplitude(speeds).max(axis=1))

    def _free_amplitude(self, speeds: FloatArray) -> FloatArray:
        """The largest amplitude of the output in each piece, ``(m, n)``."""
        largest = np.max([np.abs(amplitude) for amplitude in self.turns(speeds)], axis=0)
        own = np.abs(self.model.since_turn(speeds))[:, :-1]
        return np.asarray((largest[:, None] + own) @ np.abs(self.model.shown))

    def least(self, speeds: FloatArray) -> FloatArray:
        """Least output of the run at each speed, ``(m,)``, on a grid finer than the mode."""
        lows = [values.min(axis=1) for _, _, values in self._all(speeds, self._grid(speeds))]
        return np.asarray(np.min(lows, axis=0))

    def lowest(self, speed: float) -> float:
        """Least output at one speed, between grid points too."""
        speeds = np.array([speed])
        grid = self._grid(speeds)
        lows = []
        for piece, amplitude, values in self._all(speeds, grid):
            at = int(np.argmin(values[0]))
            missed = GRID_MISSES * float(np.abs(amplitude[0]) @ np.abs(self.model.shown))
            lows.append((float(values[0, at]) - missed, piece, at, amplitude))
        found = np.inf
        for bound, piece, at, amplitude in sorted(lows, key=lambda low: low[0]):
            if bound >= found:
                break
            u = np.linspace(0.0, 1.0, grid[piece])[max(0, at - 1) : at + 2]
            closer = _Stretch.of(self.model, speeds, piece, np.linspace(u[0], u[-1], CLOSER))
            found = min(found, float(closer.values(amplitude).min()))
        return found

    def _all(
        self, speeds: FloatArray, grid: list[int]
    ) -> Iterator[tuple[int, ComplexArray, FloatArray]]:
        """Piece, amplitude at its start and output, for each piece of each turn."""
        model, turns = self.model, list(self.turns(speeds))
        own = model.since_turn(speeds)
        for i, points in enumerate(grid):
            stretch = _Stretch.of(model, speeds, i, np.linspace(0.0, 1.0, points))
            before = model.fading(speeds, float(model.law.breaks[i]))[:, 0]
            for turn, amplitude in enumerate(turns):
                start = amplitude * before + own[:, i]
                values = stretch.values(start)
                if self.duration is not None:
                    times = (TURN * turn + stretch.angles) / speeds[:, None]
                    values[times > self.duration] = np.inf
                yield i, start, values

    def _grid(self, speeds: FloatArray) -> list[int]:
        """Points of each piece."""
        rate = float(np.abs(self.model.rates.imag).max())
        a_turn = max(MIN_PER_TURN, PER_PERIOD * rate / float(speeds.min()))
        return [int(np.ceil(a_turn * span / TURN)) + 8 for span in self.model.law.spans]

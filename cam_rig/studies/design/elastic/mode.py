"""The follower's vibration as a linear function of a design's unknowns, at one speed.

The end mass vibrates about its static place: η̈ + 2ζω η̇ + ω² η = d₁ ṡ + d₂ s̈. One complex
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

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import ConfigError
from cam_rig.laws import bernstein
from cam_rig.studies.design.programs.affine import Affine
from cam_rig.studies.design.space import Space
from cam_rig.units import TURN, to_rpm

#: Gauss points of a cell, and the phase (rad) of the vibration in it at most.
GAUSS, CELL_PHASE = 5, 0.3
#: Cells of an event, at most.
MAX_CELLS = 8000


@dataclass(frozen=True)
class Mode:
    """One mode in contact: λ (1/s), its drive by ṡ and s̈, and what it adds to the contact force.

    Parameters
    ----------
    rate : λ, the one of positive imaginary part
    drive : d₁ (1/s) and d₂
    state : what η and η̇ add to the contact force, N/m and N·s/m
    motion : what s, ṡ and s̈ do
    constant : N
    """

    rate: complex
    drive: tuple[float, float]
    state: tuple[float, float]
    motion: tuple[float, float, float]
    constant: float

    @property
    def shown(self) -> complex:
        """What an amplitude adds to the contact force, half of it."""
        return self.state[0] + self.state[1] * self.rate

    @classmethod
    def of(cls, follower: TwoMassParameters | FollowerParameters) -> Mode:
        """Of two masses, or of one on its elastic stem (eq. 5 of the paper).

        Raises
        ------
        ConfigError : a stem that does not vibrate, its damping is critical or more
        """
        p = follower
        if isinstance(p, TwoMassParameters):
            mass, stiffness = p.end_mass, p.stiffness
            damping, share, roller = p.stem_damping + p.damping, p.share, p.roller_mass
            stem, stem_damping = p.stem_stiffness, p.stem_damping
        else:
            mass, stiffness = p.mass, p.spring_stiffness + p.stem
            damping, share, roller = p.damping, p.stem / stiffness, 0.0
            stem, stem_damping = p.stem, 0.0
        half = 0.5 * damping / mass
        square = stiffness / mass - half**2
        if square <= 0.0:
            raise ConfigError(
                f"the stem does not vibrate: its damping is {damping:g} N·s/m; allowed for a "
                f"residual vibration: below {2.0 * math.sqrt(stiffness * mass):.4g} N·s/m"
            )
        left = p.spring_stiffness / stiffness
        return cls(
            rate=complex(-half, math.sqrt(square)),
            drive=((stem_damping - damping * share) / mass, -share),
            state=(-stem, -stem_damping),
            motion=(stem * left, stem_damping * left, roller),
            constant=p.preload * (share if isinstance(p, TwoMassParameters) else 1.0),
        )


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

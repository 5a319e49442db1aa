"""Smallest contact force of each turn from rest, for many two-mass rigs together.

The readings of table 2 need it at hundreds of speeds and for thousands of trial rigs. The force is
sampled.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cam_rig import Law
from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import bernstein
from cam_rig.units import TURN, ComplexArray, FloatArray

#: Number of stored derivatives of a law, sufficient for ten periods of the vibration per turn.
DERIVATIVES = 14
#: Number of points per turn.
TURN_POINTS = 640
#: Number of points per period of the vibration below which its envelope is used.
PER_PERIOD = 16
#: Size of two successive terms of a series, relative to the largest term, at which it ends. The
#: rest is smaller than rounding.
SERIES_RTOL = 1e-14


@dataclass(frozen=True, eq=False)
class Rigs:
    """Two-mass followers with subcritical damping.

    Each parameter is `(b,)` in SI units.
    """

    roller_mass: FloatArray
    end_mass: FloatArray
    stem_stiffness: FloatArray
    spring_stiffness: FloatArray
    stem_damping: FloatArray
    damping: FloatArray
    preload: FloatArray

    @classmethod
    def of(cls, follower: TwoMassParameters, count: int) -> Rigs:
        """Return a follower repeated `count` times."""
        numbers = (getattr(follower, field.name) for field in fields(cls))
        return cls(*(np.full(count, number) for number in numbers))

    @cached_property
    def stiffness(self) -> FloatArray:
        """Sum of the stiffnesses k₁ + k₂ (N/m)."""
        return self.stem_stiffness + self.spring_stiffness

    @cached_property
    def rate(self) -> ComplexArray:
        """Eigenvalue λ (1/s) of the end mass in contact, with positive imaginary part."""
        half = 0.5 * (self.stem_damping + self.damping) / self.end_mass
        return np.asarray(-half + 1j * np.sqrt(self.stiffness / self.end_mass - half**2))

    def end_series(self, count: int) -> FloatArray:
        """Return the weight of each derivative of s in the position of the end mass.

        They are the Taylor coefficients, `(b, count)`, of (k₁ + c₁ D)/(k₁ + k₂ + (c₁ + c₂) D + m₂
        D²), eq. 16 of the paper.
        """
        inverse = np.zeros((count, self.preload.size))
        square = self.stiffness / self.end_mass
        two_half = -2.0 * self.rate.real
        inverse[0] = 1.0 / square
        inverse[1] = -two_half * inverse[0] / square
        for k in range(2, count):
            inverse[k] = -(two_half * inverse[k - 1] + inverse[k - 2]) / square
        series = self.stem_stiffness / self.end_mass * inverse
        series[1:] += self.stem_damping / self.end_mass * inverse[:-1]
        return np.asarray(series.T)

    def force_series(self, count: int) -> FloatArray:
        """Return the weights `(b, count)` of derivatives in the contact force (eq. 17)."""
        end = self.end_series(count).T
        force = -self.stem_stiffness * end
        force[1:] -= self.stem_damping * end[:-1]
        force[0] = self.stem_stiffness * self.spring_stiffness / self.stiffness
        force[1] += self.stem_damping
        force[2] += self.roller_mass
        return np.asarray(force.T)


@dataclass(frozen=True, eq=False)
class ShapeTable:
    """Derivatives of a law by u in each piece, independent of the spans of the pieces.

    `pieces` has d^k s/du^k of each piece at q points from u = 0 to 1, `(count, q)`. `ends` has
    these and one more derivative at both ends of each piece, `(2, count + 1, n)`.
    """

    pieces: tuple[FloatArray, ...]
    ends: FloatArray

    @classmethod
    def of(cls, law: Law, points: int = TURN_POINTS) -> ShapeTable:
        """Sample a law with `points` per turn."""
        count = max(2, min(law.degree, DERIVATIVES)) + 1
        pieces, ends = [], np.zeros((2, count + 1, law.spans.size))
        each = [max(24, round(points * span / TURN)) for span in law.spans]
        ordinates = [law.derivative_ordinates(k) for k in range(count + 1)]
        for i, span in enumerate(law.spans):
            basis = bernstein.basis(law.degree, np.linspace(0.0, 1.0, each[i]))
            rows = np.array([basis @ o[:, i] * span**k for k, o in enumerate(ordinates)])
            pieces.append(rows[:-1])
            ends[:, :, i] = rows[:, 0], rows[:, -1]
        return cls(tuple(pieces), ends)

    @cached_property
    def largest(self) -> FloatArray:
        """Largest |d^k s/du^k| of each piece, `(n, count)`."""
        return np.array([np.abs(piece).max(axis=1) for piece in self.pieces])

    def powers(self, scale: FloatArray, series: FloatArray) -> FloatArray:
        """Return (du/dt)^k, `(b, n, count)`.

        The powers are zero after the series `(b, count)` has converged.
        """
        powers = np.asarray(scale[:, :, None] ** np.arange(series.shape[1]))
        sizes = (np.abs(series)[:, None, :] * powers * self.largest).sum(axis=1)
        small = sizes <= SERIES_RTOL * np.maximum.accumulate(sizes, axis=1)
        over = np.logical_or.accumulate((small[:, :-1] & small[:, 1:])[:, 2:], axis=1)
        powers[:, :, 3:] *= ~over[:, None, :]
        return powers


class TurnMinima(NamedTuple):
    """Smallest force (N) of each turn and its cam angle (rad), `(b, turns)` each."""

    force: FloatArray
    angle: FloatArray


def turn_minima(
    shape: ShapeTable, spans: FloatArray, rigs: Rigs, speed: FloatArray | float, turns: int
) -> TurnMinima:
    """Return the smallest contact force of each turn in runs from rest at θ = 0.

    `spans` `(b, n)` (rad) are those of the law's pieces for each rig. `speed` (rad/s) is a number
    or `(b,)`. If a piece has too few points for the vibration, its envelope gives a lower bound of
    the force.
    """
    speed = np.broadcast_to(speed, rigs.preload.shape)
    scale = speed[:, None] / spans
    jumps, start = _amplitudes(shape, scale, rigs)
    times = spans / speed[:, None]
    added = np.zeros((scale.shape[0], scale.shape[1] + 1), dtype=complex)
    for i in range(scale.shape[1]):
        fading = np.exp(rigs.rate * times[:, i])
        added[:, i + 1] = added[:, i] * fading + jumps[:, (i + 1) % scale.shape[1]]
    flow = np.exp(rigs.rate * TURN / speed)
    amplitude = np.zeros((start.size, turns), dtype=complex)
    for turn in range(turns):
        amplitude[:, turn] = start
        start = start * flow + added[:, -1]
    return _least(shape, scale, times, rigs, amplitude, added)


def _amplitudes(
    shape: ShapeTable, scale: FloatArray, rigs: Rigs
) -> tuple[ComplexArray, ComplexArray]:
    """Return the vibration that the joint before each piece adds, `(b, n)`.

    The second result is the vibration at the start.
    """
    count = shape.ends.shape[1] - 1
    series = rigs.end_series(count)
    weights = series[:, None, :] * shape.powers(scale, rigs.force_series(count))
    position = np.einsum("bnk,ekn->ebn", weights, shape.ends[:, :-1])
    rate = np.einsum("bnk,ekn->ebn", weights * scale[:, :, None], shape.ends[:, 1:])

    def amplitude(y: FloatArray, v: FloatArray) -> ComplexArray:
        half, pulse = -rigs.rate.real[:, None], rigs.rate.imag[:, None]
        return np.asarray(y - 1j * (v + half * y) / pulse)

    jumps = amplitude(np.roll(position[1], 1, 1) - position[0], np.roll(rate[1], 1, 1) - rate[0])
    share = (rigs.stem_stiffness / rigs.stiffness)[:, None]  # of the lift, at rest
    static, along = share * shape.ends[0, 0], share * scale * shape.ends[0, 1]
    return jumps, amplitude(static - position[0], along - rate[0])[:, 0]


def _least(
    shape: ShapeTable,
    scale: FloatArray,
    times: FloatArray,
    rigs: Rigs,
    amplitude: ComplexArray,
    added: ComplexArray,
) -> TurnMinima:
    """Return the smallest force of all pieces.

    `amplitude` is the vibration at the start of each turn.
    """
    least_force = np.full(amplitude.shape, np.inf)
    angle = np.zeros(amplitude.shape)
    weight = -(rigs.stem_stiffness + rigs.stem_damping * rigs.rate)
    constant = rigs.preload * rigs.stem_stiffness / rigs.stiffness
    before = np.zeros(amplitude.shape[0])
    series = rigs.force_series(shape.pieces[0].shape[0])
    powers = shape.powers(scale, series)
    for i, piece in enumerate(shape.pieces):
        forced = (series * powers[:, i]) @ piece + constant[:, None]
        u = np.linspace(0.0, 1.0, piece.shape[1])
        start = amplitude * np.exp(rigs.rate * before)[:, None] + added[:, i : i + 1]
        force = _force(forced, start * weight[:, None], rigs.rate[:, None] * times[:, i : i + 1], u)
        indices = force.argmin(axis=2)
        least = np.take_along_axis(force, indices[:, :, None], 2)[:, :, 0]
        position = before[:, None] + times[:, i : i + 1] * u[indices]
        lower = least < least_force
        least_force, angle = np.where(lower, least, least_force), np.where(lower, position, angle)
        before = before + times[:, i]
    return TurnMinima(least_force, angle * TURN / before[:, None])


def _force(
    forced: FloatArray, start: ComplexArray, exponent: ComplexArray, u: FloatArray
) -> FloatArray:
    """Return the sum of forced response `(b, q)` and vibration, `(b, turns, q)`.

    The vibration begins with `start` `(b, turns)`.
    """
    fading = np.exp(exponent * u)
    parts = np.stack([fading.real, -fading.imag, forced], axis=1)
    force = np.stack([start.real, start.imag, np.ones(start.shape)], axis=2) @ parts
    coarse = exponent.imag[:, 0] * PER_PERIOD > TURN * u.size
    envelope = np.abs(start[coarse])[:, :, None] * np.abs(fading[coarse])[:, None, :]
    force[coarse] = forced[coarse][:, None, :] - envelope
    return np.asarray(force)

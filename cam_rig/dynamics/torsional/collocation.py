"""One window of the torsional vibration (eq. 10): Newton's method on Chebyshev nodes.

The twist is ψ = θ_c − θ_v. What ψ̈ is more at the nodes than in a free vibration, known in
closed form, is the only unknown; all else follows from it, also the flywheel's lead δ on even
turning, since δ̈ = (k_s ψ + c_s ψ̇ + T_motor)/I_v, or 0 where it holds its speed. Integration thus
never touches the free vibration, where it would lose digits with the square of the phase.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg.blas import idamax
from scipy.linalg.lapack import dgetrf, dgetrs

from cam_rig.dynamics.linear.exponential import response
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.units import FloatArray

#: Samples evaluated together: their basis values stay in the processor's cache.
BATCH = 2048


@dataclass(frozen=True, eq=False)
class CollocationTable:
    """Chebyshev-Lobatto nodes on [0, 1] and what is linear in the values there."""

    nodes: FloatArray  #: ``(N + 1,)`` from 0 to 1
    #: ``(3, N + 3, N + 1)``; [r] takes values at the nodes to the Chebyshev coefficients of the
    #: r-fold integral from 0
    series: FloatArray
    first: FloatArray  #: ``(N + 1, N + 1)``; takes values to those of the integral
    second: FloatArray  #: the same for the two-fold integral


@lru_cache(maxsize=32)
def table(degree: int) -> CollocationTable:
    """Nodes and matrices of one degree N."""
    k = np.arange(degree + 1)
    angles = np.pi * (degree - k) / degree
    weights = np.ones(degree + 1)
    weights[[0, -1]] = 0.5
    interpolation = 2.0 / degree * np.cos(np.outer(k, angles)) * weights
    interpolation[[0, -1]] *= 0.5
    series = np.zeros((3, degree + 3, degree + 1))
    series[0, : degree + 1] = interpolation
    integral = _integral(degree + 3)
    series[1] = integral @ series[0]
    series[2] = integral @ series[1]
    at_nodes = np.cos(np.outer(angles, np.arange(degree + 3)))
    first, second = at_nodes @ series[1], at_nodes @ series[2]
    first[0] = second[0] = 0.0
    nodes = np.sin(0.5 * np.pi * k / degree) ** 2
    for array in (nodes, series, first, second):
        array.setflags(write=False)
    return CollocationTable(nodes, series, first, second)


def _integral(size: int) -> FloatArray:
    """``(size, size)``: coefficients to those of the integral over u = (1 + x)/2 from u = 0.

    ∫T_k dx = T_{k+1}/(2(k+1)) − T_{k−1}/(2(k−1)); what would pass the last row is cut off.
    """
    matrix = np.zeros((size, size))
    for k in range(size):
        if k + 1 < size:
            matrix[k + 1, k] += 1.0 if k == 0 else 0.5 / (k + 1)
        if k > 1:
            matrix[k - 1, k] -= 0.5 / (k - 1)
    matrix[0] = -((-1.0) ** np.arange(1, size)) @ matrix[1:]
    return 0.5 * matrix


def basis_at(size: int, u: float) -> FloatArray:
    """``(size,)`` values T_k(2u − 1) at one u in [0, 1]."""
    return np.asarray(np.cos(np.arange(size) * np.arccos(min(1.0, max(-1.0, 2.0 * u - 1.0)))))


def basis(size: int, u: FloatArray) -> FloatArray:
    """``(size, len(u))`` values T_k(2u − 1), by the three-term recurrence."""
    values = np.empty((size, u.size))
    values[0] = 1.0
    np.subtract(2.0 * u, 1.0, out=values[1])
    double = 2.0 * values[1]
    for k in range(2, size):
        np.multiply(double, values[k - 1], out=values[k])
        values[k] -= values[k - 2]
    return values


@dataclass(frozen=True, eq=False)
class ChebyshevPath:
    """Rows of functions of time, window after window, each a Chebyshev series."""

    edges: FloatArray  #: ``(W + 1,)`` times between the windows, s
    #: ``(W,)`` length of the interval each series is written on; it begins with its window and may
    #: end later
    spans: FloatArray
    series: list[FloatArray]  #: W arrays ``(rows, size)``

    def window(self, times: FloatArray) -> FloatArray:
        """Index of the window of each time; at an edge the one that begins there."""
        inner = np.searchsorted(self.edges[1:-1], times, side="right")
        return np.asarray(inner, dtype=np.intp)

    def at(self, times: FloatArray) -> FloatArray:
        """``(rows, len(times))`` values at times in any order, inside the edges."""
        out = np.empty((self.series[0].shape[0], times.size))
        if np.any(times[1:] < times[:-1]):
            order = np.argsort(times, kind="stable")
            out[:, order] = self.at(times[order])
            return out
        for begin in range(0, times.size, BATCH):
            self._fill(times[begin : begin + BATCH], out[:, begin : begin + BATCH])
        return out

    def _fill(self, times: FloatArray, out: FloatArray) -> None:
        """Fill ``out`` at times that rise."""
        window = self.window(times)
        u = (times - self.edges[window]) / self.spans[window]
        low, high = int(window[0]), int(window[-1])
        values = basis(max(s.shape[1] for s in self.series[low : high + 1]), u)
        cuts = np.searchsorted(window, np.arange(low, high + 2))
        for i in range(low, high + 1):
            a, b = cuts[i - low], cuts[i - low + 1]
            if b > a:
                series = self.series[i]
                np.matmul(series, values[: series.shape[1], a:b], out=out[:, a:b])


#: Newton's method has converged when the next correction would be below this, relatively ...
CONVERGED = 1e-15
#: ... and has reached rounding when corrections below this no longer shrink.
ROUNDING = 1e-12

MAX_ITERATIONS = 15
#: A correction may be this fraction of the last before the matrix is made anew.
SLOW = 0.01
#: Chebyshev coefficients of u²/2, u and 1, what a ramp adds to angle, speed and acceleration.
RAMP = np.array([[3.0, 4.0, 1.0], [8.0, 8.0, 0.0], [16.0, 0.0, 0.0]]) / 16.0


@dataclass(frozen=True, eq=False)
class TwistPiece:
    """One piece of a law."""

    #: ``(4, p + 1)``: Bernstein ordinates of s and its first three derivatives, times binomials.
    weights: FloatArray
    span: float  #: rad

    @cached_property
    def flat(self) -> bool:
        """Whether the follower rests here, and the shaft vibrates freely."""
        return not self.weights[1:].any()

    def at(self, angle: FloatArray) -> FloatArray:
        """``(4, len(angle))``: s and its derivatives at angles (rad) from the piece's beginning."""
        powers = np.empty((2, self.weights.shape[1], angle.size))
        powers[:, 0] = 1.0
        powers[0, 1:] = angle / self.span
        np.subtract(1.0, powers[0, 1:], out=powers[1, 1:])
        np.multiply.accumulate(powers, axis=1, out=powers)
        return np.asarray(self.weights @ (powers[0] * powers[1, ::-1]))


class CollocationWindow:
    """Eq. 10 over a time ``length`` (s) on one piece of the law, continued beyond its ends.

    ``start`` has the flywheel's angle measured from the beginning of the piece; ``ramp`` is α,
    rad/s².
    """

    def __init__(
        self,
        parameters: TorsionalParameters,
        piece: TwistPiece,
        start: TorsionalState,
        length: float,
        table: CollocationTable,
        ramp: float = 0.0,
    ) -> None:
        self.parameters, self.piece, self.start, self.ramp = parameters, piece, start, ramp
        self.length, self.table = length, table
        self.first, self.second = length * table.first, length**2 * table.second
        self.times = length * table.nodes
        self.flywheel_line = start.flywheel_angle + start.flywheel_speed * self.times
        self.flywheel_speed: FloatArray | float = start.flywheel_speed
        if ramp != 0.0:
            self.flywheel_line += 0.5 * ramp * self.times**2
            self.flywheel_speed = start.flywheel_speed + ramp * self.times
        self.free, self.free_rate, self.free_b = self._free()
        self.has_inertia = parameters.flywheel_inertia is not None
        if self.has_inertia:
            self.flywheel_line += start.lead + start.lead_rate * self.times
            self.flywheel_speed = self.flywheel_speed + start.lead_rate
        self.driven: FloatArray | float = 0.0
        self.scale = 0.0
        self._set(np.zeros_like(self.times))

    def _free(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """ψ, ψ̇, ψ̈ without a follower, by z = ψ + (flywheel's θ̈)/k: z̈ = −k z − c ż."""
        p, start = self.parameters, self.start
        k, c = p.mobility * p.shaft_stiffness, p.mobility * p.shaft_damping
        rest = (p.flywheel_acceleration[2] + self.ramp) / k
        z, rate = start.twist + rest, start.twist_rate
        if k <= (0.51 * c) ** 2:
            impulse, slope, _ = response(c, k, self.times)
            twist = z * (slope + c * impulse) + rate * impulse
            twist_rate = rate * slope - k * z * impulse
            return twist - rest, twist_rate, -k * twist - c * twist_rate
        root = complex(-0.5 * c, math.sqrt(k - 0.25 * c**2))
        wave = complex(z, -(rate + 0.5 * c * z) / root.imag) * np.exp(root * self.times)
        return wave.real - rest, (root * wave).real, (root**2 * wave).real

    def _set(self, more: FloatArray) -> None:
        """Take what ψ̈ is more than free at the nodes, and with it the whole motion."""
        self.more, self.b = more, self.free_b + more
        self.twist = self.free + self.second @ more
        self.twist_rate = self.free_rate + self.first @ more
        self.angle = self.flywheel_line + self.twist
        self.speed = self.flywheel_speed + self.twist_rate
        if self.has_inertia:
            k, c, steady = self.parameters.flywheel_acceleration
            self.driven = k * self.twist + c * self.twist_rate + steady
            self.angle += self.second @ self.driven
            self.speed += self.first @ self.driven

    def solve(self) -> bool:
        """Newton's method to rounding; False when it does not converge."""
        if self.piece.flat:
            self.scale = self._scale()
            return True
        last, ratio, factors = math.inf, 1.0, None
        for i in range(MAX_ITERATIONS):
            residual, slopes = self._residual(with_slopes=i < 2 or ratio > SLOW)
            if slopes is not None:
                factors = dgetrf(self._matrix(*slopes), overwrite_a=True)[:2]
            assert factors is not None
            correction = dgetrs(*factors, residual)[0]
            self._set(self.more - correction)
            if not math.isfinite(correction @ correction):
                return False
            if i == 0:
                self.scale = self._scale()
            size = largest(correction)
            ratio = size / last
            if size <= CONVERGED * self.scale / min(1.0, max(ratio, 1e-3)):
                return True
            if i > 2 and ratio > 0.5:
                return size <= ROUNDING * self.scale
            last = size
        return False

    def _scale(self) -> float:
        """Size of ψ̈ (rad/s²) that counts: of itself, or of the shaft's torque."""
        p = self.parameters
        torque = p.shaft_stiffness * largest(self.twist)
        if p.shaft_damping:
            torque += p.shaft_damping * largest(self.twist_rate)
        return largest(self.b) + p.mobility * torque

    def _residual(
        self, *, with_slopes: bool
    ) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray] | None]:
        """Left side of eq. 10 (N·m), and its slopes in θ̈_c, θ̇_c and θ_c."""
        p, f = self.parameters, self.parameters.follower
        s, s1, s2, s3 = self.piece.at(self.angle)
        w, a = self.speed, self.b + self.driven + self.ramp
        lever = f.mass * s2 * w
        force = lever * w + s1 * (f.mass * a + f.damping * w) + f.spring_stiffness * s + f.preload
        residual = p.cam_inertia * a + p.shaft_damping * self.twist_rate
        residual += p.shaft_stiffness * self.twist + force * s1
        if not with_slopes:
            return residual, None
        in_angle = f.mass * (s3 * w**2 + s2 * a) + f.damping * s2 * w + f.spring_stiffness * s1
        slopes = (
            p.cam_inertia + f.mass * s1**2,
            s1 * (2.0 * lever + f.damping * s1),
            in_angle * s1 + force * s2,
        )
        return residual, slopes

    def _matrix(
        self, inertia: FloatArray, damping: FloatArray, stiffness: FloatArray
    ) -> FloatArray:
        """Slope of the residual in b."""
        p = self.parameters
        if not self.has_inertia:
            matrix = (damping + p.shaft_damping)[:, None] * self.first
            matrix += (stiffness + p.shaft_stiffness)[:, None] * self.second
            matrix.flat[:: inertia.size + 1] += inertia
            return np.asarray(matrix)
        matrix = damping[:, None] * self.first + stiffness[:, None] * self.second
        matrix.flat[:: inertia.size + 1] += inertia  # what θ̈_c does; and θ̈_c = ψ̈ + δ̈
        k, c, _ = p.flywheel_acceleration
        matrix += matrix @ (k * self.second + c * self.first)
        return np.asarray(matrix + p.shaft_damping * self.first + p.shaft_stiffness * self.second)

    def tail(self) -> tuple[float, float]:
        """Largest coefficient of θ̈_c past 0.4 N, and of the last three, relative to ``scale``."""
        size = self.b.size
        coefficients = self.table.series[0, :size] @ (self.b + self.driven + self.ramp)
        scale = self.scale or 1.0
        return largest(coefficients[int(0.4 * size) :]) / scale, largest(coefficients[-3:]) / scale

    def series(self) -> FloatArray:
        """Chebyshev coefficients of ψ, ψ̇, θ_c, θ̇_c, θ̈_c; then δ, δ̇ of a free flywheel."""
        h, start = self.length, self.start
        scales = np.array([[1.0], [h], [h**2]])
        value, rate, twist = scales * (self.table.series @ self.more)
        free = np.stack([self.free, self.free_rate, self.free_b], axis=1)
        twist, rate, value = (self.table.series[0] @ free).T + np.stack([twist, rate, value])
        rows = np.stack([twist, rate, twist, rate, value])
        if self.ramp != 0.0:
            rows[2:, :3] += self.ramp * np.array([[h**2], [h], [1.0]]) * RAMP
        rows[2, 0] += start.flywheel_angle + 0.5 * start.flywheel_speed * h
        rows[2, 1] += 0.5 * start.flywheel_speed * h
        rows[3, 0] += start.flywheel_speed
        if not self.has_inertia:
            return rows
        lead = scales * (self.table.series @ self.driven)
        lead[2, :2] += 0.5 * h * start.lead_rate
        lead[2, 0] += start.lead
        lead[1, 0] += start.lead_rate
        rows[2:] += lead[::-1]
        return np.vstack([rows, lead[:0:-1]])


def largest(values: FloatArray) -> float:
    """Largest absolute value of a row without NaN."""
    return abs(float(values[idamax(values)]))

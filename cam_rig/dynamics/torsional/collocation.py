"""Solution of the torsional vibration in one window of time, by Newton's method.

The equation is eq. 10 of the paper (see `motion`), solved at the N + 1 Chebyshev nodes of the
window. The twist of the shaft is ψ = θ_c − θ_v, the cam angle less the flywheel angle. The unknown
is ψ̈ at the nodes, less the ψ̈ of a free vibration, which is known in closed form. All other
quantities follow from the unknown. The lead δ of the flywheel relative to a uniform rotation
follows from δ̈ = (k_s ψ + c_s ψ̇ + T_motor)/I_v. It is 0 for a flywheel at constant speed.

The free vibration is never integrated numerically, because that would lose digits with the square
of its phase.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cam_rig.dynamics.linear.exponential import linalg, response
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.units import FloatArray

#: Number of samples that are evaluated together, so that their basis functions fit in the
#: processor's cache.
BATCH = 2048


@dataclass(frozen=True, eq=False)
class CollocationTable:
    """Chebyshev-Lobatto nodes on [0, 1], and matrices that act on values at the nodes."""

    nodes: FloatArray  #: nodes from 0 to 1, ``(N + 1,)``
    #: Matrices from values at the nodes to Chebyshev coefficients of the r-fold integral from 0,
    #: for r = 0, 1, 2, ``(3, N + 3, N + 1)``
    series: FloatArray
    #: Matrix from values at the nodes to the values of the integral from 0, ``(N + 1, N + 1)``.
    first: FloatArray
    #: Matrix from values at the nodes to the values of the double integral, ``(N + 1, N + 1)``.
    second: FloatArray


@lru_cache(maxsize=32)
def collocation_table(degree: int) -> CollocationTable:
    """Return the N + 1 Chebyshev nodes and the integration matrices for degree N."""
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
    """Return the matrix that integrates a Chebyshev series, ``(size, size)``.

    It acts on Chebyshev coefficients. The integral is over u = (1 + x)/2 from u = 0: ∫T_k dx =
    T_{k+1}/(2(k+1)) − T_{k−1}/(2(k−1)). Terms beyond the last row are omitted.
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
    """Return the Chebyshev polynomials T_k(2u − 1) at one u in [0, 1], ``(size,)``."""
    return np.asarray(np.cos(np.arange(size) * np.arccos(min(1.0, max(-1.0, 2.0 * u - 1.0)))))


def basis(size: int, u: FloatArray) -> FloatArray:
    """Return the Chebyshev polynomials T_k(2u − 1), ``(size, len(u))``.

    They are computed by the three-term recurrence.
    """
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
    """Functions of time, with one Chebyshev series on each of W adjacent windows.

    A window is an interval of time.
    """

    edges: FloatArray  #: start times of the windows, and the end of the last, s, ``(W + 1,)``
    #: Duration over which the series of each window was computed, s, ``(W,)``. It starts with the
    #: window and may be longer.
    spans: FloatArray
    series: list[FloatArray]  #: coefficients of each window, one row per function, ``(rows, size)``

    def window(self, times: FloatArray) -> FloatArray:
        """Return the index of the window that contains each time (s), ``(len(times),)``.

        A time at the border of two windows belongs to the later one.
        """
        inner = np.searchsorted(self.edges[1:-1], times, side="right")
        return np.asarray(inner, dtype=np.intp)

    def at(self, times: FloatArray) -> FloatArray:
        """Return the values of all functions at times (s) in any order.

        The shape is ``(rows, len(times))``. All times must be inside the windows.
        """
        out = np.empty((self.series[0].shape[0], times.size))
        if np.any(times[1:] < times[:-1]):
            order = np.argsort(times, kind="stable")
            out[:, order] = self.at(times[order])
            return out
        for start in range(0, times.size, BATCH):
            self._fill(times[start : start + BATCH], out[:, start : start + BATCH])
        return out

    def _fill(self, times: FloatArray, out: FloatArray) -> None:
        """Write the values of all functions at ascending times (s) to ``out``.

        The shape of ``out`` is ``(rows, len(times))``.
        """
        window = self.window(times)
        u = (times - self.edges[window]) / self.spans[window]
        low, high = int(window[0]), int(window[-1])
        values = basis(max(s.shape[1] for s in self.series[low : high + 1]), u)
        cuts = np.searchsorted(window, np.arange(low, high + 2))
        for i in range(low, high + 1):
            first, stop = cuts[i - low], cuts[i - low + 1]
            if stop > first:
                series = self.series[i]
                np.matmul(series, values[: series.shape[1], first:stop], out=out[:, first:stop])


#: Size of the next expected correction at which Newton's method has converged, relative to the
#: scale of the accelerations in the window.
NEWTON_RTOL = 1e-15
#: Largest size of Newton's corrections that count as rounding if they no longer decrease, relative
#: to the scale of the accelerations.
ROUNDING_RTOL = 1e-12
#: Largest number of steps of Newton's method per window (interval of time).
MAX_ITERATIONS = 15
#: Largest ratio of two successive corrections of Newton's method at which the factorised matrix of
#: slopes is used again, instead of a new one.
MAX_REUSE_RATIO = 0.01
#: Chebyshev coefficients of u²/2, u and 1 for the relative time u in [0, 1]. A speed ramp adds
#: these functions to the cam's angle, speed and acceleration.
RAMP_SERIES = np.array([[3.0, 4.0, 1.0], [8.0, 8.0, 0.0], [16.0, 0.0, 0.0]]) / 16.0


@dataclass(frozen=True, eq=False)
class TwistPiece:
    """Polynomial piece of a law, of degree p, in the form that `CollocationWindow` uses."""

    #: Bernstein ordinates of s and its first three derivatives, times the binomial coefficients,
    #: ``(4, p + 1)``
    weights: FloatArray
    span: float  #: cam angle that the piece covers, rad

    @cached_property
    def is_flat(self) -> bool:
        """True if the law is constant in the piece, so that the shaft vibrates freely."""
        return not self.weights[1:].any()

    def at(self, angle: FloatArray) -> FloatArray:
        """Return s, s', s'' and s''' at angles (rad) since the start of the piece.

        The shape is ``(4, len(angle))``.
        """
        powers = np.empty((2, self.weights.shape[1], angle.size))
        powers[:, 0] = 1.0
        powers[0, 1:] = angle / self.span
        np.subtract(1.0, powers[0, 1:], out=powers[1, 1:])
        np.multiply.accumulate(powers, axis=1, out=powers)
        return np.asarray(self.weights @ (powers[0] * powers[1, ::-1]))


class CollocationWindow:
    """Window of time in which eq. 10 of the paper is solved on one piece of the law.

    If the cam turns beyond the ends of the piece, its polynomial is continued.

    Parameters
    ----------
    parameters : TorsionalParameters
        The shaft and the follower.
    piece : TwistPiece
        The polynomial piece of the law.
    start : TorsionalState
        State of the shaft at the start. Its flywheel angle is measured from the start of the piece.
    length : float
        Duration of the window, s.
    table : CollocationTable
        Chebyshev nodes and integration matrices.
    ramp : float
        Acceleration α of the flywheel, rad/s² (default: 0).
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
        self.free, self.free_rate, self.free_acceleration = self._free_vibration()
        self.has_inertia = parameters.flywheel_inertia is not None
        if self.has_inertia:
            self.flywheel_line += start.lead + start.lead_rate * self.times
            self.flywheel_speed = self.flywheel_speed + start.lead_rate
        self.driven: FloatArray | float = 0.0
        self.scale = 0.0
        self._set(np.zeros_like(self.times))

    def _free_vibration(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return ψ, ψ̇ and ψ̈ of the free vibration at the nodes, ``(N + 1,)`` each.

        ψ is the twist of the shaft in rad, without the torque of the follower. It satisfies
        z̈ = −k z − c ż with z = ψ + a/k. Here a is the constant acceleration of the flywheel by the
        motor torque and the ramp.
        """
        p, start = self.parameters, self.start
        k, c = p.mobility * p.shaft_stiffness, p.mobility * p.shaft_damping
        static = (p.flywheel_acceleration[2] + self.ramp) / k
        z, rate = start.twist + static, start.twist_rate
        if k <= (0.51 * c) ** 2:
            impulse, slope, _ = response(c, k, self.times)
            twist = z * (slope + c * impulse) + rate * impulse
            twist_rate = rate * slope - k * z * impulse
            return twist - static, twist_rate, -k * twist - c * twist_rate
        root = complex(-0.5 * c, math.sqrt(k - 0.25 * c**2))
        wave = complex(z, -(rate + 0.5 * c * z) / root.imag) * np.exp(root * self.times)
        return wave.real - static, (root * wave).real, (root**2 * wave).real

    def _set(self, unknown: FloatArray) -> None:
        """Set the unknown of the window, and compute twist and cam motion from it.

        ``unknown`` is the part of the twist's acceleration ψ̈ that is not due to the free vibration
        of the shaft, at the Chebyshev nodes, rad/s², ``(N + 1,)``.
        """
        self.unknown, self.twist_acceleration = unknown, self.free_acceleration + unknown
        self.twist = self.free + self.second @ unknown
        self.twist_rate = self.free_rate + self.first @ unknown
        self.angle = self.flywheel_line + self.twist
        self.speed = self.flywheel_speed + self.twist_rate
        if self.has_inertia:
            k, c, steady = self.parameters.flywheel_acceleration
            self.driven = k * self.twist + c * self.twist_rate + steady
            self.angle += self.second @ self.driven
            self.speed += self.first @ self.driven

    def solve(self) -> bool:
        """Solve the equation of the twist (eq. 10 of the paper) in this window by Newton's method.

        The window is a time interval, and the solution is stored as its values at the collocation
        points. Returns True if the method converged.
        """
        if self.piece.is_flat:
            self.scale = self._scale()
            return True
        last, ratio, factors = math.inf, 1.0, None
        for i in range(MAX_ITERATIONS):
            residual, slopes = self._residual(with_slopes=i < 2 or ratio > MAX_REUSE_RATIO)
            if slopes is not None:
                factors = linalg().lapack.dgetrf(self._matrix(*slopes), overwrite_a=True)[:2]
            assert factors is not None
            correction = linalg().lapack.dgetrs(*factors, residual)[0]
            self._set(self.unknown - correction)
            if not math.isfinite(correction @ correction):
                return False
            if i == 0:
                self.scale = self._scale()
            size = largest(correction)
            ratio = size / last
            if size <= NEWTON_RTOL * self.scale / min(1.0, max(ratio, 1e-3)):
                return True
            if i > 2 and ratio > 0.5:
                return size <= ROUNDING_RTOL * self.scale
            last = size
        return False

    def _scale(self) -> float:
        """Return the scale of the accelerations in the window, rad/s².

        Corrections of Newton's method and Chebyshev coefficients are compared with it. It is the
        largest |ψ̈| plus the acceleration of the twist by the largest torque of the shaft.
        """
        p = self.parameters
        torque = p.shaft_stiffness * largest(self.twist)
        if p.shaft_damping:
            torque += p.shaft_damping * largest(self.twist_rate)
        return largest(self.twist_acceleration) + p.mobility * torque

    def _residual(
        self, *, with_slopes: bool
    ) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray] | None]:
        """Return the residual of eq. 10 (N·m) at the nodes, and its derivatives.

        It is the left side of the equation of the torsional vibration in the paper. It is zero in
        the solution. Its derivatives with respect to θ̈_c, θ̇_c and θ_c are the second result,
        ``(N + 1,)`` each, or None if ``with_slopes`` is False.
        """
        p, f = self.parameters, self.parameters.follower
        s, s1, s2, s3 = self.piece.at(self.angle)
        w, a = self.speed, self.twist_acceleration + self.driven + self.ramp
        mass_term = f.mass * s2 * w
        force = (
            mass_term * w + s1 * (f.mass * a + f.damping * w) + f.spring_stiffness * s + f.preload
        )
        residual = p.cam_inertia * a + p.shaft_damping * self.twist_rate
        residual += p.shaft_stiffness * self.twist + force * s1
        if not with_slopes:
            return residual, None
        in_angle = f.mass * (s3 * w**2 + s2 * a) + f.damping * s2 * w + f.spring_stiffness * s1
        slopes = (
            p.cam_inertia + f.mass * s1**2,
            s1 * (2.0 * mass_term + f.damping * s1),
            in_angle * s1 + force * s2,
        )
        return residual, slopes

    def _matrix(
        self, inertia: FloatArray, damping: FloatArray, stiffness: FloatArray
    ) -> FloatArray:
        """Return the derivative of the residual of eq. 10 by ψ̈ at the nodes.

        Eq. 10 of the paper is the equation of the torsional vibration. The derivative is the matrix
        of Newton's method, ``(N + 1, N + 1)``. ``inertia``, ``damping`` and ``stiffness`` are the
        derivatives of the residual with respect to θ̈_c, θ̇_c and θ_c, from `_residual`.
        """
        p = self.parameters
        if not self.has_inertia:
            matrix = (damping + p.shaft_damping)[:, None] * self.first
            matrix += (stiffness + p.shaft_stiffness)[:, None] * self.second
            matrix.flat[:: inertia.size + 1] += inertia
            return np.asarray(matrix)
        matrix = damping[:, None] * self.first + stiffness[:, None] * self.second
        matrix.flat[:: inertia.size + 1] += inertia  # slope by θ̈_c, with θ̈_c = ψ̈ + δ̈
        k, c, _ = p.flywheel_acceleration
        matrix += matrix @ (k * self.second + c * self.first)
        return np.asarray(matrix + p.shaft_damping * self.first + p.shaft_stiffness * self.second)

    def tail(self) -> tuple[float, float]:
        """Return the sizes of the last Chebyshev coefficients of the cam acceleration θ̈_c.

        Small coefficients show that the series resolves the window. The first result is the largest
        coefficient from index 0.4 N on, the second the largest of the last three. Both are
        absolute values relative to ``scale``.
        """
        size = self.twist_acceleration.size
        coefficients = self.table.series[0, :size] @ (
            self.twist_acceleration + self.driven + self.ramp
        )
        scale = self.scale or 1.0
        return largest(coefficients[int(0.4 * size) :]) / scale, largest(coefficients[-3:]) / scale

    def series(self) -> FloatArray:
        """Return the Chebyshev coefficients of ψ, ψ̇, θ_c, θ̇_c and θ̈_c, ``(5, N + 3)``.

        ψ is the twist of the shaft and θ_c the cam angle. A flywheel with an inertia adds two rows,
        its lead δ and the rate δ̇.
        """
        h, start = self.length, self.start
        scales = np.array([[1.0], [h], [h**2]])
        value, rate, twist = scales * (self.table.series @ self.unknown)
        free = np.stack([self.free, self.free_rate, self.free_acceleration], axis=1)
        twist, rate, value = (self.table.series[0] @ free).T + np.stack([twist, rate, value])
        rows = np.stack([twist, rate, twist, rate, value])
        if self.ramp != 0.0:
            rows[2:, :3] += self.ramp * np.array([[h**2], [h], [1.0]]) * RAMP_SERIES
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
    """Return the largest absolute value of an array without NaN, ``(n,)``."""
    return abs(float(values[linalg().blas.idamax(values)]))

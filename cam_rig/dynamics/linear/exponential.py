"""Free motion ẋ = A x + b of masses in flight, in closed form.

The states x are transformed to decoupled pairs (q, q̇). Each pair describes a mass on a spring and a
damper, q̈ + 2δ q̇ + κ q = const. Its response is exact for every damping, including critical damping,
and for every spring, however weak. The motion is computed relative to the start and not to the
position of equilibrium, because a weak spring puts the equilibrium far away.
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any

import numpy as np

from cam_rig.units import FloatArray


@cache
def linalg() -> Any:
    """Return the module `scipy.linalg`.

    It is imported at the first call, because many scenes do not need it.
    """
    return importlib.import_module("scipy.linalg")


#: Largest product of time and fastest rate at which the power series of the impulse response is
#: used.
MAX_SERIES_REACH = 0.5
#: Number of terms of the power series of the impulse response. The first omitted term, 0.5^18/18!,
#: is far below rounding.
SERIES_TERMS = 18

#: Impulse response S (s), its derivative Ṡ (without unit) and its integral C (s²), from `response`.
Response = tuple[FloatArray, FloatArray, FloatArray]


def response(damping: float, stiffness: float, time: FloatArray) -> Response:
    """Return the impulse response of q̈ + 2δ q̇ + κ q = 0 at times (s).

    ``damping`` is 2δ (1/s) and ``stiffness`` is κ (1/s²). The results are S (s) with S(0) = 0 and
    Ṡ(0) = 1, its derivative Ṡ (1), and its integral C (s²), each of the shape of the times.
    """
    time = np.asarray(time, dtype=np.float64)
    short = max(math.sqrt(stiffness), damping) * time <= MAX_SERIES_REACH
    if short.all():
        return _respond_short(damping, stiffness, time)
    if not short.any():
        return _respond_long(damping, stiffness, time)
    out = np.empty((3, time.size))
    out[:, short] = _respond_short(damping, stiffness, time[short])
    out[:, ~short] = _respond_long(damping, stiffness, time[~short])
    return out[0], out[1], out[2]


def _respond_long(damping: float, stiffness: float, time: FloatArray) -> Response:
    """Return the impulse response of q̈ + 2δ q̇ + κ q = 0 by exponentials, at any times.

    ``damping`` is 2δ (1/s), ``stiffness`` is κ (1/s²) and ``time`` is in s. `response` describes
    the three results.
    """
    decay = 0.5 * damping
    square = stiffness - decay**2
    if square > 0.0:
        rate = math.sqrt(square)
        envelope = np.exp(-decay * time)
        impulse = envelope * np.sin(rate * time) / rate
        slope = envelope * np.cos(rate * time) - decay * impulse
        return impulse, slope, (1.0 - slope - 2.0 * decay * impulse) / stiffness
    return _overdamped(decay, math.sqrt(-square), stiffness, time)


def _respond_short(damping: float, stiffness: float, time: FloatArray) -> Response:
    """Return the impulse response of q̈ + 2δ q̇ + κ q = 0 by its Taylor series.

    ``damping`` is 2δ (1/s) and ``stiffness`` is κ (1/s²). Times are in s, at most
    `MAX_SERIES_REACH` divided by the fastest rate, max(√κ, 2δ). `response` describes the three
    results.
    """
    columns = np.vander(time, SERIES_TERMS + 1, increasing=True) @ _series_terms(damping, stiffness)
    return columns[:, 0], columns[:, 1], columns[:, 2]


@lru_cache(maxsize=256)
def _series_terms(damping: float, stiffness: float) -> FloatArray:
    """Return the Taylor coefficients of an impulse response, ``(SERIES_TERMS + 1, 3)``.

    The columns are the response S, its derivative Ṡ and its integral C. The coefficients follow
    from the equation q̈ + 2δ q̇ + κ q = 0 with ``damping`` 2δ (1/s) and ``stiffness`` κ (1/s²).
    """
    terms = [0.0, 0.0, 0.5]
    for i in range(1, SERIES_TERMS - 1):
        pull = damping * (i + 1) * terms[i + 1] + stiffness * terms[i]
        terms.append(-pull / ((i + 1) * (i + 2)))
    step = np.array(terms)
    order = np.arange(SERIES_TERMS + 1.0)
    impulse = np.append(step[1:] * order[1:], 0.0)
    rate = np.append(impulse[1:] * order[1:], 0.0)
    return np.stack([impulse, rate, step], axis=1)


def _overdamped(decay: float, root: float, stiffness: float, time: FloatArray) -> Response:
    """Return the impulse response of q̈ + 2δ q̇ + κ q = 0 for δ² ≥ κ, at times (s).

    ``decay`` is δ and ``root`` is √(δ² − κ), in 1/s. ``stiffness`` is κ in 1/s². The formulas
    contain no growing exponential. `response` describes the three results.
    """
    fast = decay + root
    slow = stiffness / fast
    difference = 2.0 * root
    growth = -np.expm1(-difference * time) / difference if difference > 0.0 else time
    impulse = np.exp(-slow * time) * growth
    rate = np.exp(-fast * time) - slow * impulse
    if slow > 0.1 * fast:
        return impulse, rate, (1.0 - rate - 2.0 * decay * impulse) / stiffness
    integral = -np.expm1(-slow * time) / slow if slow > 0.0 else time
    return impulse, rate, (integral + np.expm1(-fast * time) / fast) / difference


#: Degree of the power series by which the acceleration in flight is computed in a window, a short
#: interval of time.
SERIES_DEGREE = 24
#: Product of ‖A‖ and the duration of a window, a short interval of time in flight with the matrix A
#: of the motion (no unit). With this duration the omitted terms of the power series, 2^25/25!, are
#: below rounding.
REACH = 2.0
#: Matrix that converts the coefficients of a power series of degree n to Bernstein ordinates. Its
#: elements are C(i, j)/C(n, j).
POWERS_TO_ORDINATES = np.array(
    [
        [math.comb(i, j) / math.comb(SERIES_DEGREE, j) for j in range(SERIES_DEGREE + 1)]
        for i in range(SERIES_DEGREE + 1)
    ]
)


def window_series(matrix: FloatArray, row: FloatArray, window: float) -> FloatArray:
    """Return the matrix from a state x to the polynomial row · e^{At} x of time.

    The polynomial is a truncated power series, given by its Bernstein ordinates over ``window`` s
    from the time of the state on. A is ``matrix``, ``(n, n)``. The shape of the result is
    ``(SERIES_DEGREE + 1, n)``.
    """
    terms = [row]
    for j in range(SERIES_DEGREE):
        terms.append(terms[-1] @ matrix * (window / (j + 1)))
    return np.asarray(POWERS_TO_ORDINATES @ np.array(terms))


@dataclass(frozen=True, eq=False)
class Pairs:
    """Transformation x = V ξ of n states to decoupled pairs (q, q̇) in ξ.

    Each pair satisfies q̈ + 2δ q̇ + κ q = const.
    """

    shapes: FloatArray  #: matrix V of the transformation, ``(n, n)``
    inverse: FloatArray  #: inverse V⁻¹, ``(n, n)``
    damping: FloatArray  #: 2δ of each pair, 1/s, ``(n / 2,)``
    stiffness: FloatArray  #: κ of each pair, 1/s², ``(n / 2,)``


@dataclass(frozen=True, eq=False)
class FreeSystem:
    """Equation of motion ẋ = A x + b of masses in flight, with n states.

    Positions and velocities alternate in x.
    """

    matrix: FloatArray  #: A of ẋ = A x + b, ``(n, n)``
    load: FloatArray  #: b of ẋ = A x + b, ``(n,)``
    #: Weights with which the n states add up to the position of the contact mass, ``(n,)``
    row: FloatArray
    #: Matrix E, ``(k, n)``. The length of the vector E ẋ never grows during a flight and is never
    #: below the absolute acceleration of the contact mass.
    energy: FloatArray
    #: Transformation to decoupled pairs of states, or None if the modes are too similar. Then the
    #: exponential of the matrix is used.
    pairs: Pairs | None

    @cached_property
    def window(self) -> float:
        """Longest time (s) over which the series of the acceleration is exact to rounding.

        The degree of the series is `SERIES_DEGREE`.
        """
        stiffness = np.abs(self.matrix[1::2, ::2]).sum(axis=1)  # of accelerations by positions
        scale = np.tile([1.0, 1.0 / np.sqrt(stiffness.max())], self.load.size // 2)
        return REACH / float(np.linalg.norm(scale[:, None] * self.matrix / scale, 2))

    @cached_property
    def series(self) -> FloatArray:
        """Matrix from ẋ to the acceleration of the contact mass as a polynomial of time.

        The polynomial is given by its Bernstein ordinates (m/s²) over ``window`` s from the time of
        ẋ on. The shape is ``(SERIES_DEGREE + 1, n)``.
        """
        return window_series(self.matrix, self.row @ self.matrix, self.window)

    def rates(self, start: FloatArray) -> FloatArray:
        """Return the rate ẋ = A x + b of a state x of masses in flight, ``(n,)``."""
        return np.asarray(self.matrix @ start + self.load)

    def state_change(self, start: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the change x − x₀ and the rate ẋ at m times (s) after x₀ = ``start``.

        ``start`` is one state ``(n,)``, or a state for each time, ``(n, m)``. The shape of each
        result is ``(n, m)``.
        """
        starts = start[:, None] if start.ndim == 1 else start
        if self.pairs is None:
            return self._change_by_exponential(starts, times)
        pairs = self.pairs
        decoupled, load = pairs.inverse @ starts, pairs.inverse @ self.load[:, None]
        position, velocity = decoupled[::2], decoupled[1::2]
        velocity_load, force_load = load[::2], load[1::2]
        springs, dampers = pairs.stiffness[:, None], pairs.damping[:, None]
        rate = velocity + velocity_load
        pull = springs * position - force_load - dampers * velocity_load
        force = -springs * position - dampers * velocity + force_load
        change, rates = (np.empty((len(start), times.size)) for _ in range(2))
        for i, (damping, stiffness) in enumerate(zip(pairs.damping, pairs.stiffness, strict=True)):
            impulse, slope, step = response(float(damping), float(stiffness), times)
            change[2 * i] = rate[i] * impulse - pull[i] * step
            change[2 * i + 1] = force[i] * impulse - stiffness * rate[i] * step
            rates[2 * i] = rate[i] * slope - pull[i] * impulse
            rates[2 * i + 1] = force[i] * slope - stiffness * rate[i] * impulse
        return pairs.shapes @ change, pairs.shapes @ rates

    def motion(
        self, start: FloatArray, times: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the motion of the contact mass at m times (s) after ``start``, ``(m,)`` each.

        ``start`` is one state ``(n,)``, or a state for each time, ``(n, m)``. The results are
        displacement (m), velocity (m/s) and acceleration (m/s²).
        """
        change, rates = self.state_change(start, times)
        position = self.row @ start + self.row @ change
        return np.asarray(position), self.row @ rates, np.asarray(self.row @ self.matrix @ rates)

    def _change_by_exponential(
        self, starts: FloatArray, times: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return x − x₀ and ẋ, each ``(n, m)``, by a matrix exponential.

        The matrix is A, augmented by the column ẋ₀. ``starts`` are the states x₀, ``(n, 1)`` or
        ``(n, m)``.
        """
        n, rates = len(starts), self.matrix @ starts + self.load[:, None]
        matrix = np.zeros((rates.shape[1], n + 1, n + 1))
        matrix[:, :n, :n], matrix[:, :n, n] = self.matrix, rates.T
        flows = linalg().expm(matrix * times[:, None, None])
        return flows[:, :n, n].T, np.einsum(
            "mij,jm->im", flows[:, :n, :n], np.broadcast_to(rates, (n, times.size))
        )


@dataclass(frozen=True, eq=False)
class Flight:
    """Flight of the follower's masses, from an initial state at t = 0 on.

    The gap to the cam and its rate are stored if they are more accurate than the difference of two
    displacements. At a lift-off, for example, the gap is exactly 0.
    """

    system: FreeSystem  #: equation of motion of the masses
    start: FloatArray  #: state at t = 0, ``(n,)``
    gap: float | None = None  #: distance of contact mass and cam at t = 0, m, or None
    gap_rate: float | None = None  #: rate of the gap at t = 0, m/s, or None

    @property
    def gap_state(self) -> tuple[float, ...]:
        """Gap to the cam (m) and its rate (m/s) at t = 0, or an empty tuple if unknown."""
        return () if self.gap is None or self.gap_rate is None else (self.gap, self.gap_rate)

    def motion(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the motion of the contact mass at m times (s) since the start, ``(m,)`` each.

        The results are displacement (m), velocity (m/s) and acceleration (m/s²).
        """
        return self.system.motion(self.start, times)


def free_weights(matrix: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return S and Ṡ + 2δ S in e^{At} = (Ṡ + 2δ S) I + S A for two states, at times (s).

    S is the impulse response (s) of the characteristic equation λ² + 2δ λ + κ = 0 of A,
    ``(2, 2)``. The equation is the theorem of Cayley and Hamilton.
    """
    (a, b), (c, d) = matrix.tolist()
    damping, stiffness = -(a + d), a * d - b * c
    impulse, rate, _ = response(damping, stiffness, times)
    return impulse, rate + damping * impulse


def free_motion(matrix: FloatArray, start: FloatArray, times: FloatArray) -> FloatArray:
    """Return the free motion e^{At} z at times (s), ``(n, len(times))``.

    ``start`` is the state z at time 0, ``(n,)`` or ``(n, len(times))``. Two states have a closed
    form (`free_weights`). For more states each time needs one matrix exponential.
    """
    starts = start[:, None] if start.ndim == 1 else start
    if starts.shape[0] != 2:
        flows = linalg().expm(matrix[None] * times[:, None, None])
        return np.asarray(np.matmul(flows, starts.T[:, :, None])[:, :, 0].T)
    impulse, slope = free_weights(matrix, times)
    return np.asarray(starts * slope + (matrix @ starts) * impulse)

"""Exact response of a linear system ẋ = A x + f(t) to a polynomial forcing.

On one polynomial piece of duration T the forcing is f(u) = Σ Fⱼ Bⱼ(u) with u = t/T and the
Bernstein basis Bⱼ. The response is x(t) = X(u) + e^{At} (x₀ − X(0)) with a polynomial X. There are
no time steps, so a stiff system costs no more than a soft one. X is computed by the method that
keeps its digits:

* For modes that are fast compared with the piece (|λ|T is at least the degree), X is the sum of
  −A⁻⁽ʲ⁺¹⁾ f⁽ʲ⁾. It is finite, because f is a polynomial.
* For slow modes this sum would be huge and would cancel against the exponential. For modes without
  a restoring force it does not exist. For these modes X(0) = 0, and X is Picard's series of
  repeated integrals, whose terms are below rounding after about twenty terms. The piece is divided
  into equal parts that are short enough for the series.

An ordered Schur form separates fast and slow modes of very different rates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.dynamics.linear.exponential import free_weights, linalg
from cam_rig.laws import bernstein
from cam_rig.units import FloatArray

#: Largest product ‖A‖T of the slow modes of a system ẋ = A x + f and a duration T. A polynomial
#: piece of the forcing f is divided into parts that satisfy it. The terms of Picard's series then
#: stay below e⁴.
PICARD_REACH = 4.0
#: Largest ratio of the rates |λ| of two modes that are not separated into a slow and a fast mode.
#: The rates of an overdamped mass at `MAX_STIFFNESS_RATIO` have the ratio 3.
MAX_RATE_RATIO = 3.1
#: Smallest product of rate and duration that has its own number of terms of Picard's series.
MIN_REACH = 4.0**-8
#: Largest excess of a product of rate and duration over a power of 4 that counts as rounding, in
#: powers of 4.
REACH_ROUNDING = 1e-9
#: Largest ratio κ/δ² of an overdamped mass ẍ + 2δ ẋ + κ x = 0 at which its two decay rates count as
#: different.
MAX_STIFFNESS_RATIO = 0.75


@lru_cache(maxsize=64)
def derivative_matrix(degree: int) -> FloatArray:
    """Return the derivative matrix of the Bernstein basis of degree p, ``(p + 1, p + 1)``.

    Its product with the ordinates of a polynomial in u ∈ [0, 1] gives the ordinates of the
    derivative, written with the same degree p.
    """
    return np.asarray(bernstein.elevate(bernstein.derivative(np.eye(degree + 1)), degree))


def exponential(matrix: FloatArray, time: float) -> FloatArray:
    """Return the matrix exponential e^{At} for a time (s), ``(n, n)``.

    For two states the closed form is used, whose error is the rounding of the phase. The scaling
    and squaring of `scipy.linalg.expm` has ten times this error if the vibration advances by 3000
    rad.
    """
    return np.asarray(exponentials(matrix, np.array([time]))[0])


def exponentials(matrix: FloatArray, times: FloatArray) -> FloatArray:
    """Return the matrix exponentials e^{At} at m times (s), ``(m, n, n)``."""
    if matrix.shape[0] != 2:
        flows: FloatArray = linalg().expm(matrix * times[:, None, None])
        return flows
    impulse, slope = (x[:, None, None] for x in free_weights(matrix, times))
    return np.asarray(slope * np.eye(2) + impulse * matrix)


@dataclass(frozen=True, eq=False)
class ForcingPiece:
    """Response of ẋ = A x + f(t) on one polynomial piece of the forcing f.

    The piece is divided into parts of equal duration h. In each of them the response is a
    polynomial X plus a free motion.
    """

    matrix: FloatArray  #: A in 1/s, ``(n, n)``
    particular: FloatArray  #: Bernstein ordinates of X on each part, ``(parts, n, p + 1)``
    duration: float  #: duration T of the piece, s
    part_flow: FloatArray  #: matrix e^{Ah} of the free motion over one part, ``(n, n)``

    @property
    def part(self) -> float:
        """Duration h (s) of the equal parts into which a piece of the forcing is cut."""
        return self.duration / len(self.particular)

    @property
    def flow(self) -> FloatArray:
        """Matrix e^{AT} of the free motion over the duration T of the piece, ``(n, n)``."""
        return np.asarray(np.linalg.matrix_power(self.part_flow, self.particular.shape[0]))

    def end(self, start: FloatArray) -> FloatArray:
        """Return the state at the end of the piece, from the state ``start`` at its start.

        Both have the shape ``(n,)``.
        """
        return self._part_starts(start)[-1]

    def at(self, start: FloatArray, times: FloatArray) -> FloatArray:
        """Return the states at times (s) since the piece's start, ``(n, len(times))``.

        ``start`` is the state at the start, ``(n,)``.
        """
        starts = self._part_starts(start)
        states = np.empty((start.size, times.size))
        index = np.minimum((times / self.part).astype(int), self.particular.shape[0] - 1)
        for i in np.unique(index):
            in_part = index == i
            since = times[in_part] - i * self.part
            forced = bernstein.evaluate(self.particular[i].T, since / self.part)
            flows = linalg().expm(self.matrix[None] * since[:, None, None])
            states[:, in_part] = (forced + flows @ (starts[i] - self.particular[i, :, 0])).T
        return states

    def _part_starts(self, start: FloatArray) -> list[FloatArray]:
        """Return the states at the start of each part, and at the end of the piece.

        The list contains one state ``(n,)`` per part, and last the state at the end. ``start`` is
        the state at the start of the piece.
        """
        states = [start]
        for ordinates in self.particular:
            free = self.part_flow @ (states[-1] - ordinates[:, 0])
            states.append(np.asarray(ordinates[:, -1] + free))
        return states


def piece(matrix: FloatArray, forcing: FloatArray, duration: float) -> ForcingPiece:
    """Return the response of ẋ = A x + f on one piece of the forcing.

    Parameters
    ----------
    matrix : array, ``(n, n)``
        A, 1/s.
    forcing : array, ``(n, p + 1)``
        Bernstein ordinates of f.
    duration : float
        Duration T of the piece, s.
    """
    return pieces(matrix, forcing[:, :, None], np.array([duration]))[0]


def pieces(
    matrix: FloatArray, forcing: FloatArray, durations: FloatArray
) -> tuple[ForcingPiece, ...]:
    """Return the responses of ẋ = A x + f on m pieces of the forcing f.

    ``forcing`` are the Bernstein ordinates of f, ``(n, p + 1, m)``, and ``durations`` are in s,
    ``(m,)``. The results are those of `piece`. Pieces that need the same number of parts and terms
    of Picard's series are solved together.
    """
    bound = max(float(forcing.shape[1] - 1), PICARD_REACH)
    rates = np.abs(np.linalg.eigvals(matrix))
    if _have_similar_rates(rates):
        slow = np.where(rates.min() * durations < bound, rates.size, 0)
    else:
        slow = (rates[:, None] * durations < bound).sum(axis=0)
    responses: dict[int, ForcingPiece] = {}
    for k in np.unique(slow):
        group = np.flatnonzero(slow == k)
        modes = _modes(matrix, rates, float(durations[group[0]]), bound)
        reaches = modes.slow_rate * durations[group]
        parts = np.maximum(1, np.ceil(reaches / PICARD_REACH)).astype(int)
        terms = np.array([_picard_terms(reach) for reach in (reaches / parts).tolist()])
        for count, order in {*zip(parts.tolist(), terms.tolist(), strict=True)}:
            same = group[(parts == count) & (terms == order)]
            solved = _solve(matrix, modes, forcing[:, :, same], durations[same], count, order)
            responses.update(zip(same.tolist(), solved, strict=True))
    return tuple(responses[i] for i in range(durations.size))


@dataclass(frozen=True, eq=False)
class Modes:
    """Separation of a matrix A into slow and fast modes, A V = V diag(slow, fast).

    A block is empty if there is no such mode.
    """

    slow: FloatArray  #: block of the slow modes, 1/s, ``(k, k)``
    fast: FloatArray  #: block of the fast modes, 1/s, ``(n - k, n - k)``
    shapes: FloatArray  #: matrix V, ``(n, n)``
    slow_rate: float  #: bound of the growth rate of Picard's series, 1/s, 0 without a slow mode


def _solve(
    matrix: FloatArray,
    modes: Modes,
    forcing: FloatArray,
    durations: FloatArray,
    parts: int,
    terms: int,
) -> list[ForcingPiece]:
    """Return the responses on m forcing pieces with the same slow and fast modes.

    The system is ẋ = A x + f with A = ``matrix``. ``forcing`` are the Bernstein ordinates of f,
    ``(n, p + 1, m)``, and ``durations`` are in s. Each piece is divided into ``parts`` equal parts.
    For the slow modes Picard's series has ``terms`` integrals after the first.
    """
    (n, width, m), k, shapes = forcing.shape, modes.slow.shape[0], modes.shapes
    # Scale the rows to one magnitude. Otherwise the pivot of the linear solve is the row of a
    # velocity, and the forcing of a slow mode loses its digits by cancellation.
    scale = np.exp2(-np.round(np.log2(np.abs(shapes).max(axis=1, keepdims=True))))
    inputs = np.linalg.solve(scale * shapes, scale * forcing.reshape(n, -1)).reshape(n, width, m)
    fast = _fast_response(modes.fast, inputs[k:], durations)
    # Ordinates on the parts: each piece is replaced by its parts, in the order of time.
    cut = bernstein.parts(width - 1, parts)
    lengths = durations / parts
    on_parts = np.einsum("cqp,npm->nqmc", cut, np.concatenate([inputs[:k], fast]))
    on_parts = on_parts.reshape(n, width, m * parts)
    slow, degree = on_parts[:k], width - 1
    if k:
        slow = _picard(modes.slow, slow, np.repeat(lengths, parts), terms)
        degree = slow.shape[1] - 1
    elevated = bernstein.elevation_matrix(width - 1, degree) @ on_parts[k:]
    states = np.tensordot(shapes, np.concatenate([slow, elevated]), axes=1)
    particular = np.ascontiguousarray(states.reshape(n, degree + 1, m, parts).transpose(2, 3, 0, 1))
    flows = exponentials(matrix, lengths)
    return [
        ForcingPiece(matrix, x, float(duration), flow)
        for x, duration, flow in zip(particular, durations, flows, strict=True)
    ]


def _fast_response(matrix: FloatArray, forcing: FloatArray, durations: FloatArray) -> FloatArray:
    """Return the polynomial response of ẋ = A x + f, with the degree p of the forcing.

    A is the block of the fast modes, ``(k, k)``. ``forcing`` are the Bernstein ordinates of f,
    ``(k, p + 1, m)``, and ``durations`` are in s, ``(m,)``. The response X = A⁻¹(Ẋ − f) is the sum
    of −A⁻⁽ʲ⁺¹⁾ f⁽ʲ⁾, which ends with the derivative of order p.
    """
    response = np.zeros_like(forcing)
    if matrix.size:
        slope = derivative_matrix(forcing.shape[1] - 1)
        for _ in range(forcing.shape[1]):
            difference = slope @ response / durations - forcing
            solved = np.linalg.solve(matrix, difference.reshape(len(matrix), -1))
            response = np.asarray(solved.reshape(forcing.shape), dtype=np.float64)
    return response


def _have_similar_rates(rates: FloatArray) -> bool:
    """Return True if one or two modes have rates |λ| (1/s) so similar that both are slow or fast.

    With two modes Aʲ is a combination of A and the unit matrix, so that the terms of Picard's
    series are bounded by the larger rate.
    """
    return rates.size <= 2 and float(rates.max()) <= MAX_RATE_RATIO * float(rates.min())


def _modes(matrix: FloatArray, rates: FloatArray, duration: float, bound: float) -> Modes:
    """Separate the slow and the fast modes of a matrix A.

    ``rates`` are the absolute values of its eigenvalues λ, 1/s. A mode is slow if |λ|T < ``bound``,
    with the ``duration`` T in s.
    """
    n, empty = matrix.shape[0], np.empty((0, 0))
    # The matrix itself where possible, because a transformation would add rounding.
    are_similar = _have_similar_rates(rates)
    if n <= 2 and float((rates.min() if are_similar else rates.max()) * duration) < bound:
        return Modes(matrix, empty, np.eye(n), float(rates.max()))
    if are_similar:
        return Modes(empty, matrix, np.eye(n), 0.0)
    overdamped = _overdamped_modes(matrix)
    if overdamped is not None:
        values, shapes = overdamped
        k = int(np.sum(np.abs(values) * duration < bound))
        slow_rate = float(np.abs(values[:k]).max(initial=0.0))
        return Modes(np.diag(values[:k]), np.diag(values[k:]), shapes, slow_rate)
    balanced, scale = linalg().matrix_balance(matrix)
    triangle, basis, k = linalg().schur(
        balanced, output="real", sort=lambda re, im: math.hypot(re, im) * duration < bound
    )
    if k == 0:
        return Modes(empty, matrix, np.eye(n), 0.0)
    slow, fast = triangle[:k, :k], triangle[k:, k:]
    decouple = np.eye(n)
    if k < n:
        decouple[:k, k:] = linalg().solve_sylvester(slow, -fast, -triangle[:k, k:])
    shapes = np.asarray(scale @ basis @ decouple)
    return Modes(slow, fast, shapes, float(np.linalg.norm(slow, 2)))


def _overdamped_modes(matrix: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return the eigenvalues and mode shapes of an overdamped mass, or None.

    The eigenvalues are (slow, fast), 1/s, and the mode shapes are the columns of a matrix. The
    result is None if ``matrix`` is not that of one mass whose two rates are different. The
    slow rate is computed as the stiffness divided by the fast rate. The Schur form would give it
    with the rounding error of the fast rate, which may be 1e7 times as large.
    """
    if matrix.shape != (2, 2) or tuple(matrix[0]) != (0.0, 1.0):
        return None
    stiffness, decay = -float(matrix[1, 0]), -0.5 * float(matrix[1, 1])
    if not (decay > 0.0 and 0.0 < stiffness < MAX_STIFFNESS_RATIO * decay**2):
        return None
    fast = -decay - math.sqrt(decay**2 - stiffness)
    rates = np.array([stiffness / fast, fast])
    return rates, np.stack([np.ones(2), rates])


def _picard_terms(reach: float) -> int:
    """Return the number of integrals after the first that Picard's series needs.

    Further integrals are below rounding. ``reach`` is the product of the rate of the slow modes and
    the duration. It is rounded up to a power of 4, so that more pieces are solved together.
    """
    reach = 4.0 ** math.ceil(math.log(max(reach, MIN_REACH), 4.0) - REACH_ROUNDING)
    size, order = reach, 2
    while size > 1e-17:
        size *= reach / order
        order += 1
    return order - 2


def _picard(
    matrix: FloatArray, forcing: FloatArray, durations: FloatArray, terms: int
) -> FloatArray:
    """Return the response of ẋ = A x + f from x = 0 by Picard's series.

    The series is ∫f + A∫∫f + A²∫∫∫f + …, with ``terms`` integrals after the first. ``forcing`` are
    the Bernstein ordinates of f, ``(k, p + 1, m)``, for m pieces and k states. ``durations`` are in
    s, ``(m,)``. Returns the Bernstein ordinates of the sum, ``(k, q + 1, m)``.
    """
    k, width, m = forcing.shape
    chain = np.empty((terms + 1, width, k, m))
    term = forcing.transpose(1, 0, 2) * durations
    chain[0] = term
    for j in range(1, terms + 1):
        term = matrix @ term * durations
        chain[j] = term
    sums = _repeated_integrals(width - 1, terms) @ chain.reshape((terms + 1) * width, k * m)
    return np.asarray(sums.reshape(-1, k, m).transpose(1, 0, 2))


@lru_cache(maxsize=128)
def _repeated_integrals(degree: int, terms: int) -> FloatArray:
    """Return the matrix that adds up the repeated integrals of polynomials of degree p.

    Column block j, ``(q + 1, p + 1)``, integrates a polynomial j + 1 times over u from 0, with
    j = 0 to ``terms``, and writes the result with the degree q = p + 1 + ``terms``.
    """
    target, integral, blocks = degree + 1 + terms, np.eye(degree + 1), []
    for _ in range(terms + 1):
        integral = bernstein.antiderivative(integral)
        blocks.append(bernstein.elevate(integral, target))
    return np.concatenate(blocks, axis=1)


def periodic_state(pieces: list[ForcingPiece]) -> FloatArray:
    """Return the state at the start of the first piece that repeats after the last piece.

    The pieces follow each other in time. The state x₀, ``(n,)``, solves the linear system
    (I − Φ) x₀ = r, because the state after all pieces is Φ x₀ + r.
    """
    size = pieces[0].matrix.shape[0]
    flow, offset = np.eye(size), np.zeros(size)
    for part in pieces:
        offset = part.end(offset)
        flow = part.flow @ flow
    return np.asarray(np.linalg.solve(np.eye(size) - flow, offset))

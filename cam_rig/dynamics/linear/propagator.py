"""Exact response of a linear system ẋ = A x + f(t) to a polynomial forcing.

On one polynomial piece of duration T the forcing is f(u) = Σ Fⱼ Bⱼ(u) with u = t/T and the
Bernstein basis Bⱼ. The response is x(t) = X(u) + e^{At} (x₀ − X(0)) with a polynomial X. There are
no time steps, so a stiff system costs no more than a soft one. X is computed by the method that
keeps its digits:

* For modes that are fast compared with the piece (|λ|T is at least the degree), X solves the
  Sylvester equation A X − X Mᵀ/T = −F. M is the derivative matrix of the basis. The equation has a
  solution because M is nilpotent.
* For slow modes the solution of this equation would be huge and would cancel against the
  exponential. For modes without a restoring force it does not exist. For these modes X(0) = 0, and
  X is Picard's series of repeated integrals, whose terms are below rounding after about twenty
  terms. The piece is divided into equal parts that are short enough for the series.

An ordered Schur form separates fast and slow modes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.dynamics.linear.exponential import free_motion, linalg
from cam_rig.laws import bernstein
from cam_rig.units import FloatArray

#: Largest product ‖A‖T of the slow modes of a system ẋ = A x + f and a duration T. A polynomial
#: piece of the forcing f is divided into parts that satisfy it. The terms of Picard's series then
#: stay below e⁴.
PICARD_REACH = 4.0
#: Largest ratio κ/δ² of an overdamped mass ẍ + 2δ ẋ + κ x = 0 at which its two decay rates count as
#: very different.
MAX_STIFFNESS_RATIO = 0.3


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
    return np.stack([free_motion(matrix, unit, times).T for unit in np.eye(2)], axis=2)


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
    slow = (rates[:, None] * durations < bound).sum(axis=0)
    responses: dict[int, ForcingPiece] = {}
    for k in np.unique(slow):
        group = np.flatnonzero(slow == k)
        modes = _modes(matrix, float(durations[group[0]]), bound)
        norm = float(np.linalg.norm(modes[0], 2)) if modes[0].size else 0.0
        parts = np.maximum(1, np.ceil(norm * durations[group] / PICARD_REACH)).astype(int)
        terms = np.array([_picard_terms(norm * t) for t in durations[group] / parts])
        for count, order in {*zip(parts.tolist(), terms.tolist(), strict=True)}:
            same = group[(parts == count) & (terms == order)]
            solved = _solve(matrix, modes, forcing[:, :, same], durations[same], count, order)
            responses.update(zip(same.tolist(), solved, strict=True))
    return tuple(responses[i] for i in range(durations.size))


def _solve(
    matrix: FloatArray,
    modes: tuple[FloatArray, FloatArray, FloatArray],
    forcing: FloatArray,
    durations: FloatArray,
    parts: int,
    terms: int,
) -> list[ForcingPiece]:
    """Return the responses on m forcing pieces with the same slow and fast modes.

    The system is ẋ = A x + f with A = ``matrix``. ``modes`` is the result of `_modes`. ``forcing``
    are the Bernstein ordinates of f, ``(n, p + 1, m)``, and ``durations`` are in s. Each piece is
    divided into ``parts`` equal parts. For the slow modes Picard's series has ``terms`` integrals
    after the first.
    """
    slow, fast, shapes = modes
    (n, width, m), k = forcing.shape, slow.shape[0]
    # Scale the rows to one magnitude. Otherwise the pivot of the linear solve is the row of a
    # velocity, and the forcing of a slow mode loses its digits by cancellation.
    scale = np.exp2(-np.round(np.log2(np.abs(shapes).max(axis=1, keepdims=True))))
    inputs = np.linalg.solve(scale * shapes, scale * forcing.reshape(n, -1)).reshape(n, width, m)
    inputs = np.asarray(inputs, dtype=np.float64).transpose(1, 2, 0)
    fast_response = np.zeros((width, m, n - k))
    if fast.size:
        slope, solve = derivative_matrix(width - 1), linalg().solve_sylvester
        for i, duration in enumerate(durations.tolist()):
            fast_response[:, i] = solve(fast, -slope.T / duration, -inputs[:, i, k:].T).T
    lengths = durations / parts
    responses = []
    for i in range(parts):
        span = (i / parts, (i + 1) / parts)
        part = bernstein.restrict(inputs[:, :, :k].reshape(width, m * k), *span)
        slow_part = _picard(slow, part.reshape(width, m, k), lengths, terms)
        fast_part = bernstein.restrict(fast_response.reshape(width, m * (n - k)), *span)
        fast_part = bernstein.elevate(fast_part, slow_part.shape[0] - 1)
        fast_part = fast_part.reshape(len(slow_part), m, n - k)
        responses.append(np.concatenate([slow_part, fast_part], axis=2) @ shapes.T)
    particular = np.ascontiguousarray(np.stack(responses).transpose(2, 0, 3, 1))
    flows = exponentials(matrix, lengths)
    return [
        ForcingPiece(matrix, x, float(duration), flow)
        for x, duration, flow in zip(particular, durations, flows, strict=True)
    ]


def _modes(
    matrix: FloatArray, duration: float, bound: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Separate the slow and the fast modes of a matrix A.

    Returns the slow block, the fast block, and the matrix V with A V = V diag(slow, fast). A mode
    with eigenvalue λ is slow if |λ|T < ``bound``, with the ``duration`` T in s. A block is empty if
    there is no such mode.
    """
    overdamped = _overdamped_modes(matrix)
    if overdamped is not None:
        rates, shapes = overdamped
        k = int(np.sum(np.abs(rates) * duration < bound))
        return np.diag(rates[:k]), np.diag(rates[k:]), shapes
    balanced, scale = linalg().matrix_balance(matrix)
    triangle, basis, k = linalg().schur(
        balanced, output="real", sort=lambda re, im: math.hypot(re, im) * duration < bound
    )
    if k == 0:  # no slow modes: the matrix itself, because a transformation would add rounding
        return np.empty((0, 0)), matrix, np.eye(matrix.shape[0])
    slow, fast = triangle[:k, :k], triangle[k:, k:]
    decouple = np.eye(matrix.shape[0])
    if k < matrix.shape[0]:
        decouple[:k, k:] = linalg().solve_sylvester(slow, -fast, -triangle[:k, k:])
    return slow, fast, np.asarray(scale @ basis @ decouple)


def _overdamped_modes(matrix: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return the eigenvalues and mode shapes of an overdamped mass, or None.

    The eigenvalues are (slow, fast), 1/s, and the mode shapes are the columns of a matrix. The
    result is None if ``matrix`` is not that of one mass whose two rates are very different. The
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

    Further integrals are below rounding. ``reach`` is the product ‖A‖T of the slow modes and the
    duration.
    """
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
    the Bernstein ordinates of f, ``(p + 1, m, k)``, for m pieces and k states. ``durations`` are in
    s, ``(m,)``. Returns the Bernstein ordinates of the sum, ``(q + 1, m, k)``.
    """
    lengths = durations[:, None]
    integrals = [lengths * bernstein.antiderivative(forcing)]
    for _ in range(terms):
        integrals.append(lengths * bernstein.antiderivative(integrals[-1] @ matrix.T))
    total = integrals[0]
    for term in integrals[1:]:
        flat = bernstein.elevate(
            total.reshape(len(total), math.prod(total.shape[1:])), term.shape[0] - 1
        )
        total = flat.reshape(term.shape) + term
    return np.asarray(total)


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

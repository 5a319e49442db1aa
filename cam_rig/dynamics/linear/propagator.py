"""The exact response of a linear system to a polynomial forcing: ẋ = A x + f(t).

On one piece of duration T the forcing is f(u) = Σ Fⱼ Bⱼ(u), u = t/T, and the response is
x(t) = X(u) + e^{At} (x₀ − X(0)) with a polynomial X. Nothing is stepped, so stiffness costs
nothing. X is found in the way that keeps its digits:

* modes fast against the piece (|λ|T at least the degree): A X − X Mᵀ/T = −F, a Sylvester
  equation with M the derivative matrix of the basis, solvable because M is nilpotent;
* slow modes, where that X would be huge and cancel against the exponential, and modes without
  a restoring force, where it does not exist: X(0) = 0 and Picard's series of integrals, which
  ends at rounding after some twenty terms.

An ordered Schur form keeps the two apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.dynamics.linear.exponential import free_motion, linalg
from cam_rig.laws import bernstein
from cam_rig.units import FloatArray

#: A part of a piece spans at most this |A|T of its slow modes: Picard's terms stay below e⁴.
PICARD_REACH = 4.0
#: An overdamped mass has rates far apart where its stiffness is below this times decay squared.
APART = 0.3


@lru_cache(maxsize=64)
def derivative_matrix(degree: int) -> FloatArray:
    """``(p + 1, p + 1)``: takes ordinates to those of d/du, written with the same degree."""
    return np.asarray(bernstein.elevate(bernstein.derivative(np.eye(degree + 1)), degree))


def exponential(matrix: FloatArray, time: float) -> FloatArray:
    """e^{At}: for two states in closed form, whose error is that of the phase; else by expm.

    Scaling and squaring lets a vibration of 3000 rad drift by ten times as much, turn after turn.
    """
    return np.asarray(exponentials(matrix, np.array([time]))[0])


def exponentials(matrix: FloatArray, times: FloatArray) -> FloatArray:
    """The same at many times ``(m,)``, ``(m, n, n)``."""
    if matrix.shape[0] != 2:
        flows: FloatArray = linalg().expm(matrix * times[:, None, None])
        return flows
    return np.stack([free_motion(matrix, unit, times).T for unit in np.eye(2)], axis=2)


@dataclass(frozen=True, eq=False)
class ForcingPiece:
    """One piece of the response, in one or more equal parts."""

    matrix: FloatArray
    particular: FloatArray  #: ``(parts, n, p + 1)``, the ordinates of X on each part
    duration: float  #: s
    part_flow: FloatArray  #: e^{Ah} over one part

    @property
    def part(self) -> float:
        """Length of a part, s."""
        return self.duration / len(self.particular)

    @property
    def flow(self) -> FloatArray:
        """e^{AT} over the whole piece."""
        return np.asarray(np.linalg.matrix_power(self.part_flow, self.particular.shape[0]))

    def end(self, start: FloatArray) -> FloatArray:
        """State at the end of the piece from the state at its start, ``(n,)``."""
        return self._part_starts(start)[-1]

    def at(self, start: FloatArray, times: FloatArray) -> FloatArray:
        """States ``(n, len(times))`` at times in s since the piece's start."""
        starts = self._part_starts(start)
        states = np.empty((start.size, times.size))
        index = np.minimum((times / self.part).astype(int), self.particular.shape[0] - 1)
        for i in np.unique(index):
            here = index == i
            since = times[here] - i * self.part
            forced = bernstein.evaluate(self.particular[i].T, since / self.part)
            flows = linalg().expm(self.matrix[None] * since[:, None, None])
            states[:, here] = (forced + flows @ (starts[i] - self.particular[i, :, 0])).T
        return states

    def _part_starts(self, start: FloatArray) -> list[FloatArray]:
        states = [start]
        for ordinates in self.particular:
            free = self.part_flow @ (states[-1] - ordinates[:, 0])
            states.append(np.asarray(ordinates[:, -1] + free))
        return states


def piece(matrix: FloatArray, forcing: FloatArray, duration: float) -> ForcingPiece:
    """Solve one piece: A ``(n, n)`` in 1/s, ordinates of f ``(n, p + 1)``, its time (s)."""
    return pieces(matrix, forcing[:, :, None], np.array([duration]))[0]


def pieces(
    matrix: FloatArray, forcing: FloatArray, durations: FloatArray
) -> tuple[ForcingPiece, ...]:
    """The same for m pieces, those together that take the same steps: f ``(n, p + 1, m)``."""
    bound = max(float(forcing.shape[1] - 1), PICARD_REACH)
    rates = np.abs(np.linalg.eigvals(matrix))
    slow = (rates[:, None] * durations < bound).sum(axis=0)
    found: dict[int, ForcingPiece] = {}
    for k in np.unique(slow):
        alike = np.flatnonzero(slow == k)
        modes = _modes(matrix, float(durations[alike[0]]), bound)
        reach = float(np.linalg.norm(modes[0], 2)) if modes[0].size else 0.0
        parts = np.maximum(1, np.ceil(reach * durations[alike] / PICARD_REACH)).astype(int)
        terms = np.array([_picard_terms(reach * t) for t in durations[alike] / parts])
        for count, order in {*zip(parts.tolist(), terms.tolist(), strict=True)}:
            same = alike[(parts == count) & (terms == order)]
            solved = _solve(matrix, modes, forcing[:, :, same], durations[same], count, order)
            found.update(zip(same.tolist(), solved, strict=True))
    return tuple(found[i] for i in range(durations.size))


def _solve(
    matrix: FloatArray,
    modes: tuple[FloatArray, FloatArray, FloatArray],
    forcing: FloatArray,
    durations: FloatArray,
    parts: int,
    terms: int,
) -> list[ForcingPiece]:
    """Pieces with the same slow and fast modes, in so many parts, by so many of Picard's terms."""
    slow, fast, shapes = modes
    (n, width, m), k = forcing.shape, slow.shape[0]
    # Rows of one size: else the pivot is a velocity, and what drives a slow mode cancels.
    even = np.exp2(-np.round(np.log2(np.abs(shapes).max(axis=1, keepdims=True))))
    inputs = np.linalg.solve(even * shapes, even * forcing.reshape(n, -1)).reshape(n, width, m)
    inputs = np.asarray(inputs, dtype=np.float64).transpose(1, 2, 0)
    settled = np.zeros((width, m, n - k))
    if fast.size:
        slope, solve = derivative_matrix(width - 1), linalg().solve_sylvester
        for i, duration in enumerate(durations.tolist()):
            settled[:, i] = solve(fast, -slope.T / duration, -inputs[:, i, k:].T).T
    lengths = durations / parts
    responses = []
    for i in range(parts):
        span = (i / parts, (i + 1) / parts)
        part = bernstein.restrict(inputs[:, :, :k].reshape(width, m * k), *span)
        grown = _picard(slow, part.reshape(width, m, k), lengths, terms)
        rest = bernstein.restrict(settled.reshape(width, m * (n - k)), *span)
        rest = bernstein.elevate(rest, grown.shape[0] - 1).reshape(len(grown), m, n - k)
        responses.append(np.concatenate([grown, rest], axis=2) @ shapes.T)
    particular = np.ascontiguousarray(np.stack(responses).transpose(2, 0, 3, 1))
    flows = exponentials(matrix, lengths)
    return [
        ForcingPiece(matrix, x, float(duration), flow)
        for x, duration, flow in zip(particular, durations, flows, strict=True)
    ]


def _modes(
    matrix: FloatArray, duration: float, bound: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Slow block, fast block and V with A V = V diag(slow, fast); slow has |λ|T < bound."""
    creeping = _creeping(matrix)
    if creeping is not None:
        rates, shapes = creeping
        k = int(np.sum(np.abs(rates) * duration < bound))
        return np.diag(rates[:k]), np.diag(rates[k:]), shapes
    balanced, scale = linalg().matrix_balance(matrix)
    triangle, basis, k = linalg().schur(
        balanced, output="real", sort=lambda re, im: math.hypot(re, im) * duration < bound
    )
    if k == 0:  # nothing to keep apart: the matrix as it is has the smallest rounding
        return np.empty((0, 0)), matrix, np.eye(matrix.shape[0])
    slow, fast = triangle[:k, :k], triangle[k:, k:]
    decouple = np.eye(matrix.shape[0])
    if k < matrix.shape[0]:
        decouple[:k, k:] = linalg().solve_sylvester(slow, -fast, -triangle[:k, k:])
    return slow, fast, np.asarray(scale @ basis @ decouple)


def _creeping(matrix: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Rates, slow and fast, and shapes of one overdamped mass whose rates stand far apart.

    The slow rate is the stiffness over the fast one: Schur's form gives it to the rounding of the
    fast one, which may be the larger by 1e7. None for any other matrix.
    """
    if matrix.shape != (2, 2) or tuple(matrix[0]) != (0.0, 1.0):
        return None
    stiffness, decay = -float(matrix[1, 0]), -0.5 * float(matrix[1, 1])
    if not (decay > 0.0 and 0.0 < stiffness < APART * decay**2):
        return None
    fast = -decay - math.sqrt(decay**2 - stiffness)
    rates = np.array([stiffness / fast, fast])
    return rates, np.stack([np.ones(2), rates])


def _picard_terms(reach: float) -> int:
    """How many integrals follow the first one until they are rounding; ``reach`` is |A|T."""
    size, order = reach, 2
    while size > 1e-17:
        size *= reach / order
        order += 1
    return order - 2


def _picard(
    matrix: FloatArray, forcing: FloatArray, durations: FloatArray, terms: int
) -> FloatArray:
    """∫f + A∫∫f + A²∫∫∫f and so on: ``(q + 1, m, k)`` of forcing ``(p + 1, m, k)``."""
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
    """The state that returns to itself after all pieces: (I − Φ) x₀ = r, one linear solve."""
    size = pieces[0].matrix.shape[0]
    flow, rest = np.eye(size), np.zeros(size)
    for part in pieces:
        rest = part.end(rest)
        flow = part.flow @ flow
    return np.asarray(np.linalg.solve(np.eye(size) - flow, rest))

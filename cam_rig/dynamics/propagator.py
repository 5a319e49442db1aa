"""The exact response of a linear system to a polynomial forcing: ẋ = A x + f(t).

On one piece of duration T the forcing is f(u) = Σ Fⱼ Bⱼ(u), u = t/T. With M the derivative
matrix of the basis, a polynomial particular solution X satisfies the Sylvester equation
A X − X Mᵀ/T = −F, which has one solution whenever A is invertible, resonance included, because
M is nilpotent. The rest is e^{At}. Nothing is stepped, so stiffness costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm, solve_sylvester

from cam_rig.dynamics.block import FloatArray
from cam_rig.errors import DynamicsError
from cam_rig.laws import bernstein


@lru_cache(maxsize=64)
def derivative_matrix(degree: int) -> FloatArray:
    """``(p + 1, p + 1)``: takes ordinates to those of d/du, written with the same degree."""
    return np.asarray(bernstein.elevate(bernstein.derivative(np.eye(degree + 1)), degree))


@dataclass(frozen=True, eq=False)
class Piece:
    """One piece of the response: x(t) = X(t/T) + e^{At} (x₀ − X(0))."""

    matrix: FloatArray
    particular: FloatArray
    duration: float
    flow: FloatArray

    def end(self, start: FloatArray) -> FloatArray:
        """State at the end of the piece from the state at its start, ``(n,)``."""
        return np.asarray(
            self.particular[:, -1] + self.flow @ (start - self.particular[:, 0]), dtype=np.float64
        )

    def at(self, start: FloatArray, times: FloatArray) -> FloatArray:
        """States ``(n, len(times))`` at times in s since the piece's start."""
        degree = self.particular.shape[1] - 1
        forced = self.particular @ bernstein.basis(degree, times / self.duration).T
        flows = expm(self.matrix[None] * times[:, None, None])
        return np.asarray(forced + (flows @ (start - self.particular[:, 0])).T)


def piece(matrix: FloatArray, forcing: FloatArray, duration: float) -> Piece:
    """Solve one piece.

    Parameters
    ----------
    matrix : ``(n, n)``, 1/s
    forcing : ``(n, p + 1)`` Bernstein ordinates of f over the piece
    duration : s

    Raises
    ------
    DynamicsError : the matrix is singular (a system with no restoring force)
    """
    smallest = np.abs(np.linalg.eigvals(matrix)).min()
    if not smallest > 1e-14 * np.abs(matrix).max():
        raise DynamicsError(
            f"the system matrix has an eigenvalue {smallest:g}; allowed: a restoring force in "
            "every mode"
        )
    slope = derivative_matrix(forcing.shape[1] - 1) / duration
    particular = np.asarray(solve_sylvester(matrix, -slope.T, -forcing), dtype=np.float64)
    return Piece(matrix, particular, duration, np.asarray(expm(matrix * duration)))


def periodic_state(pieces: list[Piece]) -> FloatArray:
    """The state that returns to itself after all pieces: (I − Φ) x₀ = r, one linear solve."""
    size = pieces[0].matrix.shape[0]
    flow, rest = np.eye(size), np.zeros(size)
    for part in pieces:
        rest = part.end(rest)
        flow = part.flow @ flow
    return np.asarray(np.linalg.solve(np.eye(size) - flow, rest))

"""e^{At} z at many times."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.dynamics.linear.impulse_response import response
from cam_rig.dynamics.linear.scipy_linalg import expm, matrix_balance

#: Modes whose shapes are more alike than this are not used: their digits would cancel.
WORST_CONDITION = 1e4


def free_motion(matrix: FloatArray, start: FloatArray, times: FloatArray) -> FloatArray:
    """e^{At} z at any times (s), ``(n, len(times))``; z is ``(n,)``, or ``(n, len(times))``.

    For two states by Cayley-Hamilton, e^{At} = (Ṡ + 2δS) I + S A with the impulse response S of the
    characteristic equation; for more by modes, or one exponential a time where modes coincide.
    """
    starts = start[:, None] if start.ndim == 1 else start
    if starts.shape[0] == 2:
        (a, b), (c, d) = matrix.tolist()
        damping, stiffness = -(a + d), a * d - b * c
        impulse, rate, _ = response(damping, stiffness, times)
        return np.asarray(starts * (rate + damping * impulse) + (matrix @ starts) * impulse)
    modes = _modes(matrix.tobytes(), starts.shape[0], WORST_CONDITION)
    if modes is None:
        flows = expm(matrix[None] * times[:, None, None])
        return np.asarray(np.matmul(flows, starts.T[:, :, None])[:, :, 0].T)
    rates, shapes, inverse = modes
    return np.asarray(shapes @ ((inverse @ starts) * np.exp(np.outer(rates, times)))).real


@lru_cache(maxsize=64)
def _modes(
    data: bytes, size: int, worst: float
) -> tuple[ComplexArray, ComplexArray, ComplexArray] | None:
    """Rates, shapes and inverse shapes of a matrix; None when its modes are too much alike."""
    matrix = np.frombuffer(data).reshape(size, size)
    balanced, scale = matrix_balance(matrix)
    rates, vectors = np.linalg.eig(balanced)
    if np.linalg.cond(vectors) > worst:
        return None
    shapes = scale @ vectors.astype(np.complex128)
    inverse = np.asarray(np.linalg.inv(shapes), dtype=np.complex128)
    return rates.astype(np.complex128), np.asarray(shapes, dtype=np.complex128), inverse

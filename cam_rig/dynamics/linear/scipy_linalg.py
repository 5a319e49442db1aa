"""What the models use of `scipy.linalg`, imported by the first call: many scenes need none of it.

Its import takes as long as all other modules of the rig's models together.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cam_rig.arrays import FloatArray


def expm(matrices: FloatArray) -> FloatArray:
    """e^A of ``(..., n, n)``."""
    from scipy.linalg import expm as function

    return np.asarray(function(matrices), dtype=np.float64)


def matrix_balance(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The matrix with rows and columns of like size, and what it was transformed with."""
    from scipy.linalg import matrix_balance as function

    balanced, scale = function(matrix)
    return np.asarray(balanced), np.asarray(scale)


def schur(matrix: FloatArray, **how: Any) -> tuple[FloatArray, FloatArray, int]:
    """Ordered real Schur form: triangle, basis, and how many eigenvalues come first."""
    from scipy.linalg import schur as function

    triangle, basis, count = function(matrix, **how)
    return np.asarray(triangle), np.asarray(basis), int(count)


def solve_sylvester(left: FloatArray, right: FloatArray, value: FloatArray) -> FloatArray:
    """X of A X + X B = Q."""
    from scipy.linalg import solve_sylvester as function

    return np.asarray(function(left, right, value), dtype=np.float64)

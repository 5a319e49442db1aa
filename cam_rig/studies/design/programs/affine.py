"""Quantities that are affine in a design's unknowns, c + A x: what a linear program is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cam_rig.arrays import FloatArray

#: Indices, a mask or a slice.
Chosen = NDArray[np.intp] | NDArray[np.bool_] | slice


@dataclass(frozen=True, eq=False)
class Affine:
    """Values c + A x, ``(n,)``, of unknowns x ``(m,)``.

    Parameters
    ----------
    constant : c, ``(n,)``
    matrix : A, sparse, ``(n, m)``
    """

    constant: FloatArray
    matrix: sparse.csr_array

    def __call__(self, unknowns: FloatArray) -> FloatArray:
        """The values at unknowns ``(m,)``."""
        return np.asarray(self.constant + self.matrix @ unknowns)

    def __add__(self, other: Affine) -> Affine:
        return Affine(self.constant + other.constant, sparse.csr_array(self.matrix + other.matrix))

    def __mul__(self, factor: float) -> Affine:
        return Affine(self.constant * factor, sparse.csr_array(self.matrix * factor))

    def plus(self, number: float | FloatArray) -> Affine:
        """The values and a number more."""
        return Affine(self.constant + number, self.matrix)

    def mapped(self, matrix: sparse.csr_array) -> Affine:
        """``matrix`` times the values."""
        return Affine(np.asarray(matrix @ self.constant), sparse.csr_array(matrix @ self.matrix))

    def rows(self, chosen: Chosen) -> Affine:
        """Some of the values."""
        return Affine(self.constant[chosen], sparse.csr_array(self.matrix[chosen]))

    @staticmethod
    def stacked(parts: list[Affine]) -> Affine:
        """The values of all, one after the other."""
        matrices = [part.matrix for part in parts]
        return Affine(
            np.concatenate([part.constant for part in parts]),
            sparse.csr_array(sparse.vstack(matrices, format="csr")),
        )

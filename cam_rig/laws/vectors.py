"""Vectors and matrices of the kernels, in plain Python or compiled by numba."""

from __future__ import annotations

import math
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from cam_rig.units import FloatArray

T = TypeVar("T")
#: Array of n numbers, ``(n,)``.
Vector: TypeAlias = FloatArray
#: Array of numbers, ``(m, n)``.
Matrix: TypeAlias = FloatArray
#: Array of l matrices, ``(l, m, n)``.
Matrices: TypeAlias = FloatArray
#: Records of a structured array, ``(n,)``.
Records: TypeAlias = NDArray[np.void]
#: Rows of Pascal's triangle, up to degree 95, which few laws reach.
PASCAL = np.array([[float(math.comb(n, i)) for i in range(96)] for n in range(96)])


def index_at(ascending: Vector, value: float) -> int:
    """Return the index of the last number that is not larger than a value, at least 0."""
    low, high = 0, len(ascending)
    while high - low > 1:
        middle = (low + high) // 2
        if ascending[middle] <= value:
            low = middle
        else:
            high = middle
    return low


def binomials(degree: int) -> Vector:
    """Return the binomial coefficients C(degree, i) for i from 0 to ``degree``."""
    if degree < len(PASCAL):
        return without_refcount(PASCAL[degree, : degree + 1])
    out, term = np.zeros(degree + 1), 1.0
    for i in range(degree + 1):
        out[i] = term
        term = term * (degree - i) / (i + 1)
    return out


def without_refcount(table: T) -> T:
    """Return the table, whose references compiled code does not count.

    Counting takes a third of the time. The caller of a kernel keeps the table alive.
    """
    return table


def dot(left: Vector, right: Vector) -> float:
    """Return the scalar product of two vectors, summed in order."""
    total = 0.0
    for i in range(len(left)):
        total += left[i] * right[i]
    return total


def max_abs(vector: Vector) -> float:
    """Return the largest absolute value of a vector, 0 if it is empty."""
    largest = 0.0
    for value in vector:
        largest = max(largest, abs(value))
    return largest


def min_of(vector: Vector) -> float:
    """Return the smallest value of a vector, infinite if it is empty."""
    smallest = math.inf
    for value in vector:
        smallest = min(smallest, value)
    return smallest

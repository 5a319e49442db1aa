"""Rows of numbers as the event search takes them, in plain Python and in what numba compiles."""

from __future__ import annotations

import math
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from cam_rig.units import FloatArray

T = TypeVar("T")
#: ``(n,)`` and ``(m, n)`` numbers, and ``(l, m, n)``.
Row: TypeAlias = FloatArray
Rows: TypeAlias = FloatArray
Stack: TypeAlias = FloatArray
#: Records of a structured array, ``(n,)``.
Records: TypeAlias = NDArray[np.void]
#: Rows of Pascal's triangle, up to a degree that few laws reach.
PASCAL = np.array([[float(math.comb(n, i)) for i in range(96)] for n in range(96)])
zeros = np.zeros


def index_at(rising: Row, value: float) -> int:
    """Index of the last of some rising numbers that is no larger than a value; at least 0."""
    low, high = 0, len(rising)
    while high - low > 1:
        middle = (low + high) // 2
        if rising[middle] <= value:
            low = middle
        else:
            high = middle
    return low


def binomials(degree: int) -> Row:
    """C(degree, i), i from 0 to ``degree``."""
    if degree < len(PASCAL):
        return borrowed(PASCAL[degree, : degree + 1])
    out, term = zeros(degree + 1), 1.0
    for i in range(degree + 1):
        out[i] = term
        term = term * (degree - i) / (i + 1)
    return out


def borrowed(table: T) -> T:
    """The table; compiled one whose arrays are not counted as used, for the caller keeps them."""
    return table


def dot(one: Row, other: Row) -> float:
    """Scalar product, added up in order."""
    total = 0.0
    for i in range(len(one)):
        total += one[i] * other[i]
    return total


def size_of(row: Row) -> float:
    """Largest absolute value."""
    largest = 0.0
    for value in row:
        largest = max(largest, abs(value))
    return largest

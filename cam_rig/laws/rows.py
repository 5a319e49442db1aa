"""Rows of numbers as the event search takes them: lists in plain Python, arrays where compiled.

The modules that are compiled are written for both: floats, whole numbers, rows and tuples of these,
loops over them, functions of `math`. Plain Python reads an element of a list five times as quickly
as one of an array; the compiled code has only arrays. Either does the same operations in the same
order, so that the bits are the same.
"""

from __future__ import annotations

import math
from typing import TypeAlias, TypeVar

T = TypeVar("T")
#: ``(n,)`` and ``(m, n)`` numbers.
Row: TypeAlias = list[float]
Rows: TypeAlias = list[list[float]]
Stack: TypeAlias = list[list[list[float]]]
#: Rows of Pascal's triangle, up to a degree that few laws reach.
PASCAL: Rows = [[float(math.comb(n, i)) for i in range(n + 1)] for n in range(96)]


def zeros(count: int) -> Row:
    """A row of zeros; compiled an array of them."""
    return [0.0] * count


def zero_rows(count: int, size: int) -> Rows:
    """``(count, size)`` zeros; compiled an array of them."""
    return [[0.0] * size for _ in range(count)]


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


def column(rows: Rows, index: int) -> Row:
    """One number of each row."""
    out = zeros(len(rows))
    for j in range(len(rows)):
        out[j] = rows[j][index]
    return out


def binomials(degree: int) -> Row:
    """C(degree, i), i from 0 to ``degree``."""
    if degree < len(PASCAL):
        return PASCAL[degree]
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

"""Analysis of variance of a full table with one value a cell: two ways, or factors of two levels.

The values come from a model without scatter, so there is nothing to test against: what counts are
the shares of the sum of squares. What rows and columns do not explain together is interaction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cam_rig.units import FloatArray


@dataclass(frozen=True, eq=False)
class TwoWay:
    """Effects of rows ``(a,)`` and columns ``(b,)`` about the mean, and sums of squares.

    ``classes`` is the part of ``rows`` that lies between groups of rows; the rest is within them.
    """

    mean: float
    row_effects: FloatArray
    column_effects: FloatArray
    rows: float
    classes: float
    columns: float
    interaction: float

    @property
    def total(self) -> float:
        """Sum of squares about the mean."""
        return self.rows + self.columns + self.interaction

    @property
    def shares(self) -> tuple[float, float, float]:
        """Shares of rows, columns and interaction; all zero where nothing varies."""
        whole = self.total or 1.0
        return self.rows / whole, self.columns / whole, self.interaction / whole

    @property
    def class_share(self) -> float:
        """Share of what lies between groups of rows."""
        return self.classes / (self.total or 1.0)


def two_way(values: FloatArray, groups: Sequence[object] | None = None) -> TwoWay:
    """Analyse a table ``(a, b)``; rows of one label of ``groups`` are a class, or each its own."""
    a, b = values.shape
    mean = float(values.mean())
    row, column = values.mean(axis=1) - mean, values.mean(axis=0) - mean
    left = values - mean - row[:, None] - column
    labels = list(groups) if groups is not None else list(range(a))
    members = [[i for i in range(a) if labels[i] == label] for label in dict.fromkeys(labels)]
    between = sum(len(rows) * float(row[rows].mean()) ** 2 for rows in members)
    return TwoWay(
        mean=mean,
        row_effects=row,
        column_effects=column,
        rows=b * float(row @ row),
        classes=b * between,
        columns=a * float(column @ column),
        interaction=float((left**2).sum()),
    )


def two_levels(values: FloatArray) -> dict[tuple[int, ...], float]:
    """Shares of the sum of squares of k factors with two levels each, and of their interactions.

    Of ``values`` ``(2, …, 2)``, an axis a factor; by the axes that act together, ``(0,)`` or
    ``(0, 2)``. They add up to one, or are all zero where nothing varies.
    """
    signs = np.array([-1.0, 1.0])
    squares = {}
    for count in range(1, values.ndim + 1):
        for axes in combinations(range(values.ndim), count):
            contrast = values
            for axis in axes:
                shape = [2 if i == axis else 1 for i in range(values.ndim)]
                contrast = contrast * signs.reshape(shape)
            squares[axes] = float(contrast.mean()) ** 2
    whole = sum(squares.values()) or 1.0
    return {axes: square / whole for axes, square in squares.items()}

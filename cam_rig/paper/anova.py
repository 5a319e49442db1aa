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


def two_way(values: FloatArray, groups: Sequence[object] | None = None) -> TwoWay:
    """Analyse a table ``(a, b)``.

    Parameters
    ----------
    groups : one label a row: rows with the same label are one class; by default each its own
    """
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

    Parameters
    ----------
    values : ``(2, …, 2)``, one axis a factor

    Returns
    -------
    By the axes that act together, ``(0,)`` or ``(0, 2)``: shares that add up to one, all zero
    where nothing varies.

    Examples
    --------
    >>> import numpy as np
    >>> two_levels(np.array([[0.0, 0.0], [2.0, 2.0]]))
    {(0,): 1.0, (1,): 0.0, (0, 1): 0.0}
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

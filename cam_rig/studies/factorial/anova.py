"""Two-way analysis of variance of a full table with one value a cell.

The values come from a model without scatter, so there is nothing to test against: what counts are
the shares of the sum of squares. What rows and columns do not explain together is interaction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cam_rig.arrays import FloatArray


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

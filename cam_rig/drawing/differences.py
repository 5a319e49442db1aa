"""How large a difference is drawn: what only rounding makes is drawn as none, and called so."""

from __future__ import annotations

#: Differences smaller than this, in µm and N, are of rounding: no bench has such gauges.
LEAST_DIFFERENCE = 1e-3
#: What is written where there is no other, and how far (µm, N) the axis goes there.
EQUAL, EQUAL_REACH = "equal to rounding", 1.0


def is_rounding(largest: float) -> bool:
    """Whether a largest difference (µm, N) is only of rounding."""
    return largest < LEAST_DIFFERENCE


def reach(largest: float) -> float:
    """How far to both sides of zero an axis goes for a largest difference (µm, N).

    Examples
    --------
    >>> reach(20.0), reach(5e-9)
    (23.0, 1.0)
    """
    return EQUAL_REACH if is_rounding(largest) else 1.15 * largest

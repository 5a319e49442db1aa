"""The first time a function falls below zero, with a proof that none was missed before.

Far from zero it is looked at in steps: between two times a step h apart a function whose second
derivative is nowhere above M is no lower than the lower of the two less M h²/8. Near zero it is a
polynomial in Bernstein form, which is positive where all its ordinates are.
"""

from __future__ import annotations

import math

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import bernstein

#: Times that are looked at together.
TOGETHER = 48


def clear_cells(times: FloatArray, values: FloatArray, bends: FloatArray, noise: float) -> int:
    """How many cells from the first on are proved to be above ``noise``.

    Parameters
    ----------
    times, values : ``(n,)``; a cell lies between two neighbours
    bends : ``(n - 1,)`` what |f̈| does not exceed in each cell
    noise : what rounding may add to a value
    """
    lowest = np.minimum(values[:-1], values[1:])
    doubt = lowest - bends * np.diff(times) ** 2 / 8.0 <= noise
    return int(np.argmax(doubt)) if doubt.any() else doubt.size


def step(value: float, bend: float, least: float) -> float:
    """Step for the next look at a function that has a value now; ``least`` where it is near zero.

    Half of a cell's greatest width at that value: it may fall on the way.
    """
    return max(least, math.sqrt(2.0 * max(value, 0.0) / bend)) if bend > 0.0 else math.inf


def fall(ordinates: FloatArray, noise: float) -> float | None:
    """U ∈ [0, 1] of the zero after which a polynomial is below −``noise``; None without one.

    One that is below at its start already falls there; so does one that begins below zero, if by
    less, and goes on falling.
    """
    if ordinates.min() >= -noise:
        return None
    if ordinates[0] < -noise:
        return 0.0
    below = bernstein.crossings(ordinates + noise)
    if not below:
        return None
    zeros = [u for u in bernstein.crossings(ordinates) if u <= below[0]]
    return zeros[-1] if zeros else 0.0

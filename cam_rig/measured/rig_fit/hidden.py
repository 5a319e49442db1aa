"""What the forces beside landings say, which a search leaves out, of two solutions.

A search leaves out the force beside its own landings, where it jumps. One that bounces through the
whole turn leaves out nearly all of it, and so what contradicts it: the follower pressed there. Two
solutions are compared by these samples too. There a landing may be off by a little, so a sample is
as far off as it is from all that the follower shows within that little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cam_rig.measured.rig_fit.search import GUARD, FitSolution, log_ratio
from cam_rig.units import FloatArray

#: A square counts so much at most where restitutions are compared.
MOST_SQUARE = 36.0


def log_ratio_of_all(one: FitSolution, other: FitSolution) -> float:
    """Logarithm of how much likelier what was measured is by one solution, bounces and all."""
    found = log_ratio(one, other)
    for i, hold in enumerate(one.holds):
        if hold in other.holds:
            found += 0.5 * _missed_more(one, i, other, other.holds.index(hold))
    return found


def _missed_more(one: FitSolution, i: int, other: FitSolution, k: int) -> float:
    """By how much more squares the other misses what one of both leaves out of a hold."""
    some = np.flatnonzero(~(one.likelihood.kept[i] & other.likelihood.kept[k]))
    if not some.size:
        return 0.0
    widths = (s.likelihood.beside(s.x, at, GUARD)[some] for s, at in ((one, i), (other, k)))
    wide = np.maximum(GUARD, np.maximum(*widths))
    return float((_squares(other, k, some, wide) - _squares(one, i, some, wide)).sum())


def _squares(found: FitSolution, i: int, some: NDArray[np.intp], wide: FloatArray) -> FloatArray:
    """In deviations, of how far samples are from all that is shown within ``wide`` (rad)."""
    like = found.likelihood
    low, high = like.forces_about(found.x, i, some, wide)
    value = like.holds[i].force.value[some]
    nearest = np.clip(value, low, high)
    deviation = np.hypot(like.force_noise, like.force_part * nearest)
    return np.asarray(np.minimum(((value - nearest) / deviation) ** 2, MOST_SQUARE))

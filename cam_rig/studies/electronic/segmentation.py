"""Fewest quintic segments of a piece of a law that keep the requested errors.

The next segment is the longest that keeps the errors. If each part of a feasible segment is
feasible, no choice of breaks needs fewer segments. Equal spacing is tried too, and is used if it
needs fewer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.laws import bernstein
from cam_rig.laws.law import Law, peak
from cam_rig.studies.electronic.difference import ORDERS, quintic_errors
from cam_rig.units import FloatArray

#: Smallest degree in which pieces and segments are compared, that of the segments.
QUINTIC = 5
#: Number of lengths of a segment that are tried together.
TRIED_LENGTHS = 16
#: Number of times that the interval between a feasible and an infeasible length is refined. The
#: last interval is about 1e-3 of the length.
REFINEMENTS = 3
#: Largest number of segments of a piece. More do not fit in the memory of a controller.
MAX_SEGMENTS = 2000
#: Fraction of the requested errors that segments may have. The rest is left for bridges over jumps
#: of s'' and for the rounding of the digits.
USED_PART = 0.98
#: Smallest length of a segment as a fraction of its piece. The error of a shorter one is rounding.
MIN_LENGTH = 1e-6


class Tolerances(NamedTuple):
    """Largest errors of a segment.

    With the defaults, the residual vibration of each shipped cam at 300 rpm is within 5 % of that
    of the exact law, and the jump speed within 0.1 %.
    """

    lift: float = 2e-9  #: of s, m
    acceleration: float = 0.001  #: of s'', as a fraction of its peak over the turn


#: Test of segments by their ends, as fractions of a piece: True for each that keeps the errors.
Feasibility = Callable[[FloatArray, FloatArray], NDArray[np.bool_]]


def feasibility(law: Law, piece: int, tolerances: Tolerances) -> Feasibility:
    """Return the test of quintic segments within a piece of a law."""
    degree, span = max(law.degree, QUINTIC), float(law.spans[piece])
    rows = [law.derivative_ordinates(order)[:, piece] for order in range(ORDERS)]
    derivatives = np.stack([bernstein.elevate(row, degree) for row in rows])
    max_acceleration = tolerances.acceleration * abs(peak(law, 2).value)
    limits = USED_PART * np.array([[tolerances.lift], [math.inf], [max_acceleration]])

    def are_feasible(starts: FloatArray, stops: FloatArray) -> NDArray[np.bool_]:
        errors = quintic_errors(derivatives, span, starts, stops)
        return np.asarray((errors <= limits).all(axis=0))

    return are_feasible


def fewest_segments(are_feasible: Feasibility) -> list[float]:
    """Return the breaks of the fewest segments of a piece, from 0 to 1.

    Raises
    ------
    ConfigError
        If more than `MAX_SEGMENTS` segments are needed.
    """
    breaks, length = [0.0], 1.0
    while breaks[-1] < 1.0:
        if are_feasible(np.array(breaks[-1:]), np.ones(1))[0]:
            breaks.append(1.0)
            break
        length = _longest(are_feasible, breaks[-1], length)
        breaks.append(breaks[-1] + length)
        if len(breaks) > MAX_SEGMENTS or length < MIN_LENGTH:
            raise ConfigError(
                f"the errors need more than {MAX_SEGMENTS} segments; allowed: larger errors"
            )
    for count in range(1, len(breaks) - 1):
        equal = np.linspace(0.0, 1.0, count + 1)
        if are_feasible(equal[:-1], equal[1:]).all():
            return [float(u) for u in equal]
    return breaks


def _longest(are_feasible: Feasibility, start: float, guess: float) -> float:
    """Return the longest feasible length of a segment that ends within the piece.

    ``guess`` is the length of the segment before it. The result is 0 if no length is feasible.
    """
    low, high = 0.0, 1.0 - start
    lengths = guess * 2.0 ** np.linspace(-3.0, 3.0, TRIED_LENGTHS)
    for _ in range(REFINEMENTS):
        lengths = lengths[lengths < high]
        feasible = np.flatnonzero(are_feasible(np.full(lengths.size, start), start + lengths))
        if feasible.size:
            last = int(feasible[-1])
            low = float(lengths[last])
            high = float(lengths[last + 1]) if last + 1 < lengths.size else high
        elif lengths.size:
            high = float(lengths[0])
        lengths = low + (high - low) * np.arange(1, TRIED_LENGTHS + 1) / (TRIED_LENGTHS + 1)
    return low

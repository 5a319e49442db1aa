"""Proven bounds of the difference of two laws, and of its first two derivatives.

On an interval without a joint of either law, the difference is a polynomial. Its Bernstein
ordinates bound it from both sides (docs/proofs.md, part 1). The interval is divided until the bound
is close to the largest value at the ends of its parts, which the difference does reach.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import EPS
from cam_rig.laws.law import LEVEL_ROUNDINGS, Law
from cam_rig.units import TURN, FloatArray

#: Number of derivatives that are compared: s, s' and s''.
ORDERS = 3
#: Largest ratio of a bound to a value that the difference reaches. An interval above it is divided.
MAX_BOUND_RATIO = 1.1
#: Numbers of parts into which an interval is divided, tried in this order.
PART_COUNTS = (8, 32, 128)
#: Largest difference (rad) of joints of two laws that count as one joint. It is above the rounding
#: of written angles, and below the width of any segment.
JOINT_ATOL_RAD = 1e-10


class ErrorBounds(NamedTuple):
    """Upper bounds of the error of a controller's cam over the turn."""

    lift: float  #: of s, m
    velocity: float  #: of s', m/rad
    acceleration: float  #: of s'', m/rad², infinite if s' jumps where that of the law does not
    jerk_jump: float  #: of the jump of s''' at a joint, m/rad³


def restrict(ordinates: FloatArray, starts: FloatArray, stops: FloatArray) -> FloatArray:
    """Return the ordinates of n polynomials on n intervals [start, stop], start < 1.

    The algorithm is de Casteljau's, for all columns ``(p + 1, n)`` together.
    """
    out = ordinates.copy()
    degree = out.shape[0] - 1
    for count in range(degree, 0, -1):
        out[:count] = (1.0 - starts) * out[:count] + starts * out[1 : count + 1]
    inner = (stops - starts) / (1.0 - starts)
    for order in range(1, degree + 1):
        out[order:] = (1.0 - inner) * out[order - 1 : -1] + inner * out[order:]
    return np.asarray(out)


def bound(ordinates: FloatArray) -> FloatArray:
    """Return an upper bound of the magnitude of each polynomial on [0, 1], ``(n,)``."""
    upper: FloatArray = np.abs(ordinates).max(axis=0)
    active = np.flatnonzero(upper > MAX_BOUND_RATIO * np.abs(ordinates[[0, -1]]).max(axis=0))
    for count in PART_COUNTS:
        if not active.size:
            break
        matrices = bernstein.parts(ordinates.shape[0] - 1, count)
        pieces = np.abs(np.matmul(matrices, ordinates[:, active]))
        upper[active] = pieces.max(axis=(0, 1))
        reached = pieces[:, [0, -1]].max(axis=(0, 1))
        active = active[upper[active] > MAX_BOUND_RATIO * reached]
    return upper


def quintic_errors(
    derivatives: FloatArray, span: float, starts: FloatArray, stops: FloatArray
) -> FloatArray:
    """Return bounds of |e|, |e'| and |e''| of quintic segments within a piece, ``(3, n)``.

    A segment has the lift, velocity and acceleration of the piece at both ends.

    Parameters
    ----------
    derivatives : ndarray, shape (3, p + 1)
        Ordinates of s, s' and s'' of the piece, p ≥ 5.
    span : float
        Span of the piece, rad.
    starts, stops : ndarray, shape (n,)
        Ends of the segments as fractions of the piece.
    """
    columns = [np.repeat(row[:, None], starts.size, axis=1) for row in derivatives]
    exact = [restrict(column, starts, stops) for column in columns]
    ends = [np.stack([rows[index] for rows in exact]) for index in (0, -1)]
    spans = span * (stops - starts)
    quintic, degree = bernstein.hermite(ends[0], ends[1], spans), derivatives.shape[1] - 1
    bounds = []
    for rows in exact:
        bounds.append(bound(bernstein.elevate(quintic, degree) - rows))
        quintic = bernstein.derivative(quintic) / spans
    return np.stack(bounds)


def merged_breaks(first: Law, second: Law) -> FloatArray:
    """Return the breaks of two laws, those within `JOINT_ATOL_RAD` of each other once."""
    breaks = np.sort(np.concatenate([first.breaks, second.breaks]))
    is_new = np.diff(breaks, prepend=-1.0) > JOINT_ATOL_RAD
    breaks = breaks[is_new]
    breaks[-1] = TURN
    return np.asarray(breaks)


def _on_intervals(law: Law, breaks: FloatArray, order: int, degree: int) -> FloatArray:
    """Return the ordinates of a derivative of a law on the intervals between breaks.

    Their degree is ``degree``. A law is continued over the rounding of a joint.
    """
    pieces = np.searchsorted(law.breaks[1:-1], 0.5 * (breaks[:-1] + breaks[1:]), side="right")
    starts = (breaks[:-1] - law.breaks[pieces]) / law.spans[pieces]
    stops = (breaks[1:] - law.breaks[pieces]) / law.spans[pieces]
    ordinates = law.derivative_ordinates(order)[:, pieces]
    return np.asarray(bernstein.elevate(restrict(ordinates, starts, stops), degree))


def _rounding(law: Law, order: int) -> float:
    """Return a bound of the rounding error of a derivative's ordinates, m/rad^order."""
    level = float(np.abs(law.ordinates).max())
    scale = (2.0 * law.degree / float(law.spans.min())) ** order
    return LEVEL_ROUNDINGS * EPS * level * scale


def jerk_jumps(law: Law, breaks: FloatArray) -> FloatArray:
    """Return the jump of s''' at the start of each interval between breaks, m/rad³."""
    rows = _on_intervals(law, breaks, 3, law.degree)
    return np.asarray(rows[0] - np.roll(rows[-1], 1))


def difference_bounds(law: Law, controller: Law) -> ErrorBounds:
    """Return bounds of the difference of a controller's law from the exact law.

    Parameters
    ----------
    law : Law
        Exact law.
    controller : Law
        Law that the controller executes.

    Notes
    -----
    The bounds include the rounding of the written digits, because ``controller`` is made from
    them, and the rounding of this computation.
    """
    breaks, degree = merged_breaks(law, controller), max(law.degree, controller.degree)
    bounds: list[float] = []
    for order in range(ORDERS):
        exact, made = (_on_intervals(x, breaks, order, degree) for x in (law, controller))
        rounding = _rounding(law, order) + _rounding(controller, order)
        bounds.append(float(bound(made - exact).max()) + rounding)
    if _has_corner(law, controller, breaks):
        bounds[2] = math.inf
    jumps = jerk_jumps(controller, breaks) - jerk_jumps(law, breaks)
    rounding = _rounding(law, 3) + _rounding(controller, 3)
    lift, velocity, acceleration = bounds
    return ErrorBounds(lift, velocity, acceleration, float(np.abs(jumps).max()) + rounding)


def _has_corner(law: Law, controller: Law, breaks: FloatArray) -> bool:
    """Return True if s' of the controller jumps at a joint at which that of the law does not."""
    if not controller.velocity_jumps:
        return False
    corners = controller.breaks[list(controller.velocity_jumps)]
    smooth = law.breaks[list(law.velocity_jumps)] if law.velocity_jumps else np.array([np.inf])
    distances: NDArray[np.float64] = np.abs(corners[:, None] - smooth).min(axis=1)
    return bool((distances > JOINT_ATOL_RAD).any())

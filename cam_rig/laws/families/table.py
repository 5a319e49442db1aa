"""A law through measured points: the periodic smoothing spline of degree 5, and exact dwells.

The spline is FITPACK's (Dierckx, *Curve and Surface Fitting with Splines*, ch. 6): it takes the
fewest knots whose least-squares residual can reach the tolerance, and among the splines on them
the one whose jumps of the fifth derivative are smallest. It is C⁴ all around.

Where dwells are given, the turn is made of them and of a spline between each two. That has the
fewest even intervals that reach the tolerance, and again the smallest jumps of the fifth
derivative. It leaves and reaches its dwells at C²: three ordinates at either end are their level.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cam_rig.arrays import FloatArray, rms
from cam_rig.errors import LawError
from cam_rig.laws.families.b_spline import bezier_pieces
from cam_rig.laws.pieces import Pieces, turned_to_zero
from cam_rig.units import TURN

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
#: Ordinates at either end of a spline that are the dwell's level: s, s' and s'' join.
HELD = 3
#: Even intervals that are tried from one dwell to the next, ...
INTERVALS = (
    *range(1, 9),
    *range(10, 17, 2),
    *range(20, 33, 4),
    *range(40, 65, 8),
    80,
    96,
    128,
    192,
)
#: ... and how many of them an event of so many points bears: with more it would pass through all.
INTERVALS_PER_POINT = 0.75
#: Powers of ten of the weight of the jumps that are nothing and everything beside the points.
LEAST_WEIGHT, MOST_WEIGHT = -12.0, 6.0
#: A point so near (rad) to a dwell's end is in it.
AT_END = 1e-9


class Rest(NamedTuple):
    """A dwell: from ``start`` (rad) for ``span`` (rad) at ``level`` (m)."""

    start: float
    span: float
    level: float


@dataclass(frozen=True, eq=False)
class Smoothed:
    """The law's pieces, how far (m) they are from the points, and how many knots they have."""

    pieces: Pieces
    rms: float
    largest: float
    knots: int


def smooth(
    angles: FloatArray, lifts: FloatArray, tolerance: float, dwells: Sequence[Rest] = ()
) -> Smoothed:
    """The smoothest spline within ``tolerance`` (m, r.m.s.) of points (rad, m) of one turn.

    A last point that repeats the first a turn later is averaged with it. ``dwells`` are in the
    order of the cam angle; between two of them the tolerance is that of the points there.

    Raises
    ------
    LawError : the tolerance is too small for a spline to reach
    """
    if angles[-1] - angles[0] > TURN * (1.0 - 1e-12):
        lifts = np.concatenate([[0.5 * (lifts[0] + lifts[-1])], lifts[1:-1]])
        angles = angles[:-1]
    if dwells:
        return _between_dwells(angles, lifts, tolerance, dwells)
    spline = _spline(angles, lifts, tolerance)
    away = np.abs(spline(angles) - lifts)
    pieces = bezier_pieces(spline)
    return Smoothed(turned_to_zero(pieces, TURN), rms(away), float(away.max()), len(pieces[1]))


def _spline(angles: FloatArray, lifts: FloatArray, tolerance: float) -> BSpline[np.float64]:
    from scipy.interpolate import BSpline, make_interp_spline, splrep

    x, y = np.append(angles, angles[0] + TURN), np.append(lifts, lifts[0])
    if tolerance == 0.0:
        return make_interp_spline(x, y, k=DEGREE, bc_type="periodic")
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            knots = splrep(x, y, k=DEGREE, s=angles.size * tolerance**2, per=True)
        except RuntimeWarning:
            raise _unreached(tolerance, angles.size) from None
    return BSpline(*knots)


def _unreached(tolerance: float, count: int) -> LawError:
    return LawError(
        f"no spline comes within {tolerance * 1e3:g} mm r.m.s. of the {count} "
        "points; allowed: a larger tolerance, or 0 to go through every point"
    )


def _between_dwells(
    angles: FloatArray, lifts: FloatArray, tolerance: float, dwells: Sequence[Rest]
) -> Smoothed:
    """The dwells as they are, and a spline from each to the next."""
    breaks, columns = [dwells[0].start], []
    away = np.empty(angles.size)
    for i, dwell in enumerate(dwells):
        begin = dwell.start + dwell.span
        end = dwells[i + 1].start if i + 1 < len(dwells) else dwells[0].start + TURN
        following = dwells[(i + 1) % len(dwells)].level
        rests = (angles - dwell.start + AT_END) % TURN <= dwell.span + 2.0 * AT_END
        away[rests] = np.abs(lifts[rests] - dwell.level)
        breaks.append(begin)
        columns.append(np.array([dwell.level]))
        ahead = (angles - begin) % TURN
        inside = np.flatnonzero(~rests & (ahead < end - begin))
        inside = inside[np.argsort(ahead[inside])]
        x, y = begin + ahead[inside], lifts[inside]
        spline = _event(x, y, (begin, end), (dwell.level, following), tolerance)
        away[inside] = np.abs(spline(x) - y)
        steps, parts = bezier_pieces(spline)
        breaks += [*steps[1:-1], end]
        columns += parts
    pieces = turned_to_zero((breaks, columns), TURN)
    return Smoothed(pieces, rms(away), float(away.max()), len(columns))


def _event(
    x: FloatArray, y: FloatArray, ends: tuple[float, float], levels: tuple[float, float], t: float
) -> BSpline[np.float64]:
    """The spline of the fewest even intervals within ``t`` of the points between two dwells."""
    for count in (n for n in INTERVALS if n <= max(1.0, INTERVALS_PER_POINT * x.size)):
        inner = np.linspace(*ends, count + 1)[1:-1]
        begin, end = ([angle] * (DEGREE + 1) for angle in ends)
        spline, reached = _held(x, y, np.concatenate([begin, inner, end]), levels, t)
        if reached:
            return spline
    raise LawError(
        f"no spline comes within {t * 1e3:.3g} mm r.m.s. of the {x.size} points between the dwell "
        f"that ends at {math.degrees(ends[0]):.4g}° and the next with fewer than "
        f"{INTERVALS_PER_POINT:g} intervals a point; allowed: a larger tolerance"
    )


def _held(
    x: FloatArray, y: FloatArray, knots: FloatArray, levels: tuple[float, float], t: float
) -> tuple[BSpline[np.float64], bool]:
    """The smoothest spline on knots within ``t`` of the points, and whether there is one.

    Without one, the nearest. Least squares with the end ordinates held; the weight of the jumps of
    the fifth derivative is raised until the r.m.s. distance is t.
    """
    from scipy.interpolate import BSpline
    from scipy.linalg import lstsq
    from scipy.optimize import brentq

    count = knots.size - DEGREE - 1
    fixed = np.zeros(count)
    fixed[:HELD], fixed[count - HELD :] = levels
    free = slice(HELD, count - HELD)
    design = BSpline.design_matrix(x, knots, DEGREE).toarray() if x.size else np.zeros((0, count))
    steps = _jumps(knots)
    norms = np.linalg.norm(steps, axis=1)
    size = float(np.median(norms)) if norms.size else 1.0
    bound = t * math.sqrt(1.0 + 2.0 * HELD / x.size) if x.size else t
    jumps, rest = steps[:, free] / size, -(steps @ fixed) / size
    # the points' part of the sum of squares, in as many rows as there are ordinates
    both = np.column_stack([design[:, free], y - design @ fixed])
    triangle = np.asarray(np.linalg.qr(both, mode="r"))
    rows, wanted = triangle[:, :-1], triangle[:, -1]

    def solve(weight: float) -> FloatArray:
        stacked = np.vstack([rows, weight * jumps])
        aim = np.concatenate([wanted, weight * rest])
        return np.asarray(lstsq(stacked, aim, check_finite=False, lapack_driver="gelsy")[0])

    def excess(exponent: float) -> float:
        away = wanted - rows @ solve(10.0**exponent)
        return float(np.linalg.norm(away)) / math.sqrt(x.size) / bound - 1.0

    if not x.size or not steps.size:
        exponent, reached = 0.0, not x.size or excess(0.0) <= 0.0
    else:
        exponent, reached = LEAST_WEIGHT, excess(LEAST_WEIGHT) <= 0.0
        if excess(MOST_WEIGHT) <= 0.0:
            exponent, reached = MOST_WEIGHT, True
        elif reached:
            exponent = float(brentq(excess, LEAST_WEIGHT, MOST_WEIGHT, xtol=1e-7))
    fixed[free] = solve(10.0**exponent)
    return BSpline(knots, fixed, DEGREE), reached


def _jumps(knots: FloatArray) -> FloatArray:
    """``(inner knots, ordinates)`` jump of the fifth derivative at a knot, for each ordinate."""
    from scipy.interpolate import BSpline

    count = knots.size - DEGREE - 1
    steps = knots[DEGREE : knots.size - DEGREE]
    middles = 0.5 * (steps[:-1] + steps[1:])
    constant = BSpline(knots, np.eye(count), DEGREE).derivative(DEGREE)(middles)
    return np.asarray(np.diff(constant, axis=0) / math.factorial(DEGREE))

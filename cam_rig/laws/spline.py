"""A law through measured points: the periodic smoothing spline of degree 5, and exact dwells.

The spline is FITPACK's (Dierckx, *Curve and Surface Fitting with Splines*, ch. 6): of the fewest
knots whose least-squares residual can reach the tolerance, with the smallest jumps of the fifth
derivative, C⁴ all around. Between dwells it is of the fewest even intervals that reach the
tolerance, again with the smallest jumps, and leaves and reaches them at C².
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import LawError
from cam_rig.laws.bernstein import Pieces, rotate_to_zero
from cam_rig.units import TURN, FloatArray, rms

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


# B-splines over knots, as the Bézier curves they are made of (profile thesis §2.1.2).


def greville(knots: FloatArray, degree: int) -> FloatArray:
    """``(m,)`` Greville abscissae ξᵢ = (uᵢ + … + uᵢ₊ₙ₋₁)/n of m control points (eq. 2.8)."""
    windows = np.lib.stride_tricks.sliding_window_view(knots, degree)  # m + n − 1, ends n times
    return np.asarray(windows.mean(axis=1))


def pieces(knots: FloatArray, ordinates: FloatArray, degree: int) -> Pieces:
    """Bézier pieces of the B-spline with the thesis's knots, the ends ``degree`` times."""
    from scipy.interpolate import BSpline

    outer = np.concatenate([knots[:1], knots, knots[-1:]])  # scipy counts one more at each end
    return bezier_pieces(BSpline(outer, ordinates, degree))


def bezier_pieces(spline: BSpline[np.float64]) -> Pieces:
    """The Bézier curves of a spline: each inner knot is inserted until it stands degree times."""
    from scipy.interpolate import insert  # BSpline.insert_knot, its equal, is newer

    n = spline.k
    breaks = np.unique(spline.t[n : spline.t.size - n])
    for knot in breaks:
        missing = n - int(np.count_nonzero(spline.t == knot))
        if missing > 0:
            spline = insert(knot, spline, missing)
    last = np.searchsorted(spline.t, breaks[:-1], side="right") - 1
    columns = [np.array(spline.c[j - n : j + 1], dtype=np.float64) for j in last.tolist()]
    return breaks.tolist(), columns


DEGREE = 5
#: Ordinates at either end of a spline that are the dwell's level: s, s' and s'' join.
HELD = 3
#: Even intervals that are tried from one dwell to the next, ...
INTERVALS = (*range(1, 9), *range(10, 17, 2), *range(20, 33, 4), *range(40, 65, 8))
INTERVALS += (80, 96, 128, 192)

#: ... and how many of them an event of so many points bears: with more it would pass through all.
INTERVALS_PER_POINT = 0.75
#: Powers of ten of the weight of the jumps that are nothing and everything beside the points.
LEAST_WEIGHT, MOST_WEIGHT = -12.0, 6.0
#: A point so near (rad) to a dwell's end is in it.
AT_END = 1e-9


class Rest(NamedTuple):
    """A dwell: start and span in rad, level in m."""

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

    A last point that repeats the first is averaged with it. Between two ``dwells``, which are in
    order, the tolerance is that of the points there.
    """
    if angles[-1] - angles[0] > TURN * (1.0 - 1e-12):
        lifts = np.concatenate([[0.5 * (lifts[0] + lifts[-1])], lifts[1:-1]])
        angles = angles[:-1]
    if dwells:
        return _between_dwells(angles, lifts, tolerance, dwells)
    spline = _spline(angles, lifts, tolerance)
    away = np.abs(spline(angles) - lifts)
    pieces = bezier_pieces(spline)
    return Smoothed(rotate_to_zero(pieces, TURN), rms(away), float(away.max()), len(pieces[1]))


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
            raise LawError(
                f"no spline comes within {tolerance * 1e3:g} mm r.m.s. of the {angles.size} "
                "points; allowed: a larger tolerance, or 0 to go through every point"
            ) from None
    return BSpline(*knots)


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
    pieces = rotate_to_zero((breaks, columns), TURN)
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
    """The smoothest spline on knots within ``t`` of the points, else the nearest; which of both.

    Least squares with the end ordinates held; the weight of the jumps of the fifth derivative is
    raised until the r.m.s. distance is t.
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


# The scatter of readings, from the readings alone: what no smooth law through them can have.

#: Readings of a divided difference: those of a polynomial of degree 5, and one more.
WINDOW = 7
#: Median of |x| of the standard normal distribution.
NORMAL_MEDIAN = 0.6744897501960817
#: Differences beyond so many standard deviations are of outliers, and of jumps of derivatives;
#: what is left of the standard normal distribution without them has this standard deviation.
TRIMMED, TRIMMED_STANDARD_DEVIATION = 3.0, 0.9865784
#: Standard error of the scatter of n readings, times √n, in parts of it: found by simulation.
STANDARD_ERROR = 1.35
#: A tolerance that lies so many standard errors below the scatter follows the noise, and so does
#: less than this part of it: of few readings the scatter is known so roughly.
SURE, LEAST_PART = 3.0, 0.4
#: A window as wide as this (rad) bridges a stretch without readings.
WIDEST_WINDOW = math.radians(100.0)


def differences(angles: FloatArray, lifts: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """``(n,)`` scaled divided differences (m) about each reading (rad, m), and which count."""
    # a window that bridges a stretch without readings, or has equal ones alone, does not
    count, half = angles.size, WINDOW // 2
    index = np.arange(count)[:, None] + np.arange(-half, half + 1)
    x = angles[index % count] + TURN * (index // count)
    y = lifts[index % count]
    apart = x[:, :, None] - x[:, None, :] + np.eye(WINDOW)
    with np.errstate(divide="ignore", over="ignore"):
        weights = 1.0 / (apart * 1e2).prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    counts = (x[:, -1] - x[:, 0] < WIDEST_WINDOW) & (np.ptp(y, axis=1) > 0.0)
    return (weights * y).sum(axis=1), counts


def scatter(angles: FloatArray, lifts: FloatArray) -> float:
    """Standard deviation (m) of readings about a smooth law; 0 where it cannot be told."""
    if angles.size < WINDOW + 1:
        return 0.0
    found, counts = differences(angles, lifts)
    sizes = np.abs(found[counts])
    if sizes.size < WINDOW:
        return 0.0
    near = sizes[sizes <= TRIMMED * float(np.median(sizes)) / NORMAL_MEDIAN]
    return rms(near) / TRIMMED_STANDARD_DEVIATION


def scatter_error(count: int) -> float:
    """Relative standard error of the scatter of so many readings."""
    return STANDARD_ERROR / math.sqrt(count)


def least_tolerance(found: float, count: int) -> float:
    """The tolerance (m) below which a spline follows a scatter (m) of so many readings."""
    return found * max(LEAST_PART, 1.0 - SURE * scatter_error(count))


def require_above_scatter(angles: FloatArray, lifts: FloatArray, tolerance: float) -> None:
    """Refuse a tolerance (m) that would make a law of the readings' noise; 0 is an own wish."""
    if angles[-1] - angles[0] > TURN * (1.0 - 1e-12):
        angles, lifts = angles[:-1], lifts[:-1]
    found = scatter(angles, lifts)
    least = least_tolerance(found, angles.size)
    if 0.0 < tolerance < least:
        raise LawError(
            f"tolerance is {tolerance * 1e3:.3g} mm, the points scatter by {found * 1e3:.3g} mm, "
            "so the spline would follow their noise; allowed: at least "
            f"{least * 1e3:.3g} mm, or 0 to go through every point"
        )

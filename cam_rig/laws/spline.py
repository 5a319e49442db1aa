"""Laws through measured points: periodic splines of degree 5, and dwells.

Without dwells the spline is FITPACK's (Dierckx, *Curve and Surface Fitting with Splines*, ch. 6).
It has the fewest knots whose least-squares residual can reach the tolerance, and of these splines
the smallest jumps of the fifth derivative. It is C⁴ over the whole turn.

Dwells are exact. Between two dwells the spline has the fewest equal intervals that reach the
tolerance, with the smallest jumps of the fifth derivative. It joins the dwells with C².
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


# B-splines over knots, as Bézier pieces (profile thesis §2.1.2).


def greville(knots: FloatArray, degree: int) -> FloatArray:
    """Return the Greville abscissae of the m control points of a B-spline, ``(m,)``.

    They are ξᵢ = (uᵢ + … + uᵢ₊ₙ₋₁)/n (eq. 2.8 of the profile thesis).
    """
    # There are m + n − 1 knots. The end knots have multiplicity n.
    windows = np.lib.stride_tricks.sliding_window_view(knots, degree)
    return np.asarray(windows.mean(axis=1))


def pieces(knots: FloatArray, ordinates: FloatArray, degree: int) -> Pieces:
    """Return the Bézier pieces of a B-spline.

    The knots are those of the profile thesis: the end knots have multiplicity ``degree``.
    """
    from scipy.interpolate import BSpline

    outer = np.concatenate([knots[:1], knots, knots[-1:]])  # scipy has one more knot at each end
    return bezier_pieces(BSpline(outer, ordinates, degree))


def bezier_pieces(spline: BSpline[np.float64]) -> Pieces:
    """Return the Bézier pieces of a spline.

    Each inner knot is inserted until its multiplicity is the degree.
    """
    from scipy.interpolate import insert  # BSpline.insert_knot is equal, but needs a newer scipy

    n = spline.k
    breaks = np.unique(spline.t[n : spline.t.size - n])
    for knot in breaks:
        missing = n - int(np.count_nonzero(spline.t == knot))
        if missing > 0:
            spline = insert(knot, spline, missing)
    last = np.searchsorted(spline.t, breaks[:-1], side="right") - 1
    columns = [np.array(spline.c[j - n : j + 1], dtype=np.float64) for j in last.tolist()]
    return breaks.tolist(), columns


#: Degree of the splines through the points of a table.
DEGREE = 5
#: Number of ordinates at each end of a spline that are the dwell's level, so that s, s' and s''
#: are continuous.
FIXED_ORDINATES = 3
#: Numbers of equal intervals from one dwell to the next, tried in this order.
INTERVAL_COUNTS = (*range(1, 9), *range(10, 17, 2), *range(20, 33, 4), *range(40, 65, 8))
INTERVAL_COUNTS += (80, 96, 128, 192)

#: Largest number of intervals per point. With more intervals, the spline would pass through all
#: points.
INTERVALS_PER_POINT = 0.75
#: Smallest exponent of ten of the weight of the jumps. There the jumps have no effect compared with
#: the points.
MIN_EXPONENT = -12.0
#: Largest exponent of ten of the weight of the jumps. There the points have no effect compared with
#: the jumps.
MAX_EXPONENT = 6.0
#: Largest distance (rad) from the end of a dwell at which a point belongs to the dwell (rounding of
#: angles).
END_ATOL = 1e-9


class Rest(NamedTuple):
    """Dwell of a law: start and span in rad, lift (level) in m."""

    start: float
    span: float
    level: float


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Pieces of a law through points, and their distances from the points.

    ``rms`` and ``largest`` are the distances (m). ``knots`` is the number of knots.
    """

    pieces: Pieces
    rms: float
    largest: float
    knots: int


def smooth(
    angles: FloatArray, lifts: FloatArray, tolerance: float, dwells: Sequence[Rest] = ()
) -> Smoothed:
    """Return the smoothest spline within a tolerance of points of one turn.

    Parameters
    ----------
    angles : ndarray, shape (n,)
        Cam angles, rad. A last point that repeats the first is averaged with it.
    lifts : ndarray, shape (n,)
        Lifts, m.
    tolerance : float
        Largest r.m.s. distance, m. With dwells it applies to the points between each two.
    dwells : sequence of Rest, optional
        Dwells in order (default: no dwells).

    Returns
    -------
    Smoothed
        The pieces of the law and their distance from the points.

    Raises
    ------
    LawError
        If no spline reaches the tolerance.
    """
    if angles[-1] - angles[0] > TURN * (1.0 - 1e-12):
        lifts = np.concatenate([[0.5 * (lifts[0] + lifts[-1])], lifts[1:-1]])
        angles = angles[:-1]
    if dwells:
        return _between_dwells(angles, lifts, tolerance, dwells)
    spline = _fit_periodic(angles, lifts, tolerance)
    errors = np.abs(spline(angles) - lifts)
    pieces = bezier_pieces(spline)
    return Smoothed(rotate_to_zero(pieces, TURN), rms(errors), float(errors.max()), len(pieces[1]))


def _fit_periodic(angles: FloatArray, lifts: FloatArray, tolerance: float) -> BSpline[np.float64]:
    """Fit FITPACK's periodic smoothing spline to points of one turn.

    At tolerance 0 the result is an interpolant.
    """
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
    """Fit a spline from each dwell to the next, and return it with the dwells."""
    breaks, columns = [dwells[0].start], []
    errors = np.empty(angles.size)
    for i, dwell in enumerate(dwells):
        start = dwell.start + dwell.span
        end = dwells[i + 1].start if i + 1 < len(dwells) else dwells[0].start + TURN
        following = dwells[(i + 1) % len(dwells)].level
        in_dwell = (angles - dwell.start + END_ATOL) % TURN <= dwell.span + 2.0 * END_ATOL
        errors[in_dwell] = np.abs(lifts[in_dwell] - dwell.level)
        breaks.append(start)
        columns.append(np.array([dwell.level]))
        offsets = (angles - start) % TURN
        inside = np.flatnonzero(~in_dwell & (offsets < end - start))
        inside = inside[np.argsort(offsets[inside])]
        x, y = start + offsets[inside], lifts[inside]
        spline = _fit_event(x, y, (start, end), (dwell.level, following), tolerance)
        errors[inside] = np.abs(spline(x) - y)
        event_breaks, event_columns = bezier_pieces(spline)
        breaks += [*event_breaks[1:-1], end]
        columns += event_columns
    pieces = rotate_to_zero((breaks, columns), TURN)
    return Smoothed(pieces, rms(errors), float(errors.max()), len(columns))


def _fit_event(
    x: FloatArray, y: FloatArray, ends: tuple[float, float], levels: tuple[float, float], t: float
) -> BSpline[np.float64]:
    """Fit a spline between two dwells with the fewest equal intervals.

    Its r.m.s. distance from the points is at most ``t`` (m). ``ends`` are the angles (rad) and
    ``levels`` the lifts (m) at its ends.
    """
    for count in (n for n in INTERVAL_COUNTS if n <= max(1.0, INTERVALS_PER_POINT * x.size)):
        inner = np.linspace(*ends, count + 1)[1:-1]
        start, end = ([angle] * (DEGREE + 1) for angle in ends)
        spline, is_reached = _fit_on_knots(x, y, np.concatenate([start, inner, end]), levels, t)
        if is_reached:
            return spline
    raise LawError(
        f"no spline comes within {t * 1e3:.3g} mm r.m.s. of the {x.size} points between the dwell "
        f"that ends at {math.degrees(ends[0]):.4g}° and the next with fewer than "
        f"{INTERVALS_PER_POINT:g} intervals a point; allowed: a larger tolerance"
    )


def _fit_on_knots(
    x: FloatArray, y: FloatArray, knots: FloatArray, levels: tuple[float, float], t: float
) -> tuple[BSpline[np.float64], bool]:
    """Return the smoothest spline on given knots within ``t`` (m) of the points.

    The second result is True if the tolerance is reached, otherwise the spline is the nearest one.
    The end ordinates of the least-squares problem are fixed. The weight of the jumps of the fifth
    derivative is increased until the r.m.s. distance is ``t``.
    """
    from scipy.interpolate import BSpline
    from scipy.linalg import lstsq
    from scipy.optimize import brentq

    count = knots.size - DEGREE - 1
    ordinates = np.zeros(count)
    ordinates[:FIXED_ORDINATES], ordinates[count - FIXED_ORDINATES :] = levels
    free = slice(FIXED_ORDINATES, count - FIXED_ORDINATES)
    design = BSpline.design_matrix(x, knots, DEGREE).toarray() if x.size else np.zeros((0, count))
    all_jumps = _fifth_derivative_jumps(knots)
    norms = np.linalg.norm(all_jumps, axis=1)
    size = float(np.median(norms)) if norms.size else 1.0
    max_rms = t * math.sqrt(1.0 + 2.0 * FIXED_ORDINATES / x.size) if x.size else t
    jumps, target = all_jumps[:, free] / size, -(all_jumps @ ordinates) / size
    # The points' contribution to the sum of squares, reduced to as many rows as ordinates.
    system = np.column_stack([design[:, free], y - design @ ordinates])
    triangle = np.asarray(np.linalg.qr(system, mode="r"))
    rows, right_side = triangle[:, :-1], triangle[:, -1]

    def solve(weight: float) -> FloatArray:
        stacked = np.vstack([rows, weight * jumps])
        values = np.concatenate([right_side, weight * target])
        return np.asarray(lstsq(stacked, values, check_finite=False, lapack_driver="gelsy")[0])

    def excess(exponent: float) -> float:
        residual = right_side - rows @ solve(10.0**exponent)
        return float(np.linalg.norm(residual)) / math.sqrt(x.size) / max_rms - 1.0

    if not x.size or not all_jumps.size:
        exponent, is_reached = 0.0, not x.size or excess(0.0) <= 0.0
    else:
        exponent, is_reached = MIN_EXPONENT, excess(MIN_EXPONENT) <= 0.0
        if excess(MAX_EXPONENT) <= 0.0:
            exponent, is_reached = MAX_EXPONENT, True
        elif is_reached:
            exponent = float(brentq(excess, MIN_EXPONENT, MAX_EXPONENT, xtol=1e-7))
    ordinates[free] = solve(10.0**exponent)
    return BSpline(knots, ordinates, DEGREE), is_reached


def _fifth_derivative_jumps(knots: FloatArray) -> FloatArray:
    """Return the jumps of a spline's fifth derivative, ``(inner knots, ordinates)``.

    Entry (i, j) is the jump at inner knot i for a unit ordinate j.
    """
    from scipy.interpolate import BSpline

    count = knots.size - DEGREE - 1
    breaks = knots[DEGREE : knots.size - DEGREE]
    middles = 0.5 * (breaks[:-1] + breaks[1:])
    constant = BSpline(knots, np.eye(count), DEGREE).derivative(DEGREE)(middles)
    return np.asarray(np.diff(constant, axis=0) / math.factorial(DEGREE))


# Scatter of readings, estimated from divided differences that a smooth law cannot have.

#: Number of readings of a divided difference: one more than a polynomial of degree 5 has
#: coefficients.
WINDOW = 7
#: Median of |x| of the standard normal distribution.
NORMAL_MEDIAN = 0.6744897501960817
#: Number of standard deviations beyond which a divided difference is omitted. Such a difference is
#: caused by an outlier or by a jump of a derivative.
MAX_DEVIATION = 3.0
#: Standard deviation of the standard normal distribution after trimming at `MAX_DEVIATION`.
TRIMMED_DEVIATION = 0.9865784
#: Relative standard error of the scatter of n readings, times √n. It was determined by simulation.
ERROR_FACTOR = 1.35
#: Number of standard errors by which a tolerance may be smaller than the scatter. With a smaller
#: tolerance the spline follows the noise.
MAX_ERRORS_BELOW = 3.0
#: Smallest tolerance as a fraction of the scatter. It applies to few readings, whose scatter is
#: uncertain.
MIN_SCATTER_FRACTION = 0.4
#: Span of a window (rad) at which it is omitted, because it bridges a range without readings.
MAX_WINDOW_SPAN = math.radians(100.0)


def differences(angles: FloatArray, lifts: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return scaled divided differences of readings, and the mask of those that count.

    A difference does not count if its window bridges a range without readings, or if all its
    readings are equal.

    Parameters
    ----------
    angles, lifts : ndarray, shape (n,)
        Readings, rad and m.

    Returns
    -------
    differences : ndarray, shape (n,)
        Differences about each reading, m.
    counts : ndarray of bool, shape (n,)
        Mask of the differences that count.
    """
    count, half = angles.size, WINDOW // 2
    index = np.arange(count)[:, None] + np.arange(-half, half + 1)
    x = angles[index % count] + TURN * (index // count)
    y = lifts[index % count]
    distances = x[:, :, None] - x[:, None, :] + np.eye(WINDOW)
    with np.errstate(divide="ignore", over="ignore"):
        weights = 1.0 / (distances * 1e2).prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    counts = (x[:, -1] - x[:, 0] < MAX_WINDOW_SPAN) & (np.ptp(y, axis=1) > 0.0)
    return (weights * y).sum(axis=1), counts


def scatter(angles: FloatArray, lifts: FloatArray) -> float:
    """Estimate the standard deviation (m) of readings about a smooth law.

    The result is 0 if too few differences count.
    """
    if angles.size < WINDOW + 1:
        return 0.0
    values, counts = differences(angles, lifts)
    sizes = np.abs(values[counts])
    if sizes.size < WINDOW:
        return 0.0
    trimmed = sizes[sizes <= MAX_DEVIATION * float(np.median(sizes)) / NORMAL_MEDIAN]
    return rms(trimmed) / TRIMMED_DEVIATION


def scatter_error(count: int) -> float:
    """Return the relative standard error of a scatter from ``count`` readings."""
    return ERROR_FACTOR / math.sqrt(count)


def min_tolerance(noise: float, count: int) -> float:
    """Return the smallest tolerance (m) with which a spline does not follow noise.

    ``noise`` (m) is the scatter of ``count`` readings.
    """
    return noise * max(MIN_SCATTER_FRACTION, 1.0 - MAX_ERRORS_BELOW * scatter_error(count))


def require_above_scatter(angles: FloatArray, lifts: FloatArray, tolerance: float) -> None:
    """Raise LawError if a spline of this tolerance (m) would follow noise.

    A tolerance of 0 is accepted, because interpolation is then intended.
    """
    if angles[-1] - angles[0] > TURN * (1.0 - 1e-12):
        angles, lifts = angles[:-1], lifts[:-1]
    noise = scatter(angles, lifts)
    limit = min_tolerance(noise, angles.size)
    if 0.0 < tolerance < limit:
        raise LawError(
            f"tolerance is {tolerance * 1e3:.3g} mm, the points scatter by {noise * 1e3:.3g} mm, "
            "so the spline would follow their noise; allowed: at least "
            f"{limit * 1e3:.3g} mm, or 0 to go through every point"
        )

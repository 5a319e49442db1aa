"""Bernstein pieces of the segments of a cam, and the rises with a name."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, partial
from math import comb, perm

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws import spline as b_spline
from cam_rig.laws.arc_law import arc_contour_pieces, tangent_arcs
from cam_rig.laws.bernstein import Pieces, join_pieces
from cam_rig.laws.families import FAMILIES, family_rise
from cam_rig.laws.law import Law
from cam_rig.laws.sampling import Curve, Section, fit_curve, fit_sections, wave
from cam_rig.laws.spline import Rest, Smoothed, require_above_scatter, smooth
from cam_rig.schema import CamConfig
from cam_rig.schema import segments as kinds
from cam_rig.schema.motions import LevelSegment
from cam_rig.schema.segment_base import Table
from cam_rig.units import TURN, FloatArray

# Polynomial that meets conditions on values and derivatives.


def polynomial_through(u: list[float], order: list[int], value: list[float]) -> FloatArray:
    """Return the ordinates of the polynomial that satisfies m conditions, ``(m,)``.

    Condition i is that the derivative ``order[i]`` at ``u[i]`` in [0, 1] is ``value[i]``. The
    degree is m − 1.

    Raises
    ------
    LawError
        If the conditions do not determine a polynomial.

    References
    ----------
    Equation 2.1 of the profile thesis, worked example c.
    """
    # Exact fractions, because the system is badly conditioned in any basis. It has at most 21 rows.
    points = [Fraction(x) for x in u]
    rows = [_condition_row(len(points) - 1, x, r) for x, r in zip(points, order, strict=True)]
    for row, x in zip(rows, value, strict=True):
        row.append(Fraction(x))
    try:
        return np.array([float(x) for x in _solve_exactly(rows)])
    except ZeroDivisionError:
        conditions = ", ".join(f"({x:g}, {r})" for x, r in zip(u, order, strict=True))
        raise LawError(
            f"no single polynomial of degree {len(points) - 1} meets the conditions (u, order) "
            f"{conditions}; allowed: conditions that determine it, so give the lower orders where "
            "a higher one is given"
        ) from None


def _condition_row(degree: int, u: Fraction, order: int) -> list[Fraction]:
    """Return a derivative of each Bernstein polynomial at u, as fractions.

    ``order`` is that of the derivative, and ``degree`` that of the polynomials.
    """
    row = [Fraction(0)] * (degree + 1)
    lower = degree - order
    values = [comb(lower, i) * u**i * (1 - u) ** (lower - i) for i in range(lower + 1)]
    factor = perm(degree, order)
    for i, value in enumerate(values):
        for j in range(order + 1):
            row[i + j] += factor * value * comb(order, j) * (-1) ** (order - j)
    return row


def _solve_exactly(rows: list[list[Fraction]]) -> list[Fraction]:
    """Solve linear equations by Gauss-Jordan elimination with fractions.

    ``rows`` are those of the matrix with the right side as last column. Raises ZeroDivisionError if
    the system is singular.
    """
    n = len(rows)
    for i in range(n):
        pivot = next((k for k in range(i, n) if rows[k][i] != 0), i)
        rows[i], rows[pivot] = rows[pivot], rows[i]
        scale = 1 / rows[i][i]
        rows[i] = [x * scale for x in rows[i]]
        for k in range(n):
            if k != i and rows[k][i] != 0:
                factor = rows[k][i]
                rows[k] = [x - factor * y for x, y in zip(rows[k], rows[i], strict=True)]
    return [row[-1] for row in rows]


# Trigonometric polynomial over a whole turn.


def trigonometric(mean: float, cosine: list[float], sine: list[float]) -> Curve:
    """Return the function s(θ) = c₀ + Σ cᵢ cos iθ + sᵢ sin iθ, with its derivatives.

    i starts at 1, θ is in rad, and ``mean`` is c₀ (equation 2.2 of the profile thesis).
    """
    waves = max(len(cosine), len(sine))
    harmonic = np.arange(1, waves + 1, dtype=np.float64)
    c = np.pad(np.array(cosine, dtype=np.float64), (0, waves - len(cosine)))
    s = np.pad(np.array(sine, dtype=np.float64), (0, waves - len(sine)))

    def curve(angle: FloatArray, order: int) -> FloatArray:
        # The r-th derivative rotates (cos, sin) by r quarter turns: exact, without a rounded phase.
        for_cosine, for_sine = [(c, s), (s, -c), (-c, -s), (-s, c)][order % 4]
        phase = angle[:, None] * harmonic
        scale = harmonic**order
        waves_sum = np.cos(phase) @ (for_cosine * scale) + np.sin(phase) @ (for_sine * scale)
        return np.asarray(waves_sum + (mean if order == 0 else 0.0))

    return curve


#: Largest difference between the lift of a cam file and the height of its points, as a fraction of
#: that height.
LIFT_RTOL = 1e-2
#: Addition to that difference, in smoothing tolerances of the segment. It allows for the errors of
#: the highest and the lowest point.
MAX_LIFT_TOLERANCES = 8.0


def segment_pieces(segment: kinds.Segment, cam: CamConfig) -> Pieces | None:
    """Return the pieces (rad, m) of a segment with a fixed level.

    The pieces start at angle 0. The result is None for a dwell or a named rise, which continue from
    the level before them.
    """
    lift, span = cam.lift.si, segment.span.si
    pieces: Pieces | None = None
    match segment:
        case kinds.Bezier():
            pieces = [0.0, span], [lift * np.array(segment.ordinates.numbers)]
        case kinds.BSpline():
            knots = np.array(segment.knots.numbers)
            knots = span * ((knots - knots[0]) / (knots[-1] - knots[0]))
            ordinates = lift * np.array(segment.ordinates.numbers)
            pieces = b_spline.pieces(knots, ordinates, segment.degree)
        case kinds.Polynomial():
            u = [min(1.0, angle / span) for angle in segment.at.si_list]
            try:
                ordinates = polynomial_through(u, segment.order, segment.value.numbers)
            except LawError as error:
                raise LawError(f"cam {cam.name!r}: {error}") from None
            pieces = [0.0, span], [lift * ordinates]
        case kinds.Trigonometric():
            cosine, sine = (
                [] if numbers is None else [lift * number for number in numbers.numbers]
                for numbers in (segment.cosine, segment.sine)
            )
            pieces = fit_curve(trigonometric(lift * segment.mean.si, cosine, sine), 0.0, span)
        case kinds.TangentArcs():
            pieces = tangent_arcs(segment, cam)
        case kinds.ArcsByRadii() | kinds.ArcsByCentres():
            pieces = arc_contour_pieces(segment, cam)
        case Table():
            pieces = smooth_table(segment, cam).pieces
        case _:
            assert isinstance(segment, kinds.Dwell | kinds.Rise | LevelSegment)
    return pieces


def smooth_table(segment: Table, cam: CamConfig) -> Smoothed:
    """Return the spline through a table's points, and its distance from them.

    Raises
    ------
    LawError
        If the lift of the cam is not that of the points, or the spline cannot be computed.
    """
    points = segment.file
    height = max(points.lifts) - min(points.lifts)
    limit = LIFT_RTOL * height + MAX_LIFT_TOLERANCES * segment.tolerance.si
    if abs(height - cam.lift.si) > limit:
        raise LawError(
            f"cam {cam.name!r}: lift is {cam.lift.si * 1e3:g} mm, the points of {points.file} "
            f"rise by {height * 1e3:g} mm; allowed: the same, so set lift to that"
        )
    dwells = [Rest(dwell.start.si, dwell.span.si, dwell.level.si) for dwell in segment.dwells]
    angles, lifts = np.array(points.angles), np.array(points.lifts)
    try:
        require_above_scatter(angles, lifts, segment.tolerance.si)
        return smooth(angles, lifts, segment.tolerance.si, dwells)
    except LawError as error:
        raise LawError(f"cam {cam.name!r}: {points.file}: {error}") from None


# Ordinates of the rises from 0 to 1 over u ∈ [0, 1] that are one Bézier curve.


def full_rise(degree: int) -> FloatArray:
    """Return the ordinates {0…0, 1…1} of a rise between dwells, of an odd degree.

    One half is 0, the other 1. The rise joins dwells with class C^((degree − 1)/2) (eq. 3.1-3.3).
    """
    return np.repeat([0.0, 1.0], (degree + 1) // 2)


def half_rise_start(degree: int) -> FloatArray:
    """Return the ordinates of a rise from rest to velocity 2, of an even degree.

    The final velocity is constant. The rise joins its neighbours with class C^(degree/2) (eq.
    3.4-3.6).
    """
    half = degree // 2
    return np.concatenate([np.zeros(half), np.linspace(0.0, 1.0, half + 1)])


def half_rise_end(degree: int) -> FloatArray:
    """Return the ordinates of a rise from velocity 2 to rest, of an even degree.

    The initial velocity is constant. It is the point reflection of `half_rise_start` (eq. 3.7-3.9).
    """
    return np.asarray(1.0 - half_rise_start(degree)[::-1])


# Analytic rises, with the two industrial standards: modified sine and modified trapezoid.


def simple_harmonic(u: FloatArray, order: int) -> FloatArray:
    """Return the simple harmonic rise ½(1 − cos πu), or a derivative of it.

    ``order`` is 0 to 3.
    """
    if order == 0:
        return np.asarray(np.sin(0.5 * np.pi * u) ** 2)  # without cancellation near 0
    half = 0.5 * np.pi**order * (-1.0 if order == 3 else 1.0)
    return np.asarray(half * (np.cos if order == 2 else np.sin)(np.pi * u))


def cycloidal(u: FloatArray, order: int) -> FloatArray:
    """Return the cycloidal rise u − sin(2πu)/2π, or a derivative of it.

    ``order`` is 0 to 3.
    """
    turn = 2.0 * np.pi * u
    sine, cosine = np.sin(turn), np.cos(turn)
    level, slope = u - sine / (2.0 * np.pi), 1.0 - cosine
    return np.asarray((level, slope, 2.0 * np.pi * sine, 4.0 * np.pi**2 * cosine)[order])


#: π, for the formulas below.
PI = np.pi
#: Common factor of the formulas of the modified sine.
SINE = 1.0 / (PI + 4.0)
#: Common factor of the formulas of the modified trapezoid.
TRAPEZOID = 1.0 / (PI + 2.0)
#: Lift, slope and curvature of the modified trapezoid at u = 1/8, the end of the first sine.
MOTION_AT_EIGHTH = TRAPEZOID * np.array([0.25 - 0.5 / PI, 2.0, 8.0 * PI])
#: Slope of the modified trapezoid at u = 3/8, the end of the constant acceleration. With the lift
#: there, the curve passes through (½, ½).
MIDDLE_SLOPE = TRAPEZOID * (2.0 + 2.0 * PI)


def _constant_acceleration(u: FloatArray, order: int) -> FloatArray:
    """Return the parabola of the modified trapezoid rise from u = 1/8 to 3/8.

    ``order`` is the order of the derivative.
    """
    lift, slope, curvature = MOTION_AT_EIGHTH
    v = u - 0.125
    terms = (lift + slope * v + 0.5 * curvature * v**2, slope + curvature * v, curvature + 0.0 * v)
    return np.asarray(terms[order] if order < 3 else 0.0 * v)


def _mirror_rise(curve: Curve, u: FloatArray, order: int) -> FloatArray:
    """Return the second half of a rise, 1 − s(1 − u), or its derivative."""
    value = curve(1.0 - u, order)
    return np.asarray(1.0 - value if order == 0 else value * (-1.0) ** (order + 1))


def _complete_rise(first: list[Section], middle: Section) -> list[Section]:
    """Return all sections of a symmetric rise from those before its middle section."""
    last = [(1.0 - b, 1.0 - a, partial(_mirror_rise, curve)) for a, b, curve in reversed(first)]
    return [*first, middle, *last]


#: s = (πu − sin(4πu)/4)/(π + 4) to 1/8, then (2 + πu − 9/4·sin((4πu + π)/3))/(π + 4) to 7/8.
MODIFIED_SINE = _complete_rise(
    [(0.0, 0.125, wave(0.0, PI * SINE, 0.25 * SINE, 4.0 * PI, 0.0))],
    (0.125, 0.875, wave(2.0 * SINE, PI * SINE, 2.25 * SINE, 4.0 * PI / 3.0, PI / 3.0)),
)
#: Amplitude of the sines of the modified trapezoid.
_TRAPEZOID_SINE = 0.5 * TRAPEZOID / PI
#: s = (2u − sin(4πu)/2π)/(π + 2) to 1/8, a parabola to 3/8, then another sine to 5/8.
MODIFIED_TRAPEZOID = _complete_rise(
    [
        (0.0, 0.125, wave(0.0, 2.0 * TRAPEZOID, _TRAPEZOID_SINE, 4.0 * PI, 0.0)),
        (0.125, 0.375, _constant_acceleration),
    ],
    (0.375, 0.625, wave(0.5 - 0.5 * MIDDLE_SLOPE, MIDDLE_SLOPE, -_TRAPEZOID_SINE, 4.0 * PI, 0.0)),
)


# Rises that are known by a name, with their sources.


@dataclass(frozen=True)
class NamedRise:
    """Rise from 0 to 1 over u ∈ [0, 1] with a name: ordinates, or analytic sections.

    ``slopes`` are those of the neighbours before and after it, 0 for a dwell. Equations 3.x in
    ``source`` are those of the laws thesis.
    """

    source: str
    shape: FloatArray | list[Section]
    slopes: tuple[float, float] = (0.0, 0.0)


#: Rises by their names in cam files, `RiseName`.
NAMED_RISES: dict[str, NamedRise] = {
    "constant_velocity": NamedRise("worked example a", np.array([0.0, 1.0])),
    "simple_harmonic": NamedRise("worked example b", [(0.0, 1.0, simple_harmonic)]),
    "cycloidal": NamedRise("paper, section 2", [(0.0, 1.0, cycloidal)]),
    "modified_sine": NamedRise("cam handbooks", MODIFIED_SINE),
    "modified_trapezoid": NamedRise("cam handbooks", MODIFIED_TRAPEZOID),
    "poly345": NamedRise("paper; eq. 3.1", full_rise(5)),
    "poly4567": NamedRise("paper; eq. 3.2", full_rise(7)),
    **{f"bezier{n}": NamedRise(f"eq. 3.{n // 2 - 1}", full_rise(n)) for n in (5, 7, 9)},
    **{
        f"bezier{n}_{part}": NamedRise(f"eq. 3.{first + n // 2}", ordinates(n), slopes)
        for part, first, ordinates, slopes in (
            ("start", 2, half_rise_start, (0.0, 2.0)),
            ("end", 5, half_rise_end, (2.0, 0.0)),
        )
        for n in (4, 6, 8)
    },
}


#: Names of all rises: of the sources and of the handbooks.
RISES = (*NAMED_RISES, *FAMILIES)


@lru_cache(maxsize=len(RISES))
def unit_rise(name: str) -> Pieces:
    """Return the Bernstein pieces of a rise of `RISES`, over u from 0 to 1.

    The parameters of a family are its defaults.
    """
    if name in FAMILIES:
        return family_rise(name)
    shape = NAMED_RISES[name].shape
    return fit_sections(shape) if isinstance(shape, list) else ([0.0, 1.0], [shape])


# Law with one rise and an equal fall over any event angle.

#: Narrowest dwell (rad) that gets a segment. A narrower dwell is omitted.
MIN_DWELL = 1e-9


def up_and_down(rise: str, event: float, lift: float, high_dwell: float | None = None) -> Law:
    """Return a law with one named rise and an equal fall.

    The turn is half a low dwell, rise, high dwell, fall, half a low dwell.

    Parameters
    ----------
    rise : str
        Name of the rise.
    event : float
        Span of rise and fall, rad, at most π.
    lift : float
        Lift, m.
    high_dwell : float, optional
        Span of the high dwell, rad (None: that of the low dwell).

    Returns
    -------
    Law
        The law over one turn.
    """
    rise_breaks, columns = unit_rise(rise)
    high = math.pi - event if high_dwell is None else high_dwell
    low = TURN - 2.0 * event - high
    breaks, pieces = [0.0], []
    for height, base, dwell in ((lift, 0.0, 0.5 * low), (-lift, lift, high)):
        if dwell > MIN_DWELL:
            breaks.append(breaks[-1] + dwell)
            pieces.append(np.array([base]))
        start = breaks[-1]
        breaks += [start + event * u for u in rise_breaks[1:]]
        pieces += [base + height * column for column in columns]
    if low > MIN_DWELL:
        breaks.append(TURN)
        pieces.append(np.array([0.0]))
    breaks[-1] = TURN
    return Law(f"{rise} over {math.degrees(event):.4g}°", np.array(breaks), join_pieces(pieces))

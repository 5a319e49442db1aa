"""The pieces of each kind of segment that sets its own level."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, partial
from math import comb, perm

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws import spline as b_spline
from cam_rig.laws.arc_law import tangent_arcs, whole_turn_arcs
from cam_rig.laws.bernstein import Pieces, joined
from cam_rig.laws.law import Law
from cam_rig.laws.sampling import Curve, Section, fit, fit_sections
from cam_rig.laws.spline import Rest, Smoothed, require_above_scatter, smooth
from cam_rig.schema import CamConfig
from cam_rig.schema import segments as kinds
from cam_rig.schema.segment_base import Table
from cam_rig.units import TURN, FloatArray

# The polynomial through conditions on values and derivatives (eq. 2.1, worked example c).


def polynomial_through(u: list[float], order: list[int], value: list[float]) -> FloatArray:
    """Bernstein ordinates through m conditions: derivative ``order`` at u in [0, 1] is value."""
    # in exact fractions: the system is badly conditioned in any basis, and of at most 21 rows
    at = [Fraction(x) for x in u]
    rows = [_row(len(at) - 1, x, r) for x, r in zip(at, order, strict=True)]
    for row, x in zip(rows, value, strict=True):
        row.append(Fraction(x))
    try:
        return np.array([float(x) for x in _solve(rows)])
    except ZeroDivisionError:
        shown = ", ".join(f"({x:g}, {r})" for x, r in zip(u, order, strict=True))
        raise LawError(
            f"no single polynomial of degree {len(at) - 1} meets the conditions (u, order) "
            f"{shown}; allowed: a set that fixes it, so give the lower orders where a higher one "
            "is given"
        ) from None


def _row(degree: int, u: Fraction, order: int) -> list[Fraction]:
    """Derivative of order r of each Bernstein polynomial at u, in fractions."""
    row = [Fraction(0)] * (degree + 1)
    lower = degree - order
    values = [comb(lower, i) * u**i * (1 - u) ** (lower - i) for i in range(lower + 1)]
    factor = perm(degree, order)
    for i, value in enumerate(values):
        for j in range(order + 1):
            row[i + j] += factor * value * comb(order, j) * (-1) ** (order - j)
    return row


def _solve(rows: list[list[Fraction]]) -> list[Fraction]:
    """Gauss-Jordan elimination; ZeroDivisionError when the system is singular."""
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


# The trigonometric polynomial over a whole turn (eq. 2.2).


def trigonometric(mean: float, cosine: list[float], sine: list[float]) -> Curve:
    """s(θ) = c₀ + Σ cᵢ cos iθ + sᵢ sin iθ, i from 1, θ in rad, with its derivatives."""
    waves = max(len(cosine), len(sine))
    harmonic = np.arange(1, waves + 1, dtype=np.float64)
    c = np.pad(np.array(cosine, dtype=np.float64), (0, waves - len(cosine)))
    s = np.pad(np.array(sine, dtype=np.float64), (0, waves - len(sine)))

    def curve(angle: FloatArray, order: int) -> FloatArray:
        # the r-th derivative turns (cos, sin) by r quarters: exact, no phase to round
        for_cosine, for_sine = [(c, s), (s, -c), (-c, -s), (-s, c)][order % 4]
        turned = angle[:, None] * harmonic
        scale = harmonic**order
        waves_sum = np.cos(turned) @ (for_cosine * scale) + np.sin(turned) @ (for_sine * scale)
        return np.asarray(waves_sum + (mean if order == 0 else 0.0))

    return curve


#: Lift of a file and height of its own points may differ by this fraction, and by so many
#: tolerances: the errors of the highest and of the lowest point.
SAME_LIFT, SAME_LIFT_TOLERANCES = 1e-2, 8.0


def own_pieces(segment: kinds.Segment, cam: CamConfig) -> Pieces | None:
    """Pieces from the segment's start (rad, m); None where it goes on from the level before."""
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
            pieces = fit(trigonometric(lift * segment.mean.si, cosine, sine), 0.0, span)
        case kinds.TangentArcs():
            pieces = tangent_arcs(segment, cam)
        case kinds.ArcsByRadii() | kinds.ArcsByCentres():
            pieces = whole_turn_arcs(segment, cam)
        case Table():
            pieces = smoothed(segment, cam).pieces
        case _:
            assert isinstance(segment, kinds.Dwell | kinds.Rise)
    return pieces


def smoothed(segment: Table, cam: CamConfig) -> Smoothed:
    """The spline through a table's points, and how far from them it is."""
    points = segment.file
    height = max(points.lifts) - min(points.lifts)
    limit = SAME_LIFT * height + SAME_LIFT_TOLERANCES * segment.tolerance.si
    if abs(height - cam.lift.si) > limit:
        raise LawError(
            f"cam {cam.name!r}: lift is {cam.lift.si * 1e3:g} mm, the points of {points.file} "
            f"rise by {height * 1e3:g} mm; allowed: the same, so write that"
        )
    dwells = [Rest(dwell.start.si, dwell.span.si, dwell.level.si) for dwell in segment.dwells]
    angles, lifts = np.array(points.angles), np.array(points.lifts)
    try:
        require_above_scatter(angles, lifts, segment.tolerance.si)
        return smooth(angles, lifts, segment.tolerance.si, dwells)
    except LawError as error:
        raise LawError(f"cam {cam.name!r}: {points.file}: {error}") from None


# Rises from 0 to 1 over u ∈ [0, 1] that are one Bézier curve, by their ordinates.


def full_rise(degree: int) -> FloatArray:
    """Ordinates {0…0, 1…1}, half each, of odd degree: C^((degree − 1)/2), eq. 3.1-3.3."""
    return np.repeat([0.0, 1.0], (degree + 1) // 2)


def half_rise_start(degree: int) -> FloatArray:
    """From rest to constant velocity 2, of even degree: C^(degree / 2) (eq. 3.4-3.6)."""
    half = degree // 2
    return np.concatenate([np.zeros(half), np.linspace(0.0, 1.0, half + 1)])


def half_rise_end(degree: int) -> FloatArray:
    """From constant velocity 2 to rest, of even degree (eq. 3.7-3.9)."""
    return np.asarray(1.0 - half_rise_start(degree)[::-1])


# The two industrial standards: modified sine and modified trapezoid.


def simple_harmonic(u: FloatArray, order: int) -> FloatArray:
    """The rise or its derivative in u, order 0 to 3."""
    if order == 0:
        return np.asarray(np.sin(0.5 * np.pi * u) ** 2)  # the same, without cancellation near 0
    half = 0.5 * np.pi**order * (-1.0 if order == 3 else 1.0)
    return np.asarray(half * (np.cos if order == 2 else np.sin)(np.pi * u))


def cycloidal(u: FloatArray, order: int) -> FloatArray:
    """The rise or its derivative in u, order 0 to 3."""
    turn = 2.0 * np.pi * u
    sine, cosine = np.sin(turn), np.cos(turn)
    level, slope = u - sine / (2.0 * np.pi), 1.0 - cosine
    return np.asarray((level, slope, 2.0 * np.pi * sine, 4.0 * np.pi**2 * cosine)[order])


PI = np.pi
SINE = 1.0 / (PI + 4.0)
TRAPEZOID = 1.0 / (PI + 2.0)
#: Lift, slope and curvature of the modified trapezoid at u = 1/8, where the sine ends.
AT_EIGHTH = TRAPEZOID * np.array([0.25 - 0.5 / PI, 2.0, 8.0 * PI])
#: Slope at u = 3/8, where the constant acceleration ends; with its lift the curve meets (½, ½).
SLOPE_AT_THREE = TRAPEZOID * (2.0 + 2.0 * PI)


def _wave(constant: float, slope: float, size: float, frequency: float, phase: float) -> Curve:
    """Constant + slope·u − size·sin(frequency·u + phase), with its derivatives."""

    def curve(u: FloatArray, order: int) -> FloatArray:
        turned = size * frequency**order * np.sin(frequency * u + phase + 0.5 * PI * order)
        line = (constant + slope * u, np.full_like(u, slope))
        return np.asarray((line[order] if order < 2 else 0.0) - turned)

    return curve


def _constant_acceleration(u: FloatArray, order: int) -> FloatArray:
    lift, slope, curvature = AT_EIGHTH
    v = u - 0.125
    terms = (lift + slope * v + 0.5 * curvature * v**2, slope + curvature * v, curvature + 0.0 * v)
    return np.asarray(terms[order] if order < 3 else 0.0 * v)


def _turned(curve: Curve, u: FloatArray, order: int) -> FloatArray:
    """The rise's second half, 1 − s(1 − u)."""
    value = curve(1.0 - u, order)
    return np.asarray(1.0 - value if order == 0 else value * (-1.0) ** (order + 1))


def _whole(first: list[Section], middle: Section) -> list[Section]:
    last = [(1.0 - b, 1.0 - a, partial(_turned, curve)) for a, b, curve in reversed(first)]
    return [*first, middle, *last]


#: s = (πu − sin(4πu)/4)/(π + 4) to 1/8, then (2 + πu − 9/4·sin((4πu + π)/3))/(π + 4) to 7/8.
MODIFIED_SINE = _whole(
    [(0.0, 0.125, _wave(0.0, PI * SINE, 0.25 * SINE, 4.0 * PI, 0.0))],
    (0.125, 0.875, _wave(2.0 * SINE, PI * SINE, 2.25 * SINE, 4.0 * PI / 3.0, PI / 3.0)),
)
#: s = (2u − sin(4πu)/2π)/(π + 2) to 1/8, a parabola to 3/8, then again a sine to 5/8.
_SIZE = 0.5 * TRAPEZOID / PI
MODIFIED_TRAPEZOID = _whole(
    [
        (0.0, 0.125, _wave(0.0, 2.0 * TRAPEZOID, _SIZE, 4.0 * PI, 0.0)),
        (0.125, 0.375, _constant_acceleration),
    ],
    (0.375, 0.625, _wave(0.5 - 0.5 * SLOPE_AT_THREE, SLOPE_AT_THREE, -_SIZE, 4.0 * PI, 0.0)),
)


# The rises known by a name: one unit rise each, and where it comes from.


@dataclass(frozen=True)
class NamedRise:
    """A rise from 0 to 1 over u ∈ [0, 1]: Bernstein ordinates, or analytic sections.

    slopes : of what it joins before and after, 0 for a dwell; equations 3.x are the laws thesis's
    """

    source: str
    shape: FloatArray | list[Section]
    slopes: tuple[float, float] = (0.0, 0.0)


#: Every name that a cam file may give, `RiseName`, with its rise.
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


@lru_cache(maxsize=len(NAMED_RISES))
def unit_rise(name: str) -> Pieces:
    """Bernstein pieces of the rise of that name, over u from 0 to 1."""
    shape = NAMED_RISES[name].shape
    return fit_sections(shape) if isinstance(shape, list) else ([0.0, 1.0], [shape])


# One rise up and down over any event angle.

#: A dwell narrower than this (rad) is left out.
MIN_DWELL = 1e-9


def up_and_down(rise: str, event: float, lift: float, high_dwell: float | None = None) -> Law:
    """Half a low dwell, rise, high dwell, fall, half a low dwell; of a lift in m.

    event, high_dwell : rad, of rise and fall alike, at most π; by default as long as the low dwell
    """
    steps, columns = unit_rise(rise)
    high = math.pi - event if high_dwell is None else high_dwell
    low = TURN - 2.0 * event - high
    breaks, pieces = [0.0], []
    for height, base, before in ((lift, 0.0, 0.5 * low), (-lift, lift, high)):
        if before > MIN_DWELL:
            breaks.append(breaks[-1] + before)
            pieces.append(np.array([base]))
        start = breaks[-1]
        breaks += [start + event * u for u in steps[1:]]
        pieces += [base + height * column for column in columns]
    if low > MIN_DWELL:
        breaks.append(TURN)
        pieces.append(np.array([0.0]))
    breaks[-1] = TURN
    return Law(f"{rise} over {math.degrees(event):.4g}°", np.array(breaks), joined(pieces))

"""The cam angles at which a law passes given heights, from roots, not from samples."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cam_rig.laws import Law, bernstein
from cam_rig.laws import spline as b_spline
from cam_rig.laws.cam import segment_angles
from cam_rig.laws.law import extremes
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Bezier, BSpline, Rise, Segment
from cam_rig.units import TURN, FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline as Spline

#: Heights that are timed, as fractions of the lift.
LEVELS = (0.01, 0.50, 0.99)
#: Nearer to a height than this fraction of the lift a joint is on it, and two passages nearer than
#: this (rad) are one.
ON, SAME = 1e-12, 1e-7
#: So far (rad) on either side of a passage the law is above and below.
BESIDE = 1e-5


@dataclass(frozen=True)
class TimedEvent:
    """A passage through a height, ``level`` over the lowest place as a fraction of the lift.

    It is at cam angle ``angle`` (rad), upwards where ``rising``, with s' = ``slope`` (m/rad).
    """

    level: float
    angle: float
    rising: bool
    slope: float


def events(law: Law, lift: float, levels: Iterable[float] = LEVELS) -> tuple[TimedEvent, ...]:
    """Every passage of a turn, ``levels`` over the law's lowest place in parts of ``lift``."""
    low = extremes(law, 0)[0].value
    found = []
    for level in levels:
        height = low + level * lift
        above = law.ordinates - height  # roots are inside of pieces, or joints
        joints = law.breaks[:-1][np.abs(above[0]) <= ON * lift]
        angles = np.sort(np.mod([*joints, *_roots(law, above)], TURN))
        for angle in angles[np.diff(angles, prepend=-np.inf) > SAME].tolist():
            before, after = law(np.array([angle - BESIDE, angle + BESIDE])) - height
            if before * after < 0.0:
                slope = float(law(angle, 1))
                found.append(TimedEvent(level, angle, bool(after > before), slope))
    return tuple(sorted(found, key=lambda event: event.angle))


def _roots(law: Law, ordinates: FloatArray) -> list[float]:
    """Cam angles at which a piecewise polynomial on the law's pieces is zero."""
    return [
        float(start + span * u)
        for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True))
        for u in bernstein.crossings(ordinates[:, i])
    ]


# What an ordinate of a Bézier curve or a B-spline moves: the law, and the angles it is timed by.

#: An ordinate reaches where s changes by more than this part of the ordinate's change.
REACHED = 1e-3
#: Steps between ordinates that differ by less are equal.
SAME_STEP = 1e-12


@dataclass(frozen=True, eq=False)
class Ordinates:
    """The ordinates of one segment, and the basis function of each.

    ``segment`` counts the file's from 0; ``values`` ``(m,)`` are in fractions of the lift over the
    base circle, ``abscissae`` ``(m,)`` and ``breaks`` ``(k + 1,)`` the cam angles (rad) of control
    points and of pieces, ``basis`` ``(p + 1, k, m)`` Bernstein ordinates of each function on each.
    """

    segment: int
    values: FloatArray
    abscissae: FloatArray
    breaks: FloatArray
    basis: FloatArray

    def at(self, angle: float) -> FloatArray:
        """``(m,)``: B at a cam angle (rad); zero outside of the segment."""
        if not self.breaks[0] <= angle <= self.breaks[-1]:
            return np.zeros(self.values.size)
        piece = int(np.clip(np.searchsorted(self.breaks, angle) - 1, 0, self.breaks.size - 2))
        start, stop = self.breaks[piece : piece + 2]
        u = np.array([(angle - start) / (stop - start)])
        return np.asarray(bernstein.evaluate(self.basis[:, piece], u)[0])

    def shifts(self, event: TimedEvent, lift: float) -> FloatArray:
        """``(m,)``: ∂θ/∂cⱼ of an event, rad per ordinate of one lift (m)."""
        return -lift * self.at(event.angle) / event.slope

    @property
    def free(self) -> slice:
        """Those that the joints leave free: all but the ones that are `held` at each end."""
        values = self.values.tolist()
        first = held(values)
        return slice(first, max(first, len(values) - held(values[::-1])))

    def reach(self, change: FloatArray, above: float) -> float:
        """Over how much of the turn (rad) |Σ cⱼ Bⱼ| is above a bound, c = ``change`` ``(m,)``."""
        moved = self.basis @ change
        return sum(
            float(span) * (stop - start)
            for i, span in enumerate(np.diff(self.breaks))
            for sign in (1.0, -1.0)
            for start, stop in bernstein.negative_intervals(above - sign * moved[:, i])
        )

    def reaches(self) -> FloatArray:
        """``(m,)``: over how much of the turn (rad) each changes s by `REACHED` of its change."""
        return np.array([self.reach(unit, REACHED) for unit in np.eye(self.values.size)])


def held(values: Sequence[float]) -> int:
    """How many ordinates at the start join the curve to what is before it.

    Equal ones join it to a dwell, three or more at one distance to constant velocity; the first
    one always holds the level.
    """
    steps = np.diff(values)
    away = np.flatnonzero(np.abs(steps - steps[0]) > SAME_STEP)
    run = int(away[0]) + 1 if away.size else len(values)
    return run if abs(steps[0]) <= SAME_STEP or run >= 3 else 1


def ordinates_of(cam: CamConfig, law: Law) -> list[Ordinates]:
    """Of each segment with ordinates: Bézier, B-spline, and rises that are polynomials."""
    starts = zip(cam.segments, segment_angles(cam), strict=True)
    found = (_of(i, segment, start, law, cam.lift.si) for i, (segment, start) in enumerate(starts))
    return [ordinates for ordinates in found if ordinates is not None]


def _of(number: int, segment: Segment, start: float, law: Law, lift: float) -> Ordinates | None:
    breaks = start + np.array([0.0, segment.span.si])
    if isinstance(segment, Bezier):
        return _bezier(number, np.array(segment.ordinates.numbers), breaks)
    if isinstance(segment, BSpline):
        return _spline(number, segment, start)
    shape = NAMED_RISES[segment.law].shape if isinstance(segment, Rise) else None
    if not isinstance(segment, Rise) or not isinstance(shape, np.ndarray):
        return None
    level = float(law(start)) / lift
    return _bezier(number, level + (segment.to - level) * shape, breaks)


def _bezier(number: int, values: FloatArray, breaks: FloatArray) -> Ordinates:
    at = np.linspace(breaks[0], breaks[-1], values.size)
    return Ordinates(number, values, at, breaks, np.eye(values.size)[:, None, :])


def _spline(number: int, segment: BSpline, start: float) -> Ordinates:
    knots = np.array(segment.knots.numbers)
    knots = start + segment.span.si * ((knots - knots[0]) / (knots[-1] - knots[0]))
    values = np.array(segment.ordinates.numbers)
    parts = [b_spline.pieces(knots, unit, segment.degree) for unit in np.eye(values.size)]
    basis = np.stack([np.stack(columns, axis=1) for _, columns in parts], axis=2)
    at = b_spline.greville(knots, segment.degree)
    return Ordinates(number, values, at, np.array(parts[0][0]), basis)


def shift_matrix(ordinates: Ordinates, timed: Iterable[TimedEvent], lift: float) -> FloatArray:
    """``(events, m)``: how each event moves with each ordinate, rad per ordinate of one lift."""
    return np.stack([ordinates.shifts(event, lift) for event in timed])


# A B-spline of the same lift and events as a Bézier curve over the whole turn.

#: Degree of the spline and its pieces, of 15° each.
DEGREE, PIECES = 5, 24
#: Places over the turn at which it is held against the curve.
COMPARED = 720
#: Greatest lifts that differ by less than this fraction of the lift are one.
TIE = 1e-9


def equal(values: Sequence[float]) -> int:
    """How many ordinates at the start are equal: so many derivatives vanish there, less one."""
    return next((i for i, value in enumerate(values) if value != values[0]), len(values))


def with_same_events(cam: CamConfig, law: Law, timed: Sequence[TimedEvent]) -> CamConfig:
    """The cam, of one curve, with a B-spline that has events at the same angles in its place."""
    (segment,) = cam.segments
    assert isinstance(segment, Bezier)
    knots = np.concatenate(
        [np.zeros(DEGREE - 1), np.arange(PIECES + 1.0), np.full(DEGREE - 1, PIECES)]
    )
    values = _fit(law, cam.lift.si, timed, segment.ordinates.numbers, knots)
    source = f"nearest to {cam.name}, with its lift and events"
    spline = {
        "law": "b_spline",
        "span": segment.span,
        "degree": DEGREE,
        "knots": {"assumed": knots.tolist(), "unit": "1", "source": "pieces of one length"},
        "ordinates": {"assumed": values.tolist(), "unit": "1", "source": source},
    }
    return cam.model_copy(
        update={
            "name": f"{cam.name}_b_spline",
            "title": f"B-spline with the events of {cam.title}",
            "segments": [BSpline.model_validate(spline)],
        }
    )


def _fit(
    law: Law,
    lift: float,
    timed: Sequence[TimedEvent],
    ordinates: Sequence[float],
    knots: FloatArray,
) -> FloatArray:
    """Ordinates of least squares under conditions, by Lagrange's multipliers."""
    from scipy.interpolate import BSpline as Spline

    outer = np.concatenate([knots[:1], knots, knots[-1:]]) * (TURN / PIECES)
    spline = Spline(outer, np.eye(outer.size - DEGREE - 1), DEGREE)
    angles = np.linspace(0.0, TURN, COMPARED)
    rows, wanted = spline(angles), law(angles) / lift
    conditions, values = _conditions(law, lift, timed, ordinates, spline)
    count, size = conditions.shape
    matrix = np.zeros((size + count, size + count))
    matrix[:size, :size] = rows.T @ rows
    matrix[:size, size:], matrix[size:, :size] = conditions.T, conditions
    found = np.linalg.solve(matrix, np.concatenate([rows.T @ wanted, values]))[:size]
    first, last = equal(ordinates), equal(ordinates[::-1])
    found[:first], found[size - last :] = ordinates[0], ordinates[-1]  # without their rounding
    return np.asarray(found)


def _conditions(
    law: Law, lift: float, timed: Sequence[TimedEvent], ordinates: Sequence[float], spline: Spline
) -> tuple[FloatArray, FloatArray]:
    """Rows for the ordinates and right-hand sides: ends, events, greatest lifts."""
    unit = np.eye(spline.c.shape[0])
    first, last = equal(ordinates), equal(ordinates[::-1])
    at, top = np.array([event.angle for event in timed]), extremes(law, 0)[1].value
    still = _roots(law, law.derivative_ordinates(1))
    tops = np.array([angle for angle in still if float(law(angle)) > top - TIE * lift])
    rows = [unit[:first], unit[unit.shape[0] - last :], spline(at), spline(tops), spline(tops, 1)]
    ends = np.repeat([ordinates[0], ordinates[-1]], [first, last])
    right = [ends, law(at) / lift, law(tops) / lift, np.zeros(tops.size)]
    return np.concatenate(rows), np.concatenate(right)

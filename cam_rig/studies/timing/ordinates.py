"""What an ordinate of a Bézier curve or a B-spline moves: the law, and the angles it is timed by.

s is linear in its ordinates: ∂s/∂cⱼ = h Bⱼ, Bⱼ the basis function, h the lift. The angle θ at
which s passes a fixed height then moves by ∂θ/∂cⱼ = −h Bⱼ(θ)/s'(θ) (implicit differentiation).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law, bernstein
from cam_rig.laws.cam import segment_angles
from cam_rig.laws.families import b_spline
from cam_rig.laws.named import NAMED_RISES
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Bezier, BSpline, Rise, Segment
from cam_rig.studies.timing.events import TimedEvent

#: An ordinate reaches where s changes by more than this part of the ordinate's change.
REACHED = 1e-3
#: Steps between ordinates that differ by less are equal.
SAME_STEP = 1e-12


@dataclass(frozen=True, eq=False)
class Ordinates:
    """The ordinates of one segment, and the basis function of each.

    Parameters
    ----------
    segment : number of the segment in the cam's file, from 0
    kind : ``bezier`` or ``b_spline``
    values : ``(m,)`` in fractions of the lift, over the base circle
    abscissae : ``(m,)`` cam angles of the control points, rad
    breaks : ``(k + 1,)`` cam angles of the pieces, rad
    basis : ``(p + 1, k, m)`` Bernstein ordinates of each function on each piece
    """

    segment: int
    kind: str
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
    """Of each segment that has ordinates: Bézier, B-spline, and rises that are polynomials.

    A rise known by a name is a Bézier curve too; trigonometric rises and dwells are none.
    """
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
    return Ordinates(number, "bezier", values, at, breaks, np.eye(values.size)[:, None, :])


def _spline(number: int, segment: BSpline, start: float) -> Ordinates:
    knots = np.array(segment.knots.numbers)
    knots = start + segment.span.si * ((knots - knots[0]) / (knots[-1] - knots[0]))
    values = np.array(segment.ordinates.numbers)
    parts = [b_spline.pieces(knots, unit, segment.degree) for unit in np.eye(values.size)]
    basis = np.stack([np.stack(columns, axis=1) for _, columns in parts], axis=2)
    at = b_spline.greville(knots, segment.degree)
    return Ordinates(number, "b_spline", values, at, np.array(parts[0][0]), basis)


def shift_matrix(ordinates: Ordinates, timed: Iterable[TimedEvent], lift: float) -> FloatArray:
    """``(events, m)``: how each event moves with each ordinate, rad per ordinate of one lift."""
    return np.stack([ordinates.shifts(event, lift) for event in timed])

"""A B-spline of the same lift and events as a Bézier curve over the whole turn.

It is the one nearest to the curve (least squares) that passes the timed heights at the same angles
and has its greatest lifts at the same places: conditions that are linear in the ordinates. Its ends
join as smoothly, as its first ordinates are equal as often as the curve's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.peaks import extremes
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Bezier, BSpline
from cam_rig.studies.timing.events import TimedEvent
from cam_rig.units import TURN

if TYPE_CHECKING:  # a quarter of a node's imports, which few cams need
    from scipy.interpolate import BSpline as Spline

#: Degree of the spline and its pieces, of 15° each.
DEGREE, PIECES = 5, 24
#: Places over the turn at which it is held against the curve.
COMPARED = 720
#: Greatest lifts that differ by less than this fraction of the lift are one.
TIE = 1e-9


def is_one_curve(cam: CamConfig) -> bool:
    """Whether a cam is one Bézier curve over the whole turn."""
    return len(cam.segments) == 1 and isinstance(cam.segments[0], Bezier)


def equal(values: Sequence[float]) -> int:
    """How many ordinates at the start are equal: so many derivatives vanish there, less one."""
    return next((i for i, value in enumerate(values) if value != values[0]), len(values))


def with_same_events(cam: CamConfig, law: Law, timed: Sequence[TimedEvent]) -> CamConfig:
    """The cam with a B-spline in place of its Bézier curve.

    Parameters
    ----------
    law : of the cam
    timed : events that both have at the same angles

    Raises
    ------
    ConfigError : the cam is not one Bézier curve over the whole turn
    """
    segment = cam.segments[0]
    if not isinstance(segment, Bezier) or len(cam.segments) != 1:
        raise ConfigError(
            f"cam {cam.name!r} has no Bézier curve over the whole turn; allowed: one segment "
            "bezier of 360°"
        )
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
    at = np.array([event.angle for event in timed])
    tops = np.array(_tops(law, lift))
    rows = [unit[:first], unit[unit.shape[0] - last :], spline(at), spline(tops), spline(tops, 1)]
    ends = np.repeat([ordinates[0], ordinates[-1]], [first, last])
    right = [ends, law(at) / lift, law(tops) / lift, np.zeros(tops.size)]
    return np.concatenate(rows), np.concatenate(right)


def _tops(law: Law, lift: float) -> list[float]:
    """Cam angles (rad) of the greatest lift, each of them where several are equal."""
    slope, top = law.derivative_ordinates(1), extremes(law, 0)[1].value
    at = [
        float(start + span * u)
        for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True))
        for u in bernstein.crossings(slope[:, i])
    ]
    return [angle for angle in at if float(law(angle)) > top - TIE * lift]

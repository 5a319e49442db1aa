"""A law as a linear function of its ordinates: what a page multiplies, and the law of any of them.

Every piece of the law is a Bézier curve whose ordinates are those of its segment times a fixed
matrix, so s to s''' at fixed angles are too. The ends of segments stay as they are, up to the
derivative in which the start joins there.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cam_rig.laws import Law, bernstein, spline
from cam_rig.laws.cam import abscissae, segment_angles
from cam_rig.laws.law import joints
from cam_rig.panel.board.drawable import (
    DRAWN,
    KEPT,
    DrawableCam,
    Drawn,
    as_b_splines,
    with_own_ordinates,
)
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import BSpline
from cam_rig.units import TURN, FloatArray

#: Angles of a turn at which the page has the law, and its derivatives: s to s'''.
POINTS, ORDERS = 720, 4


@dataclass(frozen=True)
class Handle:
    """One ordinate that may be moved, by its index among all and that of its segment.

    At ``angle`` (rad) it pulls the most; ``left`` and ``right`` (rad) of there are the fixed
    ordinates nearest to it.
    """

    index: int
    angle: float
    segment: int
    left: float
    right: float


@dataclass(frozen=True, eq=False)
class MotionTable:
    """S to s''' (m/rad^order) at n angles: constant ``(4, n)`` + Σ table ``(4, n, w)`` · ordinates.

    ``first`` ``(n,)`` is the index of the first ordinate that plays a part at an angle.
    """

    first: FloatArray
    table: FloatArray
    constant: FloatArray


@dataclass(frozen=True, eq=False)
class DrawnLaw:
    """The laws of a cam's segments with any ordinates, in fractions of the lift."""

    start: DrawableCam

    @classmethod
    def of(cls, cam: CamConfig) -> DrawnLaw:
        """Of a cam's own ordinates, where some may be moved; else of B-splines in its place."""
        own = with_own_ordinates(cam)
        drawn = None if own is None else cls(own)
        return drawn if drawn is not None and drawn.handles else cls(as_b_splines(cam))

    @cached_property
    def ordinates(self) -> FloatArray:
        """``(m,)`` those of the start, segment by segment."""
        drawn = (segment for segment in self.start.cam.segments if isinstance(segment, DRAWN))
        return np.array([x for segment in drawn for x in segment.ordinates.numbers])

    @cached_property
    def handles(self) -> list[Handle]:
        """The ordinates that may be moved, in the order of their angles."""
        smooth = {joint.angle: joint.continuity for joint in joints(self.start.law)}
        ends = np.array(sorted(smooth))
        found, index = [], 0
        segments = zip(self.start.cam.segments, segment_angles(self.start.cam), strict=True)
        for number, (segment, begin) in enumerate(segments):
            if not isinstance(segment, DRAWN):
                continue
            count = len(segment.ordinates.numbers)
            at = begin + segment.span.si * abscissae(segment)
            edges = (begin, (begin + segment.span.si) % TURN)
            fixed = [1 + min(KEPT, max(0, smooth[_nearest(ends, edge)])) for edge in edges]
            first, last = float(at[fixed[0] - 1]), float(at[-fixed[1]])
            for i in range(fixed[0], count - fixed[1]):
                here = float(at[i])
                found.append(Handle(index + i, here % TURN, number, here - first, last - here))
            index += count
        return found

    @cached_property
    def _pieces(self) -> list[tuple[int, FloatArray]]:
        """Of each piece its first ordinate's index, and ``(p + 1, k)`` from k of them (m)."""
        degree, lift, found, index = self.start.law.degree, self.start.cam.lift.si, [], 0
        for segment in self.start.cam.segments:
            if not isinstance(segment, DRAWN):
                found.append((0, np.zeros((degree + 1, 0))))
                continue
            for columns in _bezier(segment):
                used = np.flatnonzero(columns.any(axis=0))
                own = columns[:, used[0] : used[-1] + 1]
                found.append((index + int(used[0]), lift * bernstein.elevate(own, degree)))
            index += len(segment.ordinates.numbers)
        return found

    def law(self, ordinates: FloatArray, name: str) -> Law:
        """The law of some ordinates ``(m,)``."""
        start = self.start.law
        columns = [
            matrix @ ordinates[first : first + matrix.shape[1]]
            if matrix.shape[1]
            else start.ordinates[:, i]
            for i, (first, matrix) in enumerate(self._pieces)
        ]
        return Law(name, start.breaks, np.stack(columns, axis=1))

    @cached_property
    def table(self) -> MotionTable:
        """What gives s to s''' at `POINTS` equal steps of a turn; right limits at joints."""
        law = self.start.law
        angle = table_angles()
        piece = np.searchsorted(law.breaks[1:-1], angle, side="right")
        u = (angle - law.breaks[piece]) / law.spans[piece]
        width = max(matrix.shape[1] for _, matrix in self._pieces)
        first, count = np.zeros(POINTS), self.ordinates.size
        table, constant = np.zeros((ORDERS, POINTS, width)), np.zeros((ORDERS, POINTS))
        for i in np.unique(piece):
            here, (begin, matrix) = np.flatnonzero(piece == i), self._pieces[i]
            if not matrix.shape[1]:
                constant[0, here] = law.ordinates[0, i]
                continue
            shift = max(0, begin + width - count)  # no row reaches beyond the last ordinate
            columns = slice(shift, shift + matrix.shape[1])
            first[here] = begin - shift
            for order in range(min(ORDERS, law.degree + 1)):
                values = bernstein.basis(law.degree - order, u[here]) @ matrix
                table[order, here, columns] = values
                matrix = bernstein.derivative(matrix) / law.spans[i]
        return MotionTable(first, table, constant)


def table_angles() -> FloatArray:
    """``(n,)`` cam angles (rad) of a `MotionTable`."""
    return np.linspace(0.0, TURN, POINTS, endpoint=False)


def in_base64(array: FloatArray) -> str:
    """As little-endian float64, row by row: what a page decodes."""
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")


def motion_in_base64(law: Law) -> str:
    """S to s''' of any law at a table's angles, ``(4, n)`` m/rad^order."""
    return in_base64(np.stack([law(table_angles(), order) for order in range(ORDERS)]))


def _bezier(segment: Drawn) -> list[FloatArray]:
    """From the ordinates of a segment to those of each of its Bézier pieces."""
    alone = np.eye(len(segment.ordinates.numbers))
    if not isinstance(segment, BSpline):
        return [alone]
    return spline.pieces(np.array(segment.knots.numbers), alone, segment.degree)[1]


def _nearest(ends: FloatArray, angle: float) -> float:
    """The joint at an angle (rad) of the turn, rounding aside."""
    apart = np.abs((ends - angle + 0.5 * TURN) % TURN - 0.5 * TURN)
    return float(ends[np.argmin(apart)])

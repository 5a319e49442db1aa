"""Motion law of the drawing board, as a linear function of its ordinates.

The ordinates are the control values of the Bézier and B-spline segments. Each polynomial piece of
the law is a Bézier curve. Its ordinates are those of its segment, multiplied by a fixed matrix. s
to s''' at fixed angles are therefore linear in the ordinates too, and a page computes them by one
multiplication. The ordinates at the ends of a segment are fixed, so that the derivatives that were
continuous there stay continuous.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cam_rig.laws import Law, bernstein, spline
from cam_rig.laws.cam import abscissae, segment_angles
from cam_rig.laws.law import joints
from cam_rig.panel.board import drawable
from cam_rig.panel.board.drawable import DRAWABLE_SEGMENTS, DrawableCam
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import BSpline
from cam_rig.units import TURN, FloatArray

#: Number of equally spaced angles per turn at which the page evaluates the law.
MOTION_POINTS = 720
#: Number of curves of the law that are drawn: s, s', s'' and s'''.
ORDERS = 4


@dataclass(frozen=True)
class Handle:
    """Handle on the drawing board: an ordinate of the law that may be moved.

    `index` is its index among all ordinates and `segment` the index of its segment. `angle` (rad)
    is the angle at which it has the largest effect. `left` and `right` (rad) are the distances from
    there to the nearest fixed ordinates.
    """

    index: int
    angle: float
    segment: int
    left: float
    right: float


@dataclass(frozen=True, eq=False)
class MotionTable:
    """Linear map from the ordinates to s, s', s'' and s''' (m/rad^order) at n angles.

    The curves are `constant` ``(4, n)`` + Σ `table` ``(4, n, w)`` · ordinates. `first` ``(n,)`` is
    the index of the first ordinate that contributes at an angle.
    """

    first: FloatArray
    table: FloatArray
    constant: FloatArray


@dataclass(frozen=True, eq=False)
class DrawnLaw:
    """Motion law of a cam for any values of its ordinates.

    `start` is the cam before it is changed. The ordinates are fractions of the lift.
    """

    start: DrawableCam

    @classmethod
    def of(cls, cam: CamConfig) -> DrawnLaw:
        """Return the law of a cam, for drawing.

        Its ordinates are those of the cam's file if some of them may be moved. Otherwise the cam is
        converted to B-splines.
        """
        start = drawable.with_file_ordinates(cam)
        law = None if start is None else cls(start)
        return law if law is not None and law.handles else cls(drawable.to_b_splines(cam))

    @cached_property
    def ordinates(self) -> FloatArray:
        """Ordinates of the law before it is changed, segment by segment, shape ``(m,)``."""
        segments = (s for s in self.start.cam.segments if isinstance(s, DRAWABLE_SEGMENTS))
        return np.array([x for segment in segments for x in segment.ordinates.numbers])

    @cached_property
    def handles(self) -> list[Handle]:
        """Ordinates that may be moved, in the order of their angles."""
        continuity = {joint.angle: joint.continuity for joint in joints(self.start.law)}
        joint_angles = np.array(sorted(continuity))
        handles, index = [], 0
        segments = zip(self.start.cam.segments, segment_angles(self.start.cam), strict=True)
        for number, (segment, start) in enumerate(segments):
            if not isinstance(segment, DRAWABLE_SEGMENTS):
                continue
            count = len(segment.ordinates.numbers)
            angles = start + segment.span.si * abscissae(segment)
            edges = (start, (start + segment.span.si) % TURN)
            orders = [max(0, continuity[_nearest_joint(joint_angles, edge)]) for edge in edges]
            fixed = [1 + min(drawable.MAX_KEPT_CONTINUITY, order) for order in orders]
            for i in range(fixed[0], count - fixed[1]):
                first, last = float(angles[fixed[0] - 1]), float(angles[-fixed[1]])
                angle = float(angles[i])
                handles.append(Handle(index + i, angle % TURN, number, angle - first, last - angle))
            index += count
        return handles

    @cached_property
    def _pieces(self) -> list[tuple[int, FloatArray]]:
        """Index of the first ordinate, and matrix, of each polynomial piece of the law.

        The matrix ``(p + 1, k)`` (m) converts k successive ordinates of the segment to the p + 1
        ordinates of the piece in Bernstein form.
        """
        degree, lift, pieces, index = self.start.law.degree, self.start.cam.lift.si, [], 0
        for segment in self.start.cam.segments:
            if not isinstance(segment, DRAWABLE_SEGMENTS):
                pieces.append((0, np.zeros((degree + 1, 0))))
                continue
            matrices = [np.eye(len(segment.ordinates.numbers))]
            if isinstance(segment, BSpline):
                knots = np.array(segment.knots.numbers)
                matrices = spline.pieces(knots, matrices[0], segment.degree)[1]
            for columns in matrices:
                used = np.flatnonzero(columns.any(axis=0))
                matrix = columns[:, used[0] : used[-1] + 1]
                pieces.append((index + int(used[0]), lift * bernstein.elevate(matrix, degree)))
            index += len(segment.ordinates.numbers)
        return pieces

    def law(self, ordinates: FloatArray, name: str) -> Law:
        """Return the law with the given ordinates ``(m,)``, under the given name."""
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
        """Linear map from the ordinates to s to s''' at equally spaced cam angles.

        At joints of the law the values are right limits.
        """
        law = self.start.law
        angle = table_angles()
        piece = np.searchsorted(law.breaks[1:-1], angle, side="right")
        u = (angle - law.breaks[piece]) / law.spans[piece]
        width = max(matrix.shape[1] for _, matrix in self._pieces)
        first, count = np.zeros(MOTION_POINTS), self.ordinates.size
        table = np.zeros((ORDERS, MOTION_POINTS, width))
        constant = np.zeros((ORDERS, MOTION_POINTS))
        for i in np.unique(piece):
            rows, (start, matrix) = np.flatnonzero(piece == i), self._pieces[i]
            if not matrix.shape[1]:
                constant[0, rows] = law.ordinates[0, i]
                continue
            # No row may extend beyond the last ordinate.
            shift = max(0, start + width - count)
            columns = slice(shift, shift + matrix.shape[1])
            first[rows] = start - shift
            for order in range(min(ORDERS, law.degree + 1)):
                values = bernstein.basis(law.degree - order, u[rows]) @ matrix
                table[order, rows, columns] = values
                matrix = bernstein.derivative(matrix) / law.spans[i]
        return MotionTable(first, table, constant)


def table_angles() -> FloatArray:
    """Return the cam angles (rad) of a `MotionTable`, shape ``(n,)``."""
    return np.linspace(0.0, TURN, MOTION_POINTS, endpoint=False)


def in_base64(array: FloatArray) -> str:
    """Return an array as base64 text of little-endian float64, row by row."""
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")


def motion_in_base64(law: Law) -> str:
    """Return s to s''' of a law at the table's angles as base64.

    The array is ``(4, n)`` in m/rad^order.
    """
    return in_base64(np.stack([law(table_angles(), order) for order in range(ORDERS)]))


def _nearest_joint(angles: FloatArray, angle: float) -> float:
    """Return the angle of the joint nearest to an angle (rad) of the turn."""
    distance = np.abs((angles - angle + 0.5 * TURN) % TURN - 0.5 * TURN)
    return float(angles[np.argmin(distance)])

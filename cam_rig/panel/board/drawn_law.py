"""Motion law of the drawing board, as a linear function of its ordinates.

The ordinates are the control values of the Bézier and B-spline segments. Each polynomial piece of
the law is a Bézier curve. Its ordinates are those of its segment, multiplied by a fixed matrix. A
page receives the matrices and computes the law of any ordinates. The ordinates at the ends of a
segment are fixed, so that the derivatives that were continuous there stay continuous.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cam_rig.laws import Law, bernstein, spline
from cam_rig.laws.cam import abscissae, segment_angles
from cam_rig.laws.law import joints
from cam_rig.panel.board import drawable
from cam_rig.panel.board.drawable import DRAWABLE_SEGMENTS, DrawableCam
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import BSpline
from cam_rig.units import TURN, FloatArray


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
    def pieces(self) -> list[tuple[int, FloatArray]]:
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
            for i, (first, matrix) in enumerate(self.pieces)
        ]
        return Law(name, start.breaks, np.stack(columns, axis=1))

    @cached_property
    def page_data(self) -> dict[str, Any]:
        """JSON data from which a page computes the law of any ordinates.

        Each piece of the law has the index of its first ordinate, the number of its ordinates and a
        matrix. A dwell has no ordinates. Its lift is in ``dwell`` (m).
        """
        law, matrices = self.start.law, [matrix for _, matrix in self.pieces]
        return {
            "breaks": law.breaks.tolist(),
            "degree": law.degree,
            "first": [first for first, _ in self.pieces],
            "count": [matrix.shape[1] for matrix in matrices],
            "dwell": [
                0.0 if m.shape[1] else float(law.ordinates[0, i]) for i, m in enumerate(matrices)
            ],
            "matrices": in_base64(np.concatenate([matrix.ravel() for matrix in matrices])),
        }


def in_base64(array: FloatArray) -> str:
    """Return an array as base64 text of little-endian float64, row by row."""
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")


def law_data(law: Law) -> dict[str, Any]:
    """Return the JSON data of a law for a page: breaks (rad), and ordinates (m) of each piece."""
    return {"name": law.name, "breaks": law.breaks.tolist(), "ordinates": law.ordinates.T.tolist()}


def _nearest_joint(angles: FloatArray, angle: float) -> float:
    """Return the angle of the joint nearest to an angle (rad) of the turn."""
    distance = np.abs((angles - angle + 0.5 * TURN) % TURN - 0.5 * TURN)
    return float(angles[np.argmin(distance)])

"""Cam of a motion controller: its segments, and the law that they are.

The units are those of the written texts: the master in degrees, the slave in mm, and derivatives
of the slave by the master in mm/deg, mm/deg² and mm/deg³.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws.bernstein import from_powers, hermite, join_pieces, rotate_to_zero
from cam_rig.laws.law import Law
from cam_rig.laws.segments import unit_rise
from cam_rig.units import TURN, FloatArray

#: Length of a turn of the master, deg.
TURN_DEG = 360.0
#: Size of 1 mm in m.
MM = 1e-3
#: Largest difference of two master positions (deg) that count as equal. It is far above the
#: rounding of the written digits, and far below any segment.
MASTER_ATOL_DEG = 1e-9
#: Name of a cam whose text has none.
DEFAULT_NAME = "controller_cam"
#: Largest number in a text. Larger ones are damaged, and would overflow.
MAX_NUMBER = 1e12
#: Largest step of the slave (mm) between two segments that counts as rounding.
SLAVE_ATOL_MM = 1e-9


class SegmentKind(Enum):
    """Motion function of a segment, by which its polynomial follows from its boundaries."""

    LINE = "line"  #: straight line
    POLY5 = "poly5"  #: polynomial of degree 5 with y, v and a of both ends
    POLY7 = "poly7"  #: polynomial of degree 7 with y, v, a and j of both ends
    INCLINED_SINE = "inclined_sine"  #: cycloidal rise between two dwells
    MODIFIED_SINE = "modified_sine"  #: modified sine rise between two dwells
    COEFFICIENTS = "coefficients"  #: coefficients of the powers of the normalised master position


#: Number of derivatives, the slave itself included, that determine a Hermite segment at each end.
CONDITIONS = {SegmentKind.LINE: 1, SegmentKind.POLY5: 3, SegmentKind.POLY7: 4}
#: Named rise of each analytic kind of segment.
NAMED_RISE = {SegmentKind.INCLINED_SINE: "cycloidal", SegmentKind.MODIFIED_SINE: "modified_sine"}


class Boundary(NamedTuple):
    """Master position x and slave position y at an end of a segment, with derivatives."""

    x: float  #: master position, deg
    y: float  #: slave position, mm
    v: float = 0.0  #: first derivative, mm/deg
    a: float = 0.0  #: second derivative, mm/deg²
    j: float = 0.0  #: third derivative, mm/deg³


@dataclass(frozen=True)
class ControllerSegment:
    """Segment of a controller's cam between two boundaries.

    Parameters
    ----------
    kind : SegmentKind
        Motion function.
    left, right : Boundary
        Boundaries of the segment.
    coefficients : tuple of float
        Stroke in mm, then c₀, c₁, … of y = left.y + stroke Σ cₖ zᵏ with z from 0 to 1. It is empty
        for all kinds but `SegmentKind.COEFFICIENTS`.
    """

    kind: SegmentKind
    left: Boundary
    right: Boundary
    coefficients: tuple[float, ...] = ()

    def pieces(self) -> tuple[list[float], list[FloatArray]]:
        """Return breaks (u from 0 to 1) and Bernstein ordinates (mm) of the segment."""
        if self.kind in NAMED_RISE:
            breaks, columns = unit_rise(NAMED_RISE[self.kind])
            height = self.right.y - self.left.y
            return breaks, [self.left.y + height * column for column in columns]
        if self.kind is SegmentKind.COEFFICIENTS:
            stroke, *powers = self.coefficients
            return [0.0, 1.0], [self.left.y + stroke * from_powers(powers)]
        count, span = CONDITIONS[self.kind], self.right.x - self.left.x
        start, end = (np.array(end[1 : 1 + count]) for end in (self.left, self.right))
        return [0.0, 1.0], [hermite(start, end, span)]


@dataclass(frozen=True)
class ControllerCam:
    """Cam of a controller: name, comment lines and segments of one turn of the master."""

    name: str
    segments: tuple[ControllerSegment, ...]
    notes: tuple[str, ...] = ()

    @cached_property
    def law(self) -> Law:
        """Law that the controller executes, in m over one turn of the cam in rad.

        Raises
        ------
        LawError
            If the segments do not span one turn of the master, or do not join.
        """
        first, last = self.segments[0].left, self.segments[-1].right
        if abs(last.x - first.x - TURN_DEG) > MASTER_ATOL_DEG:
            raise LawError(
                f"the master moves from {first.x:.12g}° to {last.x:.12g}°; allowed: one turn of "
                "360°, with its last point"
            )
        joints = [*pairwise(self.segments), (self.segments[-1], self.segments[0])]
        for before, after in joints:
            step = after.left.y - before.right.y
            if abs(step) > SLAVE_ATOL_MM:
                raise LawError(
                    f"the slave steps by {step:.6g} mm at {before.right.x:.12g}°; allowed: no step"
                )
        breaks, columns = [], []
        for segment in self.segments:
            parts, ordinates = segment.pieces()
            span = segment.right.x - segment.left.x
            breaks += [(segment.left.x + span * u) * (TURN / TURN_DEG) for u in parts[:-1]]
            columns += [MM * column for column in ordinates]
        breaks.append(breaks[0] + TURN)
        if breaks[0] != 0.0:
            breaks, columns = rotate_to_zero((breaks, columns), TURN)
        breaks[-1] = TURN
        return Law(self.name, np.array(breaks), join_pieces(columns))

"""Cam of a controller for the law of a cam: named rises, quintic segments and their joints.

The joints of the law are always breaks. A named rise is one segment if the controller has its
motion function. The other pieces are quintic segments with the lift, velocity and acceleration of
the law at their ends.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum
from itertools import pairwise

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.laws import bernstein
from cam_rig.laws.cam import segment_angles
from cam_rig.laws.law import JUMP_RTOL, Law, peak
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Rise
from cam_rig.studies.electronic.controller import (
    MM,
    TURN_DEG,
    Boundary,
    ControllerCam,
    ControllerSegment,
    SegmentKind,
)
from cam_rig.studies.electronic.difference import JOINT_ATOL_RAD, ORDERS
from cam_rig.studies.electronic.segmentation import Tolerances, feasibility, fewest_segments
from cam_rig.units import TURN

#: Width (deg) over which s'' moves linearly through a jump, for a controller whose segments share
#: their boundaries. The lift is off by less than a thousandth of a µm there.
BRIDGE_DEG = 0.005
#: Largest width of a bridge as a fraction of the segments next to it.
MAX_BRIDGE_PART = 0.1
#: Number of digits of written numbers. Such a number is read and written again unchanged.
DIGITS = 15
#: Number of decimals of written master positions, deg.
MASTER_DECIMALS = 12
#: Smallest stroke of a segment, as a fraction of the lift, by which coefficients are normalised.
MIN_STROKE = 0.01


class Target(Enum):
    """Form of a text for a controller."""

    CODESYS = "codesys"  #: array of SMC_CAMXYVA
    CODESYS_BUILDER = "codesys_builder"  #: segments of CamBuilder
    TWINCAT = "twincat"  #: array of MC_MotionFunctionPoint
    TWINCAT_MC3 = "twincat_mc3"  #: array of MotionFunctionPoint
    VDI2143 = "vdi2143"  #: normalised coefficients as CSV

    @property
    def shares_boundaries(self) -> bool:
        """True if adjacent segments have one common boundary, so that s'' cannot jump."""
        return self not in (Target.CODESYS_BUILDER, Target.VDI2143)

    @property
    def has_lines(self) -> bool:
        """True if the controller has lines that meet their neighbours at a corner."""
        return self not in (Target.CODESYS, Target.VDI2143)

    @property
    def named_kinds(self) -> dict[str, SegmentKind]:
        """Kind of the segment that equals a named rise, by the name of the rise."""
        kinds = {"poly345": SegmentKind.POLY5, "bezier5": SegmentKind.POLY5}
        if not self.has_lines:
            return kinds
        return kinds | {
            "poly4567": SegmentKind.POLY7,
            "bezier7": SegmentKind.POLY7,
            "cycloidal": SegmentKind.INCLINED_SINE,
            "modified_sine": SegmentKind.MODIFIED_SINE,
        }


def written(value: float) -> float:
    """Return a number as it is written, with `DIGITS` digits and no negative zero."""
    return float(f"{value:.{DIGITS}g}") + 0.0


def boundary(law: Law, piece: int, u: float) -> Boundary:
    """Return the boundary of a segment at the position u from 0 to 1 within a piece."""
    scale = TURN / TURN_DEG
    x = (law.breaks[piece] + law.spans[piece] * u) / scale
    rows = (law.derivative_ordinates(order)[:, piece] for order in range(ORDERS))
    values = [float(bernstein.evaluate(row, np.array([u]))[0]) for row in rows]
    scaled = (written(value * scale**order / MM) for order, value in enumerate(values))
    return Boundary(round(float(x), MASTER_DECIMALS), *scaled)


def controller_cam(
    cam: CamConfig, law: Law, target: Target, tolerances: Tolerances | None = None
) -> ControllerCam:
    """Return the segments of a controller for a cam.

    Parameters
    ----------
    cam : CamConfig
        Cam, whose named rises pass exactly if the controller has them.
    law : Law
        Law of the cam.
    target : Target
        Form of the text.
    tolerances : Tolerances, optional
        Largest errors of the other segments (default: 0.002 µm, and 0.1 % of the peak of
        s'').

    Raises
    ------
    ConfigError
        If the velocity jumps at a joint that the target cannot pass, or the errors need too many
        segments.
    """
    tolerances, corners = tolerances or Tolerances(), set(law.velocity_jumps)
    segments: list[ControllerSegment] = []
    named, piece, count = _named_pieces(cam, law, target), 0, law.spans.size
    while piece < count:
        stop, kind = named.get(piece, (piece + 1, SegmentKind.POLY5))
        has_corner = piece in corners or stop % count in corners
        if piece in named and not has_corner:
            ends = [boundary(law, piece, 0.0), boundary(law, stop - 1, 1.0)]
            segments.append(ControllerSegment(kind, *(Boundary(end.x, end.y) for end in ends)))
        elif has_corner:
            stop = piece + 1
            segments.append(_line(law, piece, target))
        else:
            breaks = fewest_segments(feasibility(law, piece, tolerances))
            pairs = pairwise([boundary(law, piece, u) for u in breaks])
            segments += [ControllerSegment(kind, *pair) for pair in pairs]
        piece = stop
    acceleration_limit = JUMP_RTOL * abs(peak(law, 2).value) * (TURN / TURN_DEG) ** 2 / MM
    joined = _join(segments, target, acceleration_limit)
    if target is Target.VDI2143:
        joined = [_normalised(segment, law.lift / MM) for segment in joined]
    return ControllerCam(cam.name, tuple(joined))


def _named_pieces(cam: CamConfig, law: Law, target: Target) -> dict[int, tuple[int, SegmentKind]]:
    """Return the first piece of each named rise that the target has -> end and kind of segment.

    A rise between neighbours with s'' ≠ 0 is left out if they share their boundaries with it.
    """
    found = {}
    limit = JUMP_RTOL * abs(peak(law, 2).value)
    jumps = np.abs(law.jumps(2)) > limit
    for segment, start in zip(cam.segments, segment_angles(cam), strict=True):
        if (
            isinstance(segment, Rise)
            and segment.shaping is None
            and segment.law in target.named_kinds
        ):
            ends = start, start + segment.span.si
            first, stop = (int(np.abs(law.breaks - angle).argmin()) for angle in ends)
            near = np.abs(law.breaks[[first, stop]] - ends).max() < JOINT_ATOL_RAD
            if near and not (jumps[first] or jumps[stop % jumps.size]):
                found[first] = stop, target.named_kinds[segment.law]
    return found


def _line(law: Law, piece: int, target: Target) -> ControllerSegment:
    """Return a straight piece next to a velocity jump as a line.

    Raises
    ------
    ConfigError
        If the piece is not straight, or the target has no lines.
    """
    left, right = boundary(law, piece, 0.0), boundary(law, piece, 1.0)
    chord = np.linspace(left.y, right.y, law.degree + 1) * MM
    is_straight = np.abs(law.ordinates[:, piece] - chord).max() <= JUMP_RTOL * law.lift
    if not (target.has_lines and is_straight):
        jumps = ", ".join(f"{math.degrees(law.joints[i]):g}°" for i in law.velocity_jumps)
        lines = ", ".join(item.value for item in Target if item.has_lines)
        raise ConfigError(
            f"cam {law.name!r}: the velocity jumps at {jumps}, which target {target.value} cannot "
            f"pass; allowed: a law without velocity jumps, or straight pieces on target {lines}"
        )
    return ControllerSegment(SegmentKind.LINE, left, right)


# Joints of the segments.


def _join(
    segments: list[ControllerSegment], target: Target, acceleration_limit: float
) -> list[ControllerSegment]:
    """Return the segments with equal numbers on both sides of each joint.

    A jump of s'' above ``acceleration_limit`` (mm/deg²) is kept if the target allows it. Otherwise
    s'' moves through it on a bridge, of two segments that meet at the joint.
    """
    bridges: dict[int, tuple[ControllerSegment, ControllerSegment]] = {}
    segments = list(segments)
    for k in range(len(segments)):
        before, after = segments[k - 1], segments[k]
        left, right = before.right, after.left
        if before.kind is after.kind is SegmentKind.LINE:
            ends = (Boundary(left.x, right.y), Boundary(right.x, right.y))
        elif abs(right.a - left.a) <= acceleration_limit:
            v, a = (min(pair, key=abs) for pair in ((left.v, right.v), (left.a, right.a)))
            ends = (Boundary(left.x, right.y, v, a), Boundary(right.x, right.y, v, a))
        else:
            v = min(left.v, right.v, key=abs)
            ends = (left._replace(y=right.y, v=v), right._replace(v=v))
        segments[k - 1] = replace(before, right=ends[0])
        segments[k] = replace(segments[k], left=ends[1])
        if target.shares_boundaries and ends[0].a != ends[1].a:
            segments[k - 1], segments[k], bridges[k] = _bridge(segments[k - 1], segments[k])
    joined = [bridges[0][1]] if 0 in bridges else []
    for k, segment in enumerate(segments):
        joined += [*(bridges[k] if k and k in bridges else ()), segment]
    return joined + ([bridges[0][0]] if 0 in bridges else [])


def _bridge(
    before: ControllerSegment, after: ControllerSegment
) -> tuple[ControllerSegment, ControllerSegment, tuple[ControllerSegment, ControllerSegment]]:
    """Return two segments shortened by a bridge over their joint, and its two halves.

    s'' is linear on the bridge, so it does not overshoot. The end of the bridge at a dwell is that
    of the dwell, and the other end is moved to it.
    """
    spans = (segment.right.x - segment.left.x for segment in (before, after))
    half = round(0.5 * min(BRIDGE_DEG, MAX_BRIDGE_PART * min(spans)), MASTER_DECIMALS)
    joint, start = before.right.x, after.left.x
    left, right = _state(before, joint - half), _state(after, start + half)
    width, mean = 2.0 * half, 0.5 * (left.a + right.a)
    if after.left.y == after.right.y and after.left.v == after.left.a == 0.0:
        v = right.v - width * mean
        y = right.y - width * v - width**2 * (2.0 * left.a + right.a) / 6.0
        left = left._replace(y=written(y), v=written(v))
    else:
        y = left.y + width * left.v + width**2 * (2.0 * left.a + right.a) / 6.0
        right = right._replace(y=written(y), v=written(left.v + width * mean))
    v = left.v + 0.5 * half * (left.a + mean)
    y = left.y + half * left.v + half**2 * (2.0 * left.a + mean) / 6.0
    middle = Boundary(joint, written(y), written(v), written(mean))
    halves = (
        ControllerSegment(SegmentKind.POLY5, left, middle),
        ControllerSegment(SegmentKind.POLY5, middle._replace(x=start), right),
    )
    return replace(before, right=left), replace(after, left=right), halves


def _state(segment: ControllerSegment, x: float) -> Boundary:
    """Return the boundary of a quintic segment at a master position (deg) within it."""
    span = segment.right.x - segment.left.x
    rows, scale = segment.pieces()[1][0], 1.0
    values = []
    for _ in range(ORDERS):
        value = bernstein.evaluate(rows, np.array([(x - segment.left.x) / span]))[0]
        values.append(written(float(value) / scale))
        rows, scale = bernstein.derivative(rows), scale * span
    return Boundary(round(x, MASTER_DECIMALS), *values)


def _normalised(segment: ControllerSegment, lift: float) -> ControllerSegment:
    """Return a segment by its coefficients, normalised by its stroke, or the lift (mm).

    The lift is used if the stroke is small.
    """
    stroke = written(segment.right.y - segment.left.y)
    if abs(stroke) < MIN_STROKE * lift:
        stroke = written(lift)
    ordinates = (segment.pieces()[1][0] - segment.left.y) / stroke
    degree = ordinates.size - 1
    powers = [
        math.comb(degree, k)
        * sum((-1.0) ** (k - i) * math.comb(k, i) * float(ordinates[i]) for i in range(k + 1))
        for k in range(degree + 1)
    ]
    coefficients = (stroke, *(written(power) for power in powers))
    return replace(segment, kind=SegmentKind.COEFFICIENTS, coefficients=coefficients)

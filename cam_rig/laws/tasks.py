"""Motions between given ends, and the tasks of segments: rest, constant velocity, reversal.

The letters of the ends are those of VDI 2143: R rest, G constant velocity, U reversal, B motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import Pieces
from cam_rig.laws.law import Law, joints
from cam_rig.laws.sampling import fit_curve, wave
from cam_rig.schema import CamConfig
from cam_rig.schema.motions import JoiningMotion
from cam_rig.units import FloatArray

# Motions between ends. An end is s, s', s'' and, for degree 7, s''' by u from 0 to 1.


@lru_cache(maxsize=1)
def _terms() -> FloatArray:
    """Return the ordinates of the terms of combinations on two halves of a span.

    The shape is ``(term, half, ordinate)``. The terms are u, u − sin(πu)/π, u − sin(2πu)/2π and
    1 − cos kπu for k of 1, 2, 3.
    """
    pi = math.pi
    waves = [wave(0.0, 1.0, 0.0, 0.0, 0.0), wave(0.0, 1.0, 1.0 / pi, pi, 0.0)]
    waves += [wave(0.0, 1.0, 0.5 / pi, 2.0 * pi, 0.0)]
    waves += [wave(1.0, 0.0, 1.0, k * pi, 0.5 * pi) for k in (1, 2, 3)]
    return np.array([[fit_curve(term, a, a + 0.5)[1][0] for a in (0.0, 0.5)] for term in waves])


def combination(law: str, start: Sequence[float], end: Sequence[float]) -> Pieces:
    """Return the pieces of a combination of waves between two ends, over u from 0 to 1.

    Half a wave of the acceleration leads from one velocity to the other. Waves with zero velocity
    at the ends add the remaining rise: a whole sine of the acceleration for the law
    ``sine_line_combination``, which has none at its ends, otherwise three cosines that also have
    the accelerations of the ends.
    """
    (level, v0, a0), (top, v1, a1) = start, end
    rise = top - level - 0.5 * (v0 + v1)
    if law == "sine_line_combination":
        sizes = [v0, 0.5 * (v1 - v0), rise, 0.0, 0.0, 0.0]
    else:
        third = ((a0 - a1) / (2.0 * math.pi**2) - 0.5 * rise) / 8.0
        second = (a0 + a1) / (8.0 * math.pi**2)
        sizes = [v0, 0.5 * (v1 - v0), 0.0, 0.5 * rise - third, second, third]
    return [0.0, 0.5, 1.0], list(level + np.tensordot(sizes, _terms(), axes=1))


def motion_between(law: str, start: Sequence[float], end: Sequence[float]) -> Pieces:
    """Return the pieces of a motion between two ends, over u from 0 to 1."""
    if law in ("poly5", "poly7"):
        return [0.0, 1.0], [bernstein.hermite(np.array(start), np.array(end))]
    return combination(law, start, end)


# Ends that segments take from their neighbours.

#: Names of the derivatives of an end, by order, as keys of a file.
QUANTITIES = ("level", "velocity", "acceleration", "jerk")
#: Names of the two ends, as keys of a file.
SIDES = ("start", "end")
#: Largest relative difference of two derivatives at a joint that is rounding. It is relative to the
#: larger one, or to that of the lift over the span.
END_RTOL = 1e-9


def join_motions(
    cam: CamConfig, pieces: Sequence[Pieces | None], levels: Sequence[tuple[float, float]]
) -> list[Pieces]:
    """Return the pieces (rad, m) of all segments, with the ends of motions taken over.

    Parameters
    ----------
    cam : CamConfig
        The cam.
    pieces : sequence of Pieces or None
        Pieces of each segment, None for a motion whose ends depend on its neighbours.
    levels : sequence of tuple of float
        Levels of start and end of each segment, m.

    Returns
    -------
    list of Pieces
        Pieces of each segment, from angle 0.

    Raises
    ------
    LawError
        If an end is open or contradictory, or the law cannot have it.
    """
    joined = list(pieces)
    # Polynomials of degree 7 come last, because they take over the jerk of the other motions.
    for is_last in (False, True):
        for i, segment in enumerate(cam.segments):
            if isinstance(segment, JoiningMotion) and (segment.law == "poly7") == is_last:
                joined[i] = _join(cam, joined, i, segment, levels[i])
    return [piece for piece in joined if piece is not None]


def _join(
    cam: CamConfig,
    pieces: list[Pieces | None],
    i: int,
    segment: JoiningMotion,
    levels: tuple[float, float],
) -> Pieces:
    """Return the pieces of the motion of segment i between its two levels (m)."""
    span, orders = segment.span.si, range(1, 4 if segment.law == "poly7" else 3)
    ends = [
        [_end_value(cam, pieces, i, is_end, order) for order in orders] for is_end in (False, True)
    ]
    for (_, acceleration, *_), side in zip(ends, SIDES, strict=True):
        noise = END_RTOL * cam.lift.si / span**2
        if segment.law == "sine_line_combination" and abs(acceleration) > noise:
            raise LawError(
                f"cam {cam.name!r}: segments[{i}] has the acceleration "
                f"{acceleration * 1e3:.6g} mm/rad^2 at its {side}; allowed for {segment.law}: 0, "
                "so use harmonic_combination or poly5"
            )
    scaled = (
        [level, *(value * span**order for value, order in zip(end, orders, strict=True))]
        for level, end in zip(levels, ends, strict=True)
    )
    breaks, columns = motion_between(segment.law, *scaled)
    return [span * u for u in breaks], columns


def _end_value(
    cam: CamConfig, pieces: list[Pieces | None], i: int, is_end: bool, order: int
) -> float:
    """Return a derivative (m/rad^order) at an end of segment i.

    It is that of the segment's file, or that of the neighbour.
    """
    j, quantity = (i + (1 if is_end else -1)) % len(cam.segments), QUANTITIES[order]
    own, other = _stated(cam, i, is_end, order), _stated(cam, j, not is_end, order)
    neighbour = pieces[j]
    built = None if neighbour is None else end_derivative(neighbour, not is_end, order)
    names = f"segments[{i}].{SIDES[is_end]}", f"segments[{j}].{SIDES[not is_end]}"
    value = next((x for x in (own, other, built) if x is not None), None)
    if value is None:
        raise LawError(
            f"cam {cam.name!r}: {names[0]} and {names[1]} are both without {quantity}; allowed: "
            f"one value for the joint, so give {names[0]}.{quantity}"
        )
    # A velocity must be that of the neighbour. Another acceleration is a step that the user wants.
    expected = built if other is None and order == 1 else other
    noise = cam.lift.si / cam.segments[i].span.si ** order
    limit = END_RTOL * max(abs(value), abs(expected or 0.0), noise)
    if expected is not None and abs(value - expected) > limit:
        unit = f"mm/rad{'' if order == 1 else f'^{order}'}"
        raise LawError(
            f"cam {cam.name!r}: {names[0]}.{quantity} is {value * 1e3:.6g} {unit}, {names[1]} has "
            f"{expected * 1e3:.6g} {unit}; allowed: the same, so remove one of them"
        )
    return value


def _stated(cam: CamConfig, i: int, is_end: bool, order: int) -> float | None:
    """Return the derivative that the file states for an end of segment i, None if open."""
    segment = cam.segments[i]
    end = getattr(segment, SIDES[is_end]) if isinstance(segment, JoiningMotion) else None
    number = getattr(end, QUANTITIES[order], None)
    return None if number is None else float(number.si)


def end_derivative(pieces: Pieces, is_end: bool, order: int) -> float:
    """Return a derivative (m/rad^order) at the start or the end of pieces (rad, m)."""
    breaks, columns = pieces
    ordinates = columns[-1 if is_end else 0]
    span = breaks[-1] - breaks[-2] if is_end else breaks[1] - breaks[0]
    for _ in range(order):
        ordinates = bernstein.derivative(ordinates) / span
    return float(ordinates[-1 if is_end else 0])


# Tasks of the segments of a law.

#: Largest derivative at an end that counts as zero, as a fraction of its peak over the turn.
REST_RTOL = 1e-6
#: Letter of an end, by the presence of velocity and acceleration.
LETTERS: dict[tuple[bool, ...], str] = {
    (False, False): "R",
    (True, False): "G",
    (False, True): "U",
    (True, True): "B",
}


@dataclass(frozen=True)
class SegmentTask:
    """Task of a segment, such as "R-G", with its place in the turn.

    A task is the pair of conditions at the ends of a segment, by the letters of VDI 2143: R (rest,
    a dwell), G (constant velocity), U (reversal) and B (general motion).

    Parameters
    ----------
    cam, law : str
        Names of the cam and of the segment's law.
    index : int
        Index of the segment in the file.
    start, span : float
        Cam angle of its start, and its span, rad.
    rise : float
        Change of the lift, m.
    task : str
        Letters of both ends.
    continuity : int
        Order of the highest continuous derivative of the lift at its start, at most 4.
    """

    cam: str
    law: str
    index: int
    start: float
    span: float
    rise: float
    task: str
    continuity: int


def segment_tasks(cam: CamConfig, law: Law) -> Iterator[SegmentTask]:
    """Yield the tasks of the segments of a cam with its law, in order."""
    motion, limits = law.motion, [REST_RTOL * bound for bound in law.bounds]
    classes, start = joints(law), 0.0
    for i, segment in enumerate(cam.segments):
        span = segment.span.si
        first, last = (int(np.abs(law.breaks - x).argmin()) for x in (start, start + span))
        ends = motion[:, 0, first], motion[:, -1, last - 1]
        letters = (LETTERS[tuple(bool(x) for x in (np.abs(end) > limits)[1:])] for end in ends)
        rise, order = float(ends[1][0] - ends[0][0]), classes[first].continuity
        yield SegmentTask(cam.name, segment.law, i, start, span, rise, "-".join(letters), order)
        start += span

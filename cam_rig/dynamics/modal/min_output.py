"""Least output of a vibration mode over a run at one cam speed, by branch and bound.

The output, for example the contact force, is searched piece by piece of the law's polynomials. A
piece is skipped if a lower bound of the output in it is not below the least value found so far. Two
lower bounds are used: the smallest forced response less the whole vibration (19), and the chord
between the values at both ends less its error (20). Otherwise the piece is cut into parts, and
parts are cut again, until the bound (22) of each part is within the tolerance. In a run of several
turns, (21) derives a bound for all turns from the last turn.

Numbers in brackets are those of docs/proofs.md, part 2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.events.contact import StemVibration
from cam_rig.dynamics.modal.motion import (
    LawSeries,
    Oscillator,
    OscillatorMotion,
    VibrationNorm,
    amplitude,
    apply_flow,
    flow_over,
    forced_vibration,
    read_flow,
)
from cam_rig.laws.polynomials import weight_ordinates, weighted_value
from cam_rig.laws.vectors import Records, Vector, index_at
from cam_rig.units import TURN

#: Number of equal parts into which a polynomial piece of the law, or a part of it, is cut in the
#: search.
CUTS = 4
#: Tolerance of the least output, relative to the sum of its largest forced and free terms: 450
#: times the float epsilon.
MIN_RTOL = 1e-13
#: Smallest width of a part of a polynomial piece that is cut again, as a fraction of the piece. In
#: a narrower part rounding decides the result.
MIN_PART_WIDTH = 2.0**-50
#: Size of the stack of parts of a polynomial piece that wait to be cut. The depth is at most 25
#: cuts (by `CUTS` down to `MIN_PART_WIDTH`), and fewer than `CUTS` parts wait at each depth.
MAX_PARTS = 160

#: Record of one part of a polynomial piece of the law, with the free vibration at its start.
PART = np.dtype(
    [
        ("start", "f8"),  # cam angle from the start of the piece to the start of the part, rad
        ("width", "f8"),  # cam angle that the part covers, rad
        ("displacement", "f8"),  # η of the free vibration at the start of the part, m
        ("velocity", "f8"),  # η̇ of the free vibration at the start of the part, m/s
        ("bound", "f8"),  # lower bound (22) of the output in the part
    ],
    align=True,
)


class MinOutput(NamedTuple):
    """Least output of a mode in a range of a run, and the cam angle at which it occurs.

    The output is, for example, the contact force.
    """

    value: float  #: least output, in the unit of the output (N for a contact force)
    angle: float  #: cam angle of the least output, from the start of the run, rad
    evaluations: int  #: number of evaluations of the output that the search needed


class SearchRange(NamedTuple):
    """Range of cam angles in which the least output is searched for, and the tolerance."""

    start: float  #: first cam angle of the range, from the start of the run, rad
    end: float  #: last cam angle of the range, from the start of the run, rad
    rtol: float  #: relative tolerance of the least output


def find_min_output(
    law: LawSeries,
    mode: Oscillator,
    motion: OscillatorMotion,
    search: SearchRange,
    floors: Vector,
) -> MinOutput:
    """Find the least output in a range of cam angles of a run at one speed.

    The output of the mode is, for example, the contact force. ``motion`` is the motion at that
    speed. ``floors`` ``(g,)`` has one number per group of adjacent polynomial pieces of the law.
    Each is lowered in place to a lower bound of the output in its group, over all turns of the
    range.

    Invariant: in the pieces searched so far no output is below ``result`` by more than the
    tolerance.
    """
    parts, starts = np.zeros(MAX_PARTS, PART), motion.piece_starts
    turn = int(search.start // TURN)
    end_turn = min(len(motion.turn_starts), int(search.end // TURN) + 1)
    first, end = 0, len(starts)
    if end_turn - turn == 1:
        first = index_at(law.breaks, search.start - turn * TURN)
        end = min(end, 1 + index_at(law.breaks, search.end - turn * TURN))
    result, lowest_piece, group = MinOutput(math.inf, search.start, end - first), first, 0
    turn_difference = _turn_difference(motion, turn, end_turn)
    for i in range(first, end):
        if starts[i]["floor"] < starts[lowest_piece]["floor"]:
            lowest_piece = i
    if first < end:
        result = _search_turns(
            law, mode, motion, search, lowest_piece, turn, end_turn, parts, result
        )
    for i in range(first, end):
        while i >= law.first_pieces[group + 1]:
            group += 1
        floor = starts[i]["floor"]
        threshold = _threshold(result.value, MIN_RTOL * motion.max_forced[i], search.rtol)
        if floor < threshold:
            if end_turn - turn > 1:  # bound (21) of all turns from the last turn
                chord = _bound_by_chord(law, mode, motion, i, free_at(motion, i, end_turn - 1))
                floor = max(floor, chord - turn_difference * starts[i]["remainder"])
            if i != lowest_piece and floor < threshold:
                result = _search_turns(law, mode, motion, search, i, turn, end_turn, parts, result)
            floor = max(floor, result.value - search.rtol * abs(result.value))
        floors[group] = min(floors[group], floor)
    return result


def _threshold(value: float, atol: float, rtol: float) -> float:
    """Return the output below which a range of the run must be searched further.

    A range is skipped if a lower bound of the output in it is not below this threshold. ``value``
    is the least output found so far. The threshold is below it by the larger of the absolute and
    the relative tolerance, ``atol`` and ``rtol``.
    """
    return value if value == math.inf else value - max(atol, rtol * abs(value))


def _turn_difference(motion: OscillatorMotion, first: int, end: int) -> float:
    """Return an upper bound of the difference of the output between turns (21).

    The output of the mode is, for example, the contact force. The joints between pieces of the law
    excite the same vibration in each turn, so turns differ only by the free vibration at their
    start, which fades. The bound is R max N, where N is the norm of the difference between the free
    vibrations at the start of a turn and of the last turn, and R is the largest output per unit of
    N. The turns are ``first`` to ``end`` − 1, which is the last one. The number in brackets is that
    of docs/proofs.md.
    """
    max_norm, x = 0.0, motion.turn_starts[end - 1]
    for turn in range(first, end - 1):
        start = motion.turn_starts[turn]
        difference = StemVibration(
            start["displacement"] - x["displacement"], start["velocity"] - x["velocity"]
        )
        max_norm = max(max_norm, amplitude(motion.norm, difference))
    return motion.norm.reach * max_norm


def free_at(motion: OscillatorMotion, piece: int, turn: int) -> StemVibration:
    """Return the free vibration (η, η̇) at the start of a piece of the law in one turn.

    ``piece`` and ``turn`` are indices from 0.
    """
    flow, x = motion.piece_starts[piece], motion.turn_starts[turn]
    eta, rate = x["displacement"], x["velocity"]
    return StemVibration(
        flow["eta_eta"] * eta + flow["eta_rate"] * rate + flow["displacement"],
        flow["rate_eta"] * eta + flow["rate_rate"] * rate + flow["velocity"],
    )


def _search_turns(
    law: LawSeries,
    mode: Oscillator,
    motion: OscillatorMotion,
    search: SearchRange,
    piece: int,
    first_turn: int,
    end_turn: int,
    parts: Records,
    result: MinOutput,
) -> MinOutput:
    """Search one polynomial piece of the law for an output lower than ``result``.

    The output of the mode is, for example, the contact force. The piece is searched in each turn
    from ``first_turn`` up to, but not including, ``end_turn``. ``parts`` is work space. Returns the
    lower output, or ``result`` if there is none, with the number of evaluations added.
    """
    span = law.breaks[piece + 1] - law.breaks[piece]
    for turn in range(first_turn, end_turn):
        angle = turn * TURN + law.breaks[piece]
        start, end = max(0.0, search.start - angle), min(span, search.end - angle)
        if end < start or end <= 0.0:
            continue
        free = free_at(motion, piece, turn)
        reach = motion.norm.reach * amplitude(motion.norm, free)
        atol = MIN_RTOL * (motion.max_forced[piece] + reach)
        threshold = _threshold(result.value, atol, search.rtol)
        if motion.min_forced[piece] - reach < threshold and (
            _bound_by_chord(law, mode, motion, piece, free) < threshold
        ):
            if start > 0.0:
                free = apply_flow(flow_over(mode, start / motion.speed), free)
            part = parts[0]
            part["start"], part["width"], part["bound"] = start, end - start, -math.inf
            part["displacement"], part["velocity"] = free.displacement, free.velocity
            result = _search_parts(
                law, mode, motion, search.rtol, atol, piece, angle, parts, result
            )
    return MinOutput(result.value, result.angle, result.evaluations + end_turn - first_turn)


def _bound_by_chord(
    law: LawSeries, mode: Oscillator, motion: OscillatorMotion, piece: int, free: StemVibration
) -> float:
    """Return a lower bound of the output in a piece of the law, from its chord (20).

    The chord joins the outputs at both ends of the piece. The bound is the lower of the two less
    the largest curvature times the duration squared over 8. ``free`` is the free vibration at the
    start of the piece. The output is the sum P + V of a polynomial and the free vibration. Both are
    bounded together, because in a piece that is much shorter than the period of the mode they are
    large and cancel.
    """
    forced, maxima = motion.forced, law.piece_maxima[piece]
    speed, square, rate = motion.speed, motion.speed * motion.speed, math.sqrt(mode.stiffness)
    time = (law.breaks[piece + 1] - law.breaks[piece]) / speed
    end = apply_flow(read_flow(motion.span_flows[law.span_index[piece]]), free)
    p, q, drive, cam = mode.per_displacement, mode.per_velocity, mode.drive, mode.cam
    first = forced[0][piece] + p * free.displacement + q * free.velocity
    last = forced[len(forced) - 1][piece] + p * end.displacement + q * end.velocity
    d0, d1, d2 = abs(drive.lift), abs(drive.velocity) * speed, abs(drive.acceleration) * square
    m0, m1, m2 = abs(cam.lift), abs(cam.velocity) * speed, abs(cam.acceleration) * square
    push = d0 * maxima[0] + d1 * maxima[1] + d2 * maxima[2]
    push_rate = speed * (d0 * maxima[1] + d1 * maxima[2] + d2 * maxima[3])
    x = forced_vibration(law, motion.eta_terms, speed, piece)
    eta, eta_rate = x.displacement + free.displacement, x.velocity + free.velocity
    energy = math.sqrt(mode.stiffness * eta * eta + eta_rate * eta_rate) + time * push
    acceleration = (rate + mode.damping) * energy + push
    jerk = mode.stiffness * energy + mode.damping * acceleration + push_rate
    curvature = abs(p) * acceleration + abs(q) * jerk
    curvature += square * (m0 * maxima[2] + m1 * maxima[3] + m2 * maxima[4])
    lower_bound: float = min(first, last) - 0.125 * curvature * time * time
    return lower_bound


def _max_curvature(ordinates: Vector, span: float) -> float:
    """Return an upper bound of |P''| (per rad²) of a polynomial P, by second differences.

    ``ordinates`` are the Bernstein ordinates of P, and ``span`` is the cam angle that they cover,
    rad. The bound is (6) of docs/proofs.md.
    """
    count, max_difference = len(ordinates), 0.0
    for j in range(2, count):
        second = ordinates[j] - 2.0 * ordinates[j - 1] + ordinates[j - 2]
        max_difference = max(max_difference, abs(second))
    return (count - 1) * (count - 2) * max_difference / (span * span)


def _bound_vibration(
    mode: Oscillator, norm: VibrationNorm, free: StemVibration
) -> tuple[float, float]:
    """Return upper bounds of |V| and |V̈| of the free vibration V in the output.

    The bounds are (22) of docs/proofs.md and hold from the state ``free`` on, because the norm N of
    a free vibration fades. The first is R N in the unit of the output, with the largest output R
    per unit of N. The second is R N₂ in that unit per s², with the norm N₂ of the second
    derivative.
    """
    acceleration = -mode.stiffness * free.displacement - mode.damping * free.velocity
    jerk = -mode.stiffness * free.velocity - mode.damping * acceleration
    reach = norm.reach * amplitude(norm, free)
    return reach, norm.reach * amplitude(norm, StemVibration(acceleration, jerk))


def _search_parts(
    law: LawSeries,
    mode: Oscillator,
    motion: OscillatorMotion,
    rtol: float,
    atol: float,
    piece: int,
    angle: float,
    parts: Records,
    result: MinOutput,
) -> MinOutput:
    """Search a part of a polynomial piece for an output lower than ``result``.

    The output of the mode is, for example, the contact force. The part is ``parts[0]``. The rest of
    ``parts`` is a stack of the parts that it is cut into. ``angle`` is the cam angle of the start
    of the piece, in rad from the start of the run. Returns the lower output, or ``result`` if there
    is none, with the number of evaluations added.

    Invariant: each output below the threshold lies in a part on the stack.
    """
    ordinates, norm = motion.forced[:, piece].copy(), motion.norm
    count, span = len(ordinates), law.breaks[piece + 1] - law.breaks[piece]
    forced = weight_ordinates(ordinates, count)
    curvature, inverse_square = _max_curvature(ordinates, span), 1.0 / (motion.speed * motion.speed)
    min_value, min_angle, evaluations, top = result.value, result.angle, result.evaluations, 0
    while top >= 0:
        part = parts[top]
        start, step = part["start"], part["width"] / CUTS
        free = StemVibration(part["displacement"], part["velocity"])
        bound, top = part["bound"], top - 1
        if bound >= _threshold(min_value, atol, rtol):
            continue
        flow = flow_over(mode, step / motion.speed)
        before = weighted_value(forced, count, min(1.0, start / span))
        value = before + mode.per_displacement * free.displacement
        value += mode.per_velocity * free.velocity
        eighth, evaluations = 0.125 * step * step, evaluations + CUTS
        if value < min_value:
            min_value, min_angle = value, angle + start
        for _ in range(CUTS):
            start += step
            after = weighted_value(forced, count, min(1.0, start / span))
            end = apply_flow(flow, free)
            end_value = after + mode.per_displacement * end.displacement
            end_value += mode.per_velocity * end.velocity
            if end_value < min_value:
                min_value, min_angle = end_value, angle + start
            forced_bound, total_bound = min(before, after), min(value, end_value)
            share, share_curvature = _bound_vibration(mode, norm, free)
            chord_error = eighth * (share_curvature * inverse_square)
            bound = max(forced_bound - share, total_bound - chord_error)  # lower bound (22)
            bound -= eighth * curvature
            if step > MIN_PART_WIDTH * span and bound < _threshold(min_value, atol, rtol):
                top += 1
                part = parts[top]
                part["start"], part["width"], part["bound"] = start - step, step, bound
                part["displacement"], part["velocity"] = free.displacement, free.velocity
            before, value, free = after, end_value, end
    return MinOutput(min_value, min_angle, evaluations)

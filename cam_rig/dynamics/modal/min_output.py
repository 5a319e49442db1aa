"""Least output of a mode over a run at one speed, by branch and bound.

A piece of the law is skipped if a lower bound of the output in it is not below the least value so
far: the floor (19), or the chord of the piece (20). Otherwise it is cut into parts, and parts are
cut again, until the bound (22) of each part is within the tolerance. In a run of several turns the
bound (21) covers all turns by the last one. Numbers in brackets are those of docs/proofs.md,
part 2.
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

#: Number of parts into which a part is cut.
CUTS = 4
#: Tolerance of the least value, relative to the size of the output.
MIN_RTOL = 1e-13
#: Width of a part, relative to its piece, below which it is not cut: rounding decides.
MIN_PART_WIDTH = 2.0**-50
#: Room for parts that wait: `CUTS` for each of the cuts down to `MIN_PART_WIDTH`.
MAX_PARTS = 160

#: A part of a piece.
PART = np.dtype(
    [
        ("start", "f8"),  # since the start of the piece, rad
        ("width", "f8"),  # rad
        ("displacement", "f8"),  # free η at its start
        ("velocity", "f8"),  # free η̇ at its start
        ("bound", "f8"),  # lower bound of the output in it (22)
    ],
    align=True,
)


class MinOutput(NamedTuple):
    """Least output that was evaluated."""

    value: float
    angle: float  #: since the start of the run, rad
    evaluations: int


class SearchRange(NamedTuple):
    """Part of a run that is searched, and the tolerance."""

    start: float  #: since the start of the run, rad
    end: float  #: rad
    rtol: float  #: outputs that are not found may be lower by this fraction of the least value


def find_min_output(
    law: LawSeries,
    mode: Oscillator,
    motion: OscillatorMotion,
    search: SearchRange,
    floors: Vector,
) -> MinOutput:
    """Find the least output in a range of the run.

    ``floors`` ``(g,)`` are lowered to lower bounds of the output in each group, in all turns.
    Invariant: no output in the pieces that are done is below ``result`` by more than the tolerance.
    """
    parts, starts = np.zeros(MAX_PARTS, PART), motion.piece_starts
    first = int(search.start // TURN)
    last = min(len(motion.turn_starts), int(search.end // TURN) + 1)
    begin, end = 0, len(starts)
    if last - first == 1:
        begin = index_at(law.breaks, search.start - first * TURN)
        end = min(end, 1 + index_at(law.breaks, search.end - first * TURN))
    result, lowest_piece, group = MinOutput(math.inf, search.start, end - begin), begin, 0
    turn_difference = _turn_difference(motion, first, last)
    for i in range(begin, end):
        if starts[i]["floor"] < starts[lowest_piece]["floor"]:
            lowest_piece = i
    if begin < end:
        result = _search_turns(law, mode, motion, search, lowest_piece, first, last, parts, result)
    for i in range(begin, end):
        while i >= law.first_pieces[group + 1]:
            group += 1
        floor = starts[i]["floor"]
        threshold = _threshold(result.value, MIN_RTOL * motion.max_forced[i], search.rtol)
        if floor < threshold:
            if last - first > 1:  # (21)
                chord = _bound_by_chord(law, mode, motion, i, free_at(motion, i, last - 1))
                floor = max(floor, chord - turn_difference * starts[i]["remainder"])
            if i != lowest_piece and floor < threshold:
                result = _search_turns(law, mode, motion, search, i, first, last, parts, result)
            floor = max(floor, result.value - search.rtol * abs(result.value))
        floors[group] = min(floors[group], floor)
    return result


def _threshold(value: float, atol: float, rtol: float) -> float:
    """Return the lower bound from which a piece or a part is skipped."""
    return value if value == math.inf else value - max(atol, rtol * abs(value))


def _turn_difference(motion: OscillatorMotion, first: int, last: int) -> float:
    """Return R max N of the differences between the starts of the turns and of the last one (21).

    Joints excite the same vibration in each turn. Only the vibration at the start differs, which
    fades.
    """
    largest, x = 0.0, motion.turn_starts[last - 1]
    for turn in range(first, last - 1):
        start = motion.turn_starts[turn]
        difference = StemVibration(
            start["displacement"] - x["displacement"], start["velocity"] - x["velocity"]
        )
        largest = max(largest, amplitude(motion.norm, difference))
    return motion.norm.reach * largest


def free_at(motion: OscillatorMotion, piece: int, turn: int) -> StemVibration:
    """Return the free vibration at the start of a piece in a turn."""
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
    first: int,
    last: int,
    parts: Records,
    result: MinOutput,
) -> MinOutput:
    """Return the result, or a lower output of a piece in the turns from ``first`` to ``last``."""
    span = law.breaks[piece + 1] - law.breaks[piece]
    for turn in range(first, last):
        angle = turn * TURN + law.breaks[piece]
        begin, end = max(0.0, search.start - angle), min(span, search.end - angle)
        if end < begin or end <= 0.0:
            continue
        free = free_at(motion, piece, turn)
        reach = motion.norm.reach * amplitude(motion.norm, free)
        atol = MIN_RTOL * (motion.max_forced[piece] + reach)
        threshold = _threshold(result.value, atol, search.rtol)
        if motion.min_forced[piece] - reach < threshold and (
            _bound_by_chord(law, mode, motion, piece, free) < threshold
        ):
            if begin > 0.0:
                free = apply_flow(flow_over(mode, begin / motion.speed), free)
            part = parts[0]
            part["start"], part["width"], part["bound"] = begin, end - begin, -math.inf
            part["displacement"], part["velocity"] = free.displacement, free.velocity
            result = _search_parts(
                law, mode, motion, search.rtol, atol, piece, angle, parts, result
            )
    return MinOutput(result.value, result.angle, result.evaluations + last - first)


def _bound_by_chord(
    law: LawSeries, mode: Oscillator, motion: OscillatorMotion, piece: int, free: StemVibration
) -> float:
    """Return the lower bound (20) of the output in a piece that starts with a free vibration.

    It bounds the whole motion. In a piece much shorter than the mode's period P and V are large
    and cancel.
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
    x = forced_vibration(law, motion.own, speed, piece)
    eta, eta_rate = x.displacement + free.displacement, x.velocity + free.velocity
    energy = math.sqrt(mode.stiffness * eta * eta + eta_rate * eta_rate) + time * push
    acceleration = (rate + mode.damping) * energy + push
    jerk = mode.stiffness * energy + mode.damping * acceleration + push_rate
    curvature = abs(p) * acceleration + abs(q) * jerk
    curvature += square * (m0 * maxima[2] + m1 * maxima[3] + m2 * maxima[4])
    lower_bound: float = min(first, last) - 0.125 * curvature * time * time
    return lower_bound


def _max_curvature(ordinates: Vector, span: float) -> float:
    """Return the upper bound of |P''| (1/rad²) in a piece, from the second differences (6)."""
    count, largest = len(ordinates), 0.0
    for j in range(2, count):
        second = ordinates[j] - 2.0 * ordinates[j - 1] + ordinates[j - 2]
        largest = max(largest, abs(second))
    return (count - 1) * (count - 2) * largest / (span * span)


def _bound_vibration(
    mode: Oscillator, norm: VibrationNorm, free: StemVibration
) -> tuple[float, float]:
    """Return upper bounds of |V| and |V̈| (1/s²) from a free vibration on, R N and R N₂ of (22)."""
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
    """Return the result, or a lower output of the first of ``parts``.

    Invariant: an output below the threshold is in a part that waits. The piece starts at ``angle``.
    """
    ordinates, norm = motion.forced[:, piece].copy(), motion.norm
    count, span = len(ordinates), law.breaks[piece + 1] - law.breaks[piece]
    forced = weight_ordinates(ordinates, count)
    curvature, slow = _max_curvature(ordinates, span), 1.0 / (motion.speed * motion.speed)
    lowest, position, evaluations, top = result.value, result.angle, result.evaluations, 0
    while top >= 0:
        part = parts[top]
        start, step = part["start"], part["width"] / CUTS
        free, bound, top = (
            StemVibration(part["displacement"], part["velocity"]),
            part["bound"],
            top - 1,
        )
        if bound >= _threshold(lowest, atol, rtol):
            continue
        flow = flow_over(mode, step / motion.speed)
        before = weighted_value(forced, count, min(1.0, start / span))
        value = before + mode.per_displacement * free.displacement
        value += mode.per_velocity * free.velocity
        eighth, evaluations = 0.125 * step * step, evaluations + CUTS
        if value < lowest:
            lowest, position = value, angle + start
        for _ in range(CUTS):
            start += step
            after = weighted_value(forced, count, min(1.0, start / span))
            end = apply_flow(flow, free)
            end_value = after + mode.per_displacement * end.displacement
            end_value += mode.per_velocity * end.velocity
            if end_value < lowest:
                lowest, position = end_value, angle + start
            forced_bound, total_bound = min(before, after), min(value, end_value)
            drop, bend = _bound_vibration(mode, norm, free)
            bound = max(forced_bound - drop, total_bound - eighth * (bend * slow))  # (22)
            bound -= eighth * curvature
            if step > MIN_PART_WIDTH * span and bound < _threshold(lowest, atol, rtol):
                top += 1
                part = parts[top]
                part["start"], part["width"], part["bound"] = start - step, step, bound
                part["displacement"], part["velocity"] = free.displacement, free.velocity
            before, value, free = after, end_value, end
    return MinOutput(lowest, position, evaluations)

"""Search for the lowest cam speed at which the least output of a run is zero.

The output, for example the contact force, is a function of the cam angle and of the constant cam
speed. The search increases the speed step by step. Between the two speeds of a step, the output at
each angle deviates from the straight line between its end values (the chord) by the chord error.
The least outputs at both speeds and bounds of the chord error prove one of two facts: the output is
positive in the whole step (33), (34), (36), or it becomes negative once (35). A step without a
proof is repeated with a smaller width, so no zero is stepped over (theorem B). The bounds come from
the harmonics of the law (`harmonic_error`) or from groups of its polynomial pieces (`group_error`).

Numbers in brackets are those of docs/proofs.md, part 2.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.modal.group_error import GROUP_ERROR, MIN_DIVISOR, bound_groups
from cam_rig.dynamics.modal.harmonic_error import (
    ChordError,
    bound_output,
    bound_steady,
    can_use_harmonics,
)
from cam_rig.dynamics.modal.min_output import MinOutput, SearchRange, find_min_output
from cam_rig.dynamics.modal.motion import (
    LawSeries,
    ModeOnLaw,
    Oscillator,
    OscillatorMotion,
    end_angle,
    is_resolved,
    mode_on_law,
    motion_at,
)
from cam_rig.laws.vectors import Records, Vector, min_of, without_refcount
from cam_rig.units import TURN

#: Relative tolerance of the least output while the cam speed is increased step by step. It is
#: coarse, because the proofs need only lower bounds of the output.
CLIMB_RTOL = 0.25
#: Smallest speed step, as a fraction of the speed, that is tried if the rounding error at its end
#: is too large. If this step is too large as well, the search ends with the status UNRESOLVED.
UNRESOLVED_RTOL = 1e-3
#: Shortest speed step, as a fraction of the speed. A step of this length needs no proof, because
#: rounding decides whether the output is positive.
MIN_STEP = 1e-11
#: Planned chord error of a speed step that is to be proven by bounds for groups of adjacent pieces
#: of the law. It is a fraction of the least output at the start of the step. The chord error is the
#: deviation of the output from a straight line over the speed.
GROUP_FRACTION = 0.75
#: Ratio of the next speed step to the last one, if bounds for groups of adjacent pieces of the law
#: have proven that the output is positive in the last one.
GROUP_GROWTH = 1.5
#: Largest ratio of a speed step to the step that its bounds allow. At a larger ratio the bounds,
#: which grow with the step, are computed again for a smaller step.
MAX_WIDTH_RATIO = 3.0
#: Ratio of the next speed step to the last one, if the bounds did not prove that the output is
#: positive in the last one.
SHRINK = 0.57
#: Planned chord error of a speed step that is to be proven by bounds of the law's harmonics. It is
#: a fraction of the least output at the start of the step. The chord error is the deviation of the
#: output from a straight line over the speed.
HARMONIC_FRACTION = 0.6
#: Safety factor for the width of a speed step. It applies if bounds of the law's harmonics failed
#: to prove the last step.
HARMONIC_SAFETY = 0.93
#: Largest ratio of the next speed step to the last one, if bounds of the law's harmonics have
#: proven that the output is positive in the last one.
MAX_GROWTH = 2.0
#: Relative tolerance of the least output while the speed of its zero is refined.
ZERO_RTOL = 1e-4
#: Relative distance above the speed of the zero at which the first turn with a negative output is
#: determined. All turns whose output becomes negative within this distance count as negative at the
#: same speed.
SAME_SPEED_RTOL = 5e-6
#: Relative width at which the range of speeds that contains the zero is narrow enough: 45 times the
#: float epsilon.
BRACKET_RTOL = 1e-14
#: Distance (rad) on both sides of the cam angle of a negative output. While the speed of the zero
#: is refined, the output is considered only within this distance.
NEIGHBOURHOOD = TURN / 64.0
#: Largest number of iterations in a refinement of the speed of the zero. The limit prevents an
#: endless loop.
MAX_REFINEMENTS = 200


class ClimbStatus(IntEnum):
    """Result of a climb, the search that increases the cam speed until the output is zero."""

    FOUND = 0  #: the least output is zero at ``Climb.speed``
    NEGATIVE = 1  #: the least output is not positive at the first speed
    POSITIVE = 2  #: the least output is positive up to the last speed
    UNRESOLVED = 3  #: positive up to a speed above which the rounding error is too large
    PAUSED = 4  #: positive up to ``Climb.low``, where the allowed evaluations were used up


class StepKind(IntEnum):
    """Kind of bounds that are to prove that the output is positive in a speed step."""

    HARMONICS = 0  #: bounds by the harmonics of the law, from `harmonic_error`
    GROUPS = 1  #: bounds by groups of the law's polynomial pieces, from `group_error`
    RETRY = 2  #: neither kind is sufficient: plan a step of the returned width


class Climb(NamedTuple):
    """State or result of a climb, the search that increases the cam speed step by step.

    A paused climb is continued from its fields ``low`` and ``step``.
    """

    status: int  #: result of the search, a `ClimbStatus`
    low: float  #: cam speed (rad/s) up to which the output is proven positive
    step: float  #: next speed step, as a fraction of the speed
    speed: float  #: cam speed at which the least output is zero if FOUND, else ``low``, rad/s
    #: Cam angle of the least output if FOUND or NEGATIVE, rad from the start of the run, else 0.
    angle: float
    #: If FOUND: cam angle of the least output in the first turn with a negative output, at a speed
    #: `SAME_SPEED_RTOL` above the zero, rad from the start of the run. Else equal to ``angle``.
    first_angle: float


class Zero(NamedTuple):
    """Cam speed at which the least output of a run is zero, and its cam angle.

    The output is, for example, the contact force.
    """

    speed: float  #: cam speed, rad/s
    angle: float  #: cam angle of the least output, rad from the start of the run


class Bracket(NamedTuple):
    """Cam speeds between which the least output of a run becomes zero.

    The output is, for example, the contact force.
    """

    low: float  #: speed at which the least output is positive, rad/s
    high: float  #: speed at which the least output is not positive, rad/s
    angle: float  #: cam angle of the least output at ``high``, rad from the start of the run


class Step(NamedTuple):
    """Planned step of the cam speed, and the bounds that are to prove it.

    A step is proven if the output is proven to stay positive in it.
    """

    kind: int  #: kind of the bounds, a `StepKind`
    width: float  #: difference of the cam speeds at the ends of the step, rad/s
    error: ChordError  #: chord error of the complex amplitude q, used if the kind is HARMONICS


def climb(
    law: LawSeries, mode: Oscillator, low: float, step: float, last: float, max_evaluations: float
) -> Climb:
    """Increase the cam speed until the least output over the run is zero.

    The output of the mode is, for example, the contact force. The search starts at ``low`` and
    stops at ``last`` (both in rad/s) at the latest, or after ``max_evaluations`` evaluations of the
    output. ``step`` is the first speed step as a fraction of the speed.

    Invariant: the output is positive at all speeds from the start of the search to the present
    speed (theorem B of docs/proofs.md).
    """
    run, count = mode_on_law(without_refcount(law), mode), len(law.first_pieces) - 1
    if not is_resolved(run, low):
        return Climb(ClimbStatus.UNRESOLVED, low, step, low, 0.0, 0.0)
    errors, margins = np.zeros(count, GROUP_ERROR), np.zeros(count)
    floors, next_floors = np.zeros(count), np.zeros(count)
    motion = motion_at(run, low)
    minimum = _find_floors(run, motion, floors)
    if minimum.value <= 0.0:
        return Climb(ClimbStatus.NEGATIVE, low, step, low, minimum.angle, minimum.angle)
    evaluations = float(minimum.evaluations)
    while low < last:
        high = min(low * (1.0 + step), last)
        if not is_resolved(run, high):
            if step < UNRESOLVED_RTOL:
                return Climb(ClimbStatus.UNRESOLVED, low, step, low, 0.0, 0.0)
            step *= 0.5
            continue
        kind, width, error = _plan_step(run, motion, floors, high, errors)
        min_width = MIN_STEP * low
        width = max(width, min_width)
        if kind == StepKind.RETRY and width > min_width:
            step = width / low
            continue
        high = high if kind == StepKind.HARMONICS else low + width
        evaluations += _find_margins(run, motion, high, floors, margins)
        evaluations += len(law.span_index) * len(run.series.eta)
        next_motion = motion_at(run, high)
        minimum = _find_floors(run, next_motion, next_floors)
        evaluations += minimum.evaluations
        if kind == StepKind.HARMONICS:
            error = bound_output(run, motion, error, next_motion.steady_start, high)
            is_proven, factor = _prove_by_harmonics(error, min_of(margins), min_of(next_floors))
        else:
            forced, next_forced = motion.group_min_forced, next_motion.group_min_forced
            is_proven = _prove_by_groups(errors, margins, next_floors, forced, next_forced, width)
            factor = GROUP_GROWTH if is_proven else SHRINK
        step = factor * width / low
        if not is_proven and width > min_width:
            continue
        if minimum.value <= 0.0:
            zero = _find_zero(run, Bracket(low, high, minimum.angle))
            first = _find_first_turn(run, min(high, zero.speed * (1.0 + SAME_SPEED_RTOL)), zero)
            return Climb(ClimbStatus.FOUND, low, step, zero.speed, zero.angle, first)
        low, motion, floors, next_floors = high, next_motion, next_floors, floors
        if evaluations > max_evaluations:
            return Climb(ClimbStatus.PAUSED, low, step, low, 0.0, 0.0)
    return Climb(ClimbStatus.POSITIVE, low, step, low, 0.0, 0.0)


def _plan_step(
    run: ModeOnLaw, motion: OscillatorMotion, floors: Vector, high: float, errors: Records
) -> Step:
    """Plan the next step of the cam speed, at most up to ``high`` (rad/s).

    The width is such that bounds of the chord error (deviation of the output from a straight line
    over the speed) can prove that the output stays positive. ``motion`` is the motion at the
    present speed. ``floors`` are lower bounds of the output there in each group of adjacent pieces
    of the law. Bounds by the harmonics of the law are preferred. If the kind of the step is GROUPS,
    the bounds of the groups are written to ``errors``.
    """
    width, fraction, norm, error = high - motion.speed, 0.0, motion.norm, ChordError(0.0, 0.0, 0.0)
    if can_use_harmonics(run.mode, norm):
        error, allowed = bound_steady(run, motion, high), HARMONIC_FRACTION * min_of(floors)
        max_error = bound_output(run, motion, error, motion.steady_start, high).max_error
        if max_error <= allowed:
            return Step(StepKind.HARMONICS, width, error)
        fraction = HARMONIC_SAFETY * math.sqrt(allowed / max(max_error, MIN_DIVISOR))
    if fraction > SHRINK:
        return Step(StepKind.RETRY, fraction * width, error)
    bound_groups(run, norm, motion.speed, high, errors)
    allowed_width = min(width, _max_width(errors, floors, motion.group_min_forced))
    if fraction * width > allowed_width:
        return Step(StepKind.RETRY, fraction * width, error)
    if MAX_WIDTH_RATIO * allowed_width < width:  # the bounds of a step this long are too wide
        return Step(StepKind.RETRY, math.sqrt(allowed_width * width), error)
    return Step(StepKind.GROUPS, allowed_width, error)


def _prove_by_harmonics(error: ChordError, start: float, end: float) -> tuple[bool, float]:
    """Check if a speed step is proven by a bound of the chord error, from harmonics.

    ``start`` and ``end`` are lower bounds of the output at the ends of the step. Returns two
    values: True if it is proven that the output stays positive or becomes negative once, and the
    ratio of the next step's width to this one's.
    """
    start_root, end_root = math.sqrt(max(0.0, start)), math.sqrt(max(0.0, end))
    root_sum, parabola = start_root + end_root, 4.0 * max(error.parabola, MIN_DIVISOR)
    smaller = min(parabola, 4.0 * max(error.max_error, MIN_DIVISOR))
    is_positive = start > 0.0 and end > 0.0
    if error.max_error <= min(start, end) or (
        parabola <= root_sum * root_sum and is_positive
    ):  # positive in the whole step, by (33) or (34)
        predicted_root = math.sqrt(max(0.0, min(end, 2.0 * end - start)))
        factor = (end_root + predicted_root) * math.sqrt(HARMONIC_FRACTION / smaller)
        return True, min(MAX_GROWTH, max(SHRINK, factor))
    fall_ratio = 0.5 * start_root / math.sqrt(max(error.curvature, MIN_DIVISOR))
    factor = HARMONIC_SAFETY * max(fall_ratio, root_sum / math.sqrt(smaller))
    factor = min(HARMONIC_SAFETY, max(SHRINK * SHRINK, factor))
    return fall_ratio >= 1.0 and end <= 0.0, factor  # negative once, by (35)


def _find_floors(run: ModeOnLaw, motion: OscillatorMotion, floors: Vector) -> MinOutput:
    """Find the least output of the run at one speed, and its lower bound per group.

    The output of the mode is, for example, the contact force. ``motion`` is the motion at that
    speed. The lower bound of the output in each group of adjacent pieces of the law, over all
    turns, is written to ``floors``. Returns the least output.
    """
    floors[:] = math.inf
    search = SearchRange(0.0, end_angle(motion, run.mode.duration), CLIMB_RTOL)
    return find_min_output(run.law, run.mode, motion, search, floors)


def _find_margins(
    run: ModeOnLaw, motion: OscillatorMotion, high: float, floors: Vector, out: Vector
) -> int:
    """Write a lower bound of the output in each group of the law's pieces to ``out``.

    The bounds are for the speed of ``motion``, up to the cam angle at which the run at the higher
    speed ``high`` (rad/s) ends. Runs have the same duration, so a faster run ends at a larger
    angle. ``floors`` are the bounds up to the end of the run at the speed of ``motion``. Returns
    the number of evaluations of the output.
    """
    out[:] = floors
    end, next_end = motion.speed * run.mode.duration, high * run.mode.duration
    if end >= len(motion.turn_starts) * TURN or math.isinf(end):
        return 0
    added = SearchRange(end, next_end, CLIMB_RTOL)
    return find_min_output(run.law, run.mode, motion, added, out).evaluations


def _max_width(errors: Records, floors: Vector, forced: Vector) -> float:
    """Return the width (rad/s) of the longest speed step that can probably be proven.

    The proof uses bounds of the chord error (deviation from a straight line over the speed) in
    groups of adjacent pieces of the law. At this width the chord error of some group reaches
    `GROUP_FRACTION` of its least output. ``errors`` are records of `GROUP_ERROR`, ``floors`` the
    least outputs and ``forced`` the least values of the polynomial part of the output, one per
    group.
    """
    width = math.inf
    for i in range(len(floors)):
        if floors[i] < math.inf:
            vibration = errors[i]["vibration"]
            forced_eighth = 0.125 * max(errors[i]["forced_curvature"], MIN_DIVISOR)
            square = GROUP_FRACTION * floors[i] / (0.125 * max(errors[i]["curvature"], MIN_DIVISOR))
            square = max(square, (GROUP_FRACTION * floors[i] - 2.0 * vibration) / forced_eighth)
            square = max(square, (GROUP_FRACTION * forced[i] - vibration) / forced_eighth)
            width = min(width, math.sqrt(max(0.0, square)))
    return width


def _prove_by_groups(
    errors: Records,
    start: Vector,
    end: Vector,
    forced: Vector,
    next_forced: Vector,
    width: float,
) -> bool:
    """Return True if each group's output stays positive, or becomes negative once.

    A group contains adjacent pieces of the law. ``errors`` are the bounds of its chord error in a
    speed step, records of `GROUP_ERROR`. ``start`` and ``end`` are lower bounds of the output in
    each group at the two speeds, and ``forced`` and ``next_forced`` are those of the output's
    polynomial part. ``width`` is the difference of the speeds, rad/s.
    """
    eighth = 0.125 * width * width
    for i in range(len(start)):
        max_error, vibration = errors[i]["curvature"] * eighth, errors[i]["vibration"]
        forced_error = vibration + errors[i]["forced_curvature"] * eighth
        error = min(max_error, vibration + forced_error)  # chord error by (27)
        if (
            start[i] < math.inf
            and forced_error > min(forced[i], next_forced[i])  # else (36)
            and (error > start[i] or (error > end[i] and 4.0 * max_error > start[i]))  # (33), (35)
        ):
            return False
    return True


def _find_zero(run: ModeOnLaw, bracket: Bracket) -> Zero:
    """Find the cam speed in a bracket at which the least output is zero.

    The output of the mode is, for example, the contact force. Each refinement considers only
    outputs within `NEIGHBOURHOOD` of one cam angle. If the output at the refined speed is still
    negative at another angle, the search continues there.
    """
    low, high, angle = bracket
    for _ in range(MAX_REFINEMENTS):
        below, high, angle = _refine_near(run, Bracket(low, high, angle))
        minimum = _find_minimum(run, below, SearchRange(0.0, math.inf, ZERO_RTOL))
        if below == low or minimum.value > 0.0:
            break
        high, angle = below, minimum.angle
    return Zero(high, angle)


def _refine_near(run: ModeOnLaw, bracket: Bracket) -> Bracket:
    """Return the range of speeds that contains a zero, narrowed to rounding.

    Only outputs within `NEIGHBOURHOOD` of the bracket's cam angle are considered. The root finder
    is the Illinois method: secant steps in which the value at an end of the bracket is halved if
    this end is kept twice.
    """
    low, high, angle = bracket
    near = SearchRange(max(0.0, angle - NEIGHBOURHOOD), angle + NEIGHBOURHOOD, ZERO_RTOL)
    positive, negative = _find_minimum(run, low, near), _find_minimum(run, high, near)
    low_value, high_value, angle, side = positive.value, negative.value, negative.angle, 0
    for _ in range(MAX_REFINEMENTS):
        if high - low <= BRACKET_RTOL * high or high_value == 0.0:
            break
        speed = high - high_value * (high - low) / (high_value - low_value)
        if not low < speed < high:
            speed = 0.5 * (low + high)
        minimum = _find_minimum(run, speed, near)
        if minimum.value > 0.0:
            low, low_value = speed, minimum.value
            high_value = 0.5 * high_value if side > 0 else high_value
            side = 1
        else:
            high, high_value, angle = speed, minimum.value, minimum.angle
            low_value = 0.5 * low_value if side < 0 else low_value
            side = -1
    return Bracket(low, high, angle)


def _find_first_turn(run: ModeOnLaw, speed: float, zero: Zero) -> float:
    """Return the cam angle of the least output in the first turn where it is negative.

    The output of the mode is, for example, the contact force. The angle is in rad from the start of
    the run at ``speed`` (rad/s). If the output is positive in all turns, the result is the angle of
    ``zero``.
    """
    motion, unused = motion_at(run, speed), np.zeros(len(run.law.first_pieces) - 1)
    end = end_angle(motion, run.mode.duration)
    for turn in range(len(motion.turn_starts)):
        within = SearchRange(turn * TURN, min(end, (turn + 1) * TURN), ZERO_RTOL)
        minimum = find_min_output(run.law, run.mode, motion, within, unused)
        if minimum.value <= 0.0:
            return minimum.angle
    return zero.angle


def _find_minimum(run: ModeOnLaw, speed: float, within: SearchRange) -> MinOutput:
    """Find the least output at a cam speed (rad/s) within a range of cam angles.

    The output of the mode is, for example, the contact force. A range that extends beyond the end
    of the run is cut there.
    """
    motion = motion_at(run, speed)
    end = min(within.end, end_angle(motion, run.mode.duration))
    unused = np.zeros(len(run.law.first_pieces) - 1)
    search = SearchRange(within.start, end, within.rtol)
    return find_min_output(run.law, run.mode, motion, search, unused)


def min_output_at(law: LawSeries, mode: Oscillator, speed: float) -> float:
    """Return the least output over a run at a cam speed (rad/s), exact to rounding.

    It has the unit of the output, for example N for a contact force.
    """
    run = mode_on_law(without_refcount(law), mode)
    return _find_minimum(run, speed, SearchRange(0.0, math.inf, 0.0)).value

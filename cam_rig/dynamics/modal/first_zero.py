"""Search for the lowest speed at which the least output of a run is zero.

The search increases the speed step by step. It uses the least outputs at both ends of a step and
bounds of the chord error between them. They prove one of two facts: the output is positive in the
whole step (33), (34), (36), or it becomes negative once (35). A step without a proof is repeated
with a smaller width, so no zero is stepped over (theorem B). The bounds come from the harmonics of
the law (`harmonic_error`) or from groups of its pieces (`group_error`).

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

#: Relative tolerance of the minimum of the output during the climb, which needs only lower bounds.
CLIMB_RTOL = 0.25
#: Smallest step, as a fraction of the speed, that is tried if the rounding error at the end of the
#: step is too large. With a smaller step the climb ends as UNRESOLVED.
UNRESOLVED_RTOL = 1e-3
#: Shortest step as a fraction of the speed. A step of this length needs no proof, because rounding
#: decides whether the output is positive.
MIN_STEP = 1e-11
#: Chord error for which a step by groups is planned, as a fraction of the minimum of the output at
#: the start of the step.
GROUP_FRACTION = 0.75
#: Factor from a step that was proven by groups to the next step.
GROUP_GROWTH = 1.5
#: Largest ratio of a step to the step that its bounds allow. At a larger ratio the step is planned
#: again with a smaller width.
MAX_WIDTH_RATIO = 3.0
#: Factor from a step that was not proven to the next step.
SHRINK = 0.57
#: Chord error for which a step by harmonics is planned, as a fraction of the minimum of the output
#: at the start of the step.
HARMONIC_FRACTION = 0.6
#: Safety factor of a step that is planned after a failed step by harmonics.
HARMONIC_SAFETY = 0.93
#: Largest factor from a step that was proven by harmonics to the next step.
MAX_GROWTH = 2.0
#: Relative tolerance of the minimum of the output during the refinement of a zero.
ZERO_RTOL = 1e-4
#: Relative distance above the zero at which the first negative turn is determined. All turns whose
#: output becomes negative within this distance count as negative at the same speed.
SAME_SPEED_RTOL = 5e-6
#: Relative width at which the bracket of a zero is narrow enough: 45 times the float epsilon.
BRACKET_RTOL = 1e-14
#: Distance (rad) on both sides of the angle of the negative output within which a zero is refined
#: first.
NEIGHBOURHOOD = TURN / 64.0
#: Largest number of iterations of a refinement. The limit prevents an endless loop.
MAX_REFINEMENTS = 200


class ClimbStatus(IntEnum):
    """Result of a climb, the search that increases the speed step by step."""

    FOUND = 0  #: the minimum of the output is zero at ``speed``
    NEGATIVE = 1  #: the minimum of the output is not positive at the first speed
    POSITIVE = 2  #: the minimum of the output is positive up to the last speed
    UNRESOLVED = 3  #: positive up to a speed above which the rounding error is too large
    PAUSED = 4  #: positive up to ``low``, where the evaluations were used up


class StepKind(IntEnum):
    """Kind of bounds with which a step of the speed is to be proven."""

    HARMONICS = 0  #: bounds of `harmonic_error`
    GROUPS = 1  #: bounds of `group_error`
    RETRY = 2  #: neither kind is sufficient: plan a step of the returned width


class Climb(NamedTuple):
    """State or result of a climb, the search that increases the speed step by step."""

    status: int  #: `ClimbStatus`
    low: float  #: speed (rad/s) up to which the output is proven positive
    step: float  #: next step, as a fraction of the speed
    speed: float  #: zero of the minimum output if the status is FOUND, else ``low``, rad/s
    angle: float  #: angle of the minimum if FOUND or NEGATIVE, rad from the start of the run
    #: Angle of the minimum of the output, rad from the start of the run, in the first turn that is
    #: negative at a speed `SAME_SPEED_RTOL` above the zero.
    first_angle: float


class Zero(NamedTuple):
    """Speed at which the minimum of the output is zero, and the angle of that minimum."""

    speed: float  #: rad/s
    angle: float  #: rad from the start of the run


class Bracket(NamedTuple):
    """Speeds (rad/s) between which the least output becomes zero."""

    low: float  #: speed at which the minimum of the output is positive
    high: float  #: speed at which the minimum of the output is not positive
    angle: float  #: angle of the minimum of the output at ``high``, rad from the start of the run


class Step(NamedTuple):
    """Planned step of the speed, and the bounds that are to prove it."""

    kind: int  #: `StepKind`
    width: float  #: difference of the speeds at its ends, rad/s
    error: ChordError  #: chord error of q, used if the kind is HARMONICS


def climb(
    law: LawSeries, mode: Oscillator, low: float, step: float, last: float, max_evaluations: float
) -> Climb:
    """Increase the speed until the minimum of the output over the run is zero.

    The search starts at ``low`` and stops at ``last`` (rad/s) at the latest, or after
    ``max_evaluations``. ``step`` is the first step as a fraction of the speed. Invariant: the
    output is positive at all speeds from the start of the search to the present speed (theorem B of
    docs/proofs.md).
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
    """Plan the next step of the speed, at most up to ``high`` (rad/s).

    Bounds by harmonics are preferred. The bounds by groups are written to ``errors`` if the kind of
    the step is GROUPS.
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
    allowed_width = min(width, _allowed_width(errors, floors, motion.group_min_forced))
    if fraction * width > allowed_width:
        return Step(StepKind.RETRY, fraction * width, error)
    if MAX_WIDTH_RATIO * allowed_width < width:  # the bounds of a step this long are too wide
        return Step(StepKind.RETRY, math.sqrt(allowed_width * width), error)
    return Step(StepKind.GROUPS, allowed_width, error)


def _prove_by_harmonics(error: ChordError, start: float, end: float) -> tuple[bool, float]:
    """Check by bounds of the harmonics if a step is proven, and plan the next step.

    ``start`` and ``end`` are lower bounds of the output at the ends of the step. Returns True if
    the step is proven, and the factor of the width of the next step.
    """
    start_root, end_root = math.sqrt(max(0.0, start)), math.sqrt(max(0.0, end))
    root_sum, parabola = start_root + end_root, 4.0 * max(error.parabola, MIN_DIVISOR)
    smaller = min(parabola, 4.0 * max(error.max_error, MIN_DIVISOR))
    is_positive = start > 0.0 and end > 0.0
    if error.max_error <= min(start, end) or (
        parabola <= root_sum * root_sum and is_positive
    ):  # (33), (34)
        predicted_root = math.sqrt(max(0.0, min(end, 2.0 * end - start)))
        factor = (end_root + predicted_root) * math.sqrt(HARMONIC_FRACTION / smaller)
        return True, min(MAX_GROWTH, max(SHRINK, factor))
    fall_ratio = 0.5 * start_root / math.sqrt(max(error.curvature, MIN_DIVISOR))
    factor = HARMONIC_SAFETY * max(fall_ratio, root_sum / math.sqrt(smaller))
    factor = min(HARMONIC_SAFETY, max(SHRINK * SHRINK, factor))
    return fall_ratio >= 1.0 and end <= 0.0, factor  # (35)


def _find_floors(run: ModeOnLaw, motion: OscillatorMotion, floors: Vector) -> MinOutput:
    """Find the least output of the run, and the least output of each group of pieces.

    Lower bounds of the output in each group are written to ``floors``.
    """
    floors[:] = math.inf
    search = SearchRange(0.0, end_angle(motion, run.mode.duration), CLIMB_RTOL)
    return find_min_output(run.law, run.mode, motion, search, floors)


def _find_margins(
    run: ModeOnLaw, motion: OscillatorMotion, high: float, floors: Vector, out: Vector
) -> int:
    """Write a lower bound of the output in each group to ``out``.

    The bounds are ``floors`` extended to the angle at which the run at the speed ``high`` ends.
    That angle is larger than at the speed of ``motion``. Returns the number of evaluations.
    """
    out[:] = floors
    end, next_end = motion.speed * run.mode.duration, high * run.mode.duration
    if end >= len(motion.turn_starts) * TURN or math.isinf(end):
        return 0
    added = SearchRange(end, next_end, CLIMB_RTOL)
    return find_min_output(run.law, run.mode, motion, added, out).evaluations


def _allowed_width(errors: Records, floors: Vector, forced: Vector) -> float:
    """Return the width (rad/s) of the longest step that groups are likely to prove.

    At this width the chord errors reach `GROUP_FRACTION` of the least outputs.
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

    The step of the speed is ``width`` (rad/s). ``start`` and ``end`` are lower bounds of the output
    of each group at the ends of the step, ``forced`` and ``next_forced`` those of its polynomial
    part. ``width`` is in rad/s.
    """
    eighth = 0.125 * width * width
    for i in range(len(start)):
        max_error, vibration = errors[i]["curvature"] * eighth, errors[i]["vibration"]
        forced_error = vibration + errors[i]["forced_curvature"] * eighth
        error = min(max_error, vibration + forced_error)  # (27)
        if (
            start[i] < math.inf
            and forced_error > min(forced[i], next_forced[i])  # else (36)
            and (error > start[i] or (error > end[i] and 4.0 * max_error > start[i]))  # (33), (35)
        ):
            return False
    return True


def _find_zero(run: ModeOnLaw, bracket: Bracket) -> Zero:
    """Find the speed in a bracket at which the least output is zero, and its angle.

    Each refinement considers only the outputs near one angle. If the output is then still negative
    at another angle, the search continues there.
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
    """Return the bracket refined to rounding, for the outputs near its angle.

    It uses the Illinois method: secant steps that halve the value at an end that is kept twice.
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
    """Return the angle (rad) of the least output in the first turn that is negative.

    A turn is negative if its least output is. If no turn has a negative output at ``speed``
    (rad/s), return the angle of the zero.
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
    """Find the least output at a speed (rad/s) within a range of angles.

    The range is cut at the end of the run.
    """
    motion = motion_at(run, speed)
    end = min(within.end, end_angle(motion, run.mode.duration))
    unused = np.zeros(len(run.law.first_pieces) - 1)
    search = SearchRange(within.start, end, within.rtol)
    return find_min_output(run.law, run.mode, motion, search, unused)


def min_output_at(law: LawSeries, mode: Oscillator, speed: float) -> float:
    """Return the least output of the run at a cam speed (rad/s), exact to rounding."""
    run = mode_on_law(without_refcount(law), mode)
    return _find_minimum(run, speed, SearchRange(0.0, math.inf, 0.0)).value

"""Lowest speed at which the least output of a run is zero; no zero is stepped over.

The search climbs through the speeds. From the least outputs at both ends of a step and from bounds
of the chord error between them it proves one of two facts: the output is positive in the whole step
(33), (34), (36), or it becomes negative once (35). A step without a proof is repeated with a
smaller width. The bounds come from the law's harmonics (`harmonic_error`) or from groups of its
pieces (`group_error`). Numbers in brackets are those of docs/proofs.md, part 2.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.modal.group_error import GROUP_ERROR, TINY, bound_groups
from cam_rig.dynamics.modal.harmonic_error import (
    ChordError,
    bound_output,
    bound_settled,
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

#: Relative tolerance of the least outputs during the climb.
CLIMB_RTOL = 0.25
#: Relative distance to which the search approaches a speed above which rounding is too large.
UNRESOLVED_RTOL = 1e-3
#: Shortest step, as a fraction of the speed: below it rounding decides.
MIN_STEP = 1e-11
#: Fraction of the least outputs at the start of a step that a group's chord error may reach there.
GROUP_FRACTION = 0.75
#: Factor of the next step by groups after a proven one.
GROUP_GROWTH = 1.5
#: Ratio of the tried to the allowed step above which the bounds are computed again.
MAX_WIDTH_RATIO = 3.0
#: Factor of a step that was not proven.
SHRINK = 0.57
#: Fraction of the least outputs that the chord error by harmonics may reach at the start of a step.
HARMONIC_FRACTION = 0.6
#: Safety factor of the next step by harmonics.
HARMONIC_SAFETY = 0.93
#: Largest factor of the next step by harmonics.
MAX_GROWTH = 2.0
#: Relative tolerance of the least outputs during the refinement of a zero.
ZERO_RTOL = 1e-4
#: Relative difference of speeds for which turns count as negative together.
SAME_SPEED_RTOL = 5e-6
#: Relative width of the bracket of a zero.
BRACKET_RTOL = 1e-14
#: Distance (rad) around the negative output within which a zero is refined first.
NEIGHBOURHOOD = TURN / 64.0
#: Largest number of refinements.
MAX_REFINEMENTS = 200


class ClimbStatus(IntEnum):
    """Result of a climb."""

    FOUND = 0  #: the least output is zero at ``speed``
    NEGATIVE = 1  #: it is not positive at the start
    POSITIVE = 2  #: it is positive up to the last speed
    UNRESOLVED = 3  #: it is positive up to a speed above which rounding is too large
    PAUSED = 4  #: the number of evaluations is used up


class StepKind(IntEnum):
    """Bound from which a step is to be proven."""

    HARMONICS = 0
    GROUPS = 1
    RETRY = 2  #: neither; try another width


class Climb(NamedTuple):
    """State or result of a climb."""

    status: int  #: `ClimbStatus`
    low: float  #: the output is positive from the first speed to this one, rad/s
    step: float  #: next step, as a fraction of the speed
    speed: float  #: zero of the least output if it was found, rad/s
    angle: float  #: its angle, rad since the start of the run
    first_angle: float  #: angle in the first turn that is negative at `SAME_SPEED_RTOL` more


class Zero(NamedTuple):
    """Zero of the least output."""

    speed: float  #: rad/s
    angle: float  #: rad since the start of the run


class Bracket(NamedTuple):
    """Speeds (rad/s) between which the least output becomes zero."""

    low: float  #: positive
    high: float  #: not positive
    angle: float  #: of the least output at ``high``, rad since the start of the run


class Step(NamedTuple):
    """A step of the speed that is to be tried."""

    kind: int  #: `StepKind`
    width: float  #: rad/s
    error: ChordError  #: of q, if the kind is HARMONICS


def climb(
    law: LawSeries, mode: Oscillator, low: float, step: float, last: float, max_evaluations: float
) -> Climb:
    """Increase the speed from ``low`` (rad/s) until the least output is zero, at most to ``last``.

    Invariant: the output is positive from the first ``low`` up to ``low`` (theorem B).
    """
    run, count = mode_on_law(without_refcount(law), mode), len(law.first_pieces) - 1
    if not is_resolved(run, low):
        return Climb(ClimbStatus.UNRESOLVED, low, step, low, 0.0, 0.0)
    errors, margins = np.zeros(count, GROUP_ERROR), np.zeros(count)
    floors, next_floors = np.zeros(count), np.zeros(count)
    motion = motion_at(run, low)
    lowest = _find_floors(run, motion, floors)
    if lowest.value <= 0.0:
        return Climb(ClimbStatus.NEGATIVE, low, step, low, lowest.angle, lowest.angle)
    evaluations = float(lowest.evaluations)
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
        evaluations += len(law.span_index) * len(run.series.own)
        next_motion = motion_at(run, high)
        lowest = _find_floors(run, next_motion, next_floors)
        evaluations += lowest.evaluations
        if kind == StepKind.HARMONICS:
            error = bound_output(run, motion, error, next_motion.repeating, high)
            is_proven, factor = _prove_by_harmonics(error, min_of(margins), min_of(next_floors))
        else:
            forced, next_forced = motion.group_min_forced, next_motion.group_min_forced
            is_proven = _prove_by_groups(errors, margins, next_floors, forced, next_forced, width)
            factor = GROUP_GROWTH if is_proven else SHRINK
        step = factor * width / low
        if not is_proven and width > min_width:
            continue
        if lowest.value <= 0.0:
            zero = _find_zero(run, Bracket(low, high, lowest.angle))
            first = _find_first_turn(run, min(high, zero.speed * (1.0 + SAME_SPEED_RTOL)), zero)
            return Climb(ClimbStatus.FOUND, low, step, zero.speed, zero.angle, first)
        low, motion, floors, next_floors = high, next_motion, next_floors, floors
        if evaluations > max_evaluations:
            return Climb(ClimbStatus.PAUSED, low, step, low, 0.0, 0.0)
    return Climb(ClimbStatus.POSITIVE, low, step, low, 0.0, 0.0)


def _plan_step(
    run: ModeOnLaw, motion: OscillatorMotion, floors: Vector, high: float, errors: Records
) -> Step:
    """Return the step up to a speed, or a shorter one, and the bound that is likely to prove it."""
    width, fraction, norm, error = high - motion.speed, 0.0, motion.norm, ChordError(0.0, 0.0, 0.0)
    if can_use_harmonics(run.mode, norm):
        error, allowed = bound_settled(run, motion, high), HARMONIC_FRACTION * min_of(floors)
        largest = bound_output(run, motion, error, motion.repeating, high).largest
        if largest <= allowed:
            return Step(StepKind.HARMONICS, width, error)
        fraction = HARMONIC_SAFETY * math.sqrt(allowed / max(largest, TINY))
    if fraction > SHRINK:
        return Step(StepKind.RETRY, fraction * width, error)
    bound_groups(run, norm, motion.speed, high, errors)
    allowed_width = min(width, _allowed_width(errors, floors, motion.group_min_forced))
    if fraction * width > allowed_width:
        return Step(StepKind.RETRY, fraction * width, error)
    if MAX_WIDTH_RATIO * allowed_width < width:  # bounds over so long a step are far too wide
        return Step(StepKind.RETRY, math.sqrt(allowed_width * width), error)
    return Step(StepKind.GROUPS, allowed_width, error)


def _prove_by_harmonics(error: ChordError, first: float, last: float) -> tuple[bool, float]:
    """Return True if a step is proven, and the factor of the next step.

    ``first`` and ``last`` are lower bounds of the outputs at its ends.
    """
    root, end = math.sqrt(max(0.0, first)), math.sqrt(max(0.0, last))
    both, bow = root + end, 4.0 * max(error.bow, TINY)
    smaller = min(bow, 4.0 * max(error.largest, TINY))
    is_positive = first > 0.0 and last > 0.0
    if error.largest <= min(first, last) or (bow <= both * both and is_positive):  # (33), (34)
        predicted = math.sqrt(max(0.0, min(last, 2.0 * last - first)))
        factor = (end + predicted) * math.sqrt(HARMONIC_FRACTION / smaller)
        return True, min(MAX_GROWTH, max(SHRINK, factor))
    once = 0.5 * root / math.sqrt(max(error.bend, TINY))
    factor = HARMONIC_SAFETY * max(once, both / math.sqrt(smaller))
    factor = min(HARMONIC_SAFETY, max(SHRINK * SHRINK, factor))
    return once >= 1.0 and last <= 0.0, factor  # (35)


def _find_floors(run: ModeOnLaw, motion: OscillatorMotion, floors: Vector) -> MinOutput:
    """Find the least output of the run; write lower bounds of the output in each group."""
    floors[:] = math.inf
    whole = SearchRange(0.0, end_angle(motion, run.mode.duration), CLIMB_RTOL)
    return find_min_output(run.law, run.mode, motion, whole, floors)


def _find_margins(
    run: ModeOnLaw, motion: OscillatorMotion, high: float, floors: Vector, out: Vector
) -> int:
    """Write the lower bounds up to the angle where the run at a speed ``high`` ends.

    Returns the number of evaluations.
    """
    out[:] = floors
    end, next_end = motion.speed * run.mode.duration, high * run.mode.duration
    if end >= len(motion.turn_starts) * TURN or math.isinf(end):
        return 0
    added = SearchRange(end, next_end, CLIMB_RTOL)
    return find_min_output(run.law, run.mode, motion, added, out).evaluations


def _allowed_width(errors: Records, floors: Vector, forced: Vector) -> float:
    """Return the width (rad/s) at which errors reach `GROUP_FRACTION` of the least outputs."""
    width = math.inf
    for i in range(len(floors)):
        if floors[i] < math.inf:
            vibration = errors[i]["vibration"]
            forced_eighth = 0.125 * max(errors[i]["forced_curvature"], TINY)
            square = GROUP_FRACTION * floors[i] / (0.125 * max(errors[i]["curvature"], TINY))
            square = max(square, (GROUP_FRACTION * floors[i] - 2.0 * vibration) / forced_eighth)
            square = max(square, (GROUP_FRACTION * forced[i] - vibration) / forced_eighth)
            width = min(width, math.sqrt(max(0.0, square)))
    return width


def _prove_by_groups(
    errors: Records,
    first: Vector,
    last: Vector,
    forced: Vector,
    next_forced: Vector,
    width: float,
) -> bool:
    """Return True if each group is positive between two speeds, or becomes negative once.

    ``first`` and ``last`` are lower bounds of the output at both, ``forced`` and ``next_forced``
    those of its polynomial part.
    """
    eighth = 0.125 * width * width
    for i in range(len(first)):
        bend, vibration = errors[i]["curvature"] * eighth, errors[i]["vibration"]
        forced_error = vibration + errors[i]["forced_curvature"] * eighth
        error = min(bend, vibration + forced_error)  # (27)
        if (
            first[i] < math.inf
            and forced_error > min(forced[i], next_forced[i])  # else (36)
            and (error > first[i] or (error > last[i] and 4.0 * bend > first[i]))  # (33), (35)
        ):
            return False
    return True


def _find_zero(run: ModeOnLaw, bracket: Bracket) -> Zero:
    """Find the zero of the least output in a bracket.

    Each refinement considers the outputs near one angle only. If the output is then still negative
    elsewhere, the search continues there.
    """
    low, high, angle = bracket
    for _ in range(MAX_REFINEMENTS):
        below, high, angle = _refine_near(run, Bracket(low, high, angle))
        lowest = _find_lowest(run, below, SearchRange(0.0, math.inf, ZERO_RTOL))
        if below == low or lowest.value > 0.0:
            break
        high, angle = below, lowest.angle
    return Zero(high, angle)


def _refine_near(run: ModeOnLaw, bracket: Bracket) -> Bracket:
    """Return a bracket of the zero of the outputs near an angle, to rounding.

    Illinois method: secant steps, where the value at an end that stays twice is halved.
    """
    low, high, angle = bracket
    near = SearchRange(max(0.0, angle - NEIGHBOURHOOD), angle + NEIGHBOURHOOD, ZERO_RTOL)
    above, below = _find_lowest(run, low, near), _find_lowest(run, high, near)
    first, last, angle, side = above.value, below.value, below.angle, 0
    for _ in range(MAX_REFINEMENTS):
        if high - low <= BRACKET_RTOL * high or last == 0.0:
            break
        speed = high - last * (high - low) / (last - first)
        if not low < speed < high:
            speed = 0.5 * (low + high)
        lowest = _find_lowest(run, speed, near)
        if lowest.value > 0.0:
            low, first = speed, lowest.value
            last = 0.5 * last if side > 0 else last
            side = 1
        else:
            high, last, angle = speed, lowest.value, lowest.angle
            first = 0.5 * first if side < 0 else first
            side = -1
    return Bracket(low, high, angle)


def _find_first_turn(run: ModeOnLaw, speed: float, zero: Zero) -> float:
    """Return the angle (rad) of the least output in the first turn that is negative at a speed.

    Without such a turn it is that of the zero.
    """
    motion, unused = motion_at(run, speed), np.zeros(len(run.law.first_pieces) - 1)
    end = end_angle(motion, run.mode.duration)
    for turn in range(len(motion.turn_starts)):
        within = SearchRange(turn * TURN, min(end, (turn + 1) * TURN), ZERO_RTOL)
        lowest = find_min_output(run.law, run.mode, motion, within, unused)
        if lowest.value <= 0.0:
            return lowest.angle
    return zero.angle


def _find_lowest(run: ModeOnLaw, speed: float, within: SearchRange) -> MinOutput:
    """Find the least output at a speed, in a range that is cut at the end of the run."""
    motion = motion_at(run, speed)
    end = min(within.end, end_angle(motion, run.mode.duration))
    unused = np.zeros(len(run.law.first_pieces) - 1)
    search = SearchRange(within.start, end, within.rtol)
    return find_min_output(run.law, run.mode, motion, search, unused)


def min_output_at(law: LawSeries, mode: Oscillator, speed: float) -> float:
    """Return the least output of the run at a speed (rad/s), to rounding."""
    run = mode_on_law(without_refcount(law), mode)
    return _find_lowest(run, speed, SearchRange(0.0, math.inf, 0.0)).value

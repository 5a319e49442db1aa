"""The lowest speed at which the least output is zero, going upwards; none is stepped over.

What the output may sag below its chord over a step of the speed is bounded in each group, see
`sags`. Where its least values at both ends are above that, so is all between. And where the sag of
all is no more than a quarter of the first of them, the output is above zero all along, or below
zero at the end and has become so once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.modal.least import Least, Stretch, least
from cam_rig.dynamics.modal.motion import (
    LawSeries,
    ModeOnLaw,
    Oscillator,
    OscillatorMotion,
    Triple,
    end_of,
    motion_at,
    on_law,
    resolved,
)
from cam_rig.dynamics.modal.sags import (
    BENT,
    FORCED,
    FREE,
    TINY,
    Sag,
    rings,
    sag_of,
    sags_between,
    settled_sag,
)
from cam_rig.laws.rows import Row, Rows, borrowed, zeros
from cam_rig.units import TURN

#: What a search may find: the output reaches zero; it is there at the start; it is above zero as
#: far as was asked; as far as it can be told; it may be looked at no more, and goes on from there.
FOUND, BELOW, ABOVE, UNTOLD, PAUSED = range(5)
#: On the way the least output is found to this part of itself.
NEARLY = 0.25
#: How near the search comes to a speed from which on the output cannot be told.
NEAR = 1e-3
#: A step is no shorter than this part of the speed, and a speed told no finer: rounding decides.
FINEST = 1e-11
#: Sags that a step is made for, as parts of the least output where it begins, and for how much
#: longer than the last one it is tried.
SAGS, LONGER = 0.75, 1.5
#: A step that may be no longer than this part of what was tried is tried anew; and to what a step
#: is cut over which contact may be lost and found again.
WIDE, AGAIN = 3.0, 0.57
#: Sags by harmonics that a step is made for, before what comes at its end is known; and by how much
#: the next is shorter than they tell, and how much longer at most.
TRIED, NEARER, LONGEST = 0.6, 0.93, 2.0
#: What tells of a step: the law's harmonics, groups of its pieces; or none.
BY_HARMONICS, BY_GROUPS, ANEW = range(3)
#: On the way to a zero the least output is found to this part of itself.
POLISHED = 1e-4
#: Turns that differ by less than this part of the speed fall below zero together.
LAST_DIGIT = 5e-6
#: A zero is found to this part of the speed.
ROOT = 1e-14
#: How far (rad) from where the output is below zero it is sought first.
NEARBY = TURN / 64.0
#: Steps of the root between two speeds.
MOST_STEPS = 200


class Climb(NamedTuple):
    """How far a search has come, and what it has found."""

    outcome: int
    low: float  #: up to where the output is above zero, rad/s
    step: float  #: with which to go on, part of the speed
    speed: float  #: where the least output is zero, if it was found, rad/s
    angle: float  #: where it is there, rad from the start of the run
    first: float  #: the same in the first turn that falls below zero a last digit faster


def climb(
    law: LawSeries, mode: Oscillator, low: float, step: float, last: float, most: float
) -> Climb:
    """Go up from a speed (rad/s) to ``last`` at most, with as many looks as ``most``."""
    run, count = on_law(borrowed(law), mode), len(law.groups) - 1
    if not resolved(run, low):
        return Climb(UNTOLD, low, step, low, 0.0, 0.0)
    sags, floors, margins, there = zeros((3, count)), zeros(count), zeros(count), zeros(count)
    motion = motion_at(run, low)
    found = _floors(run, motion, floors)
    if found.value <= 0.0:
        return Climb(BELOW, low, step, low, found.angle, found.angle)
    looks = float(found.looks)
    while low < last:
        high = min(low * (1.0 + step), last)
        if not resolved(run, high):
            if step < NEAR:
                return Climb(UNTOLD, low, step, low, 0.0, 0.0)
            step *= 0.5
            continue
        way, width, sag = _step(run, motion, floors, high, sags)
        finest = FINEST * low
        width = max(width, finest)
        if way == ANEW and width > finest:
            step = width / low
            continue
        high = high if way == BY_HARMONICS else low + width
        looks += _margins(run, motion, high, floors, margins)
        looks += len(law.alike) * len(run.series.own)
        after = motion_at(run, high)
        found = _floors(run, after, there)
        looks += found.looks
        if way == BY_HARMONICS:
            sag = sag_of(run, motion, sag, after.settled, high)
            holds, longer = _next(sag, _lowest_of(margins), _lowest_of(there))
        else:
            lowest, forced = motion.group_lowest, after.group_lowest
            holds = _holds(sags, margins, there, lowest, forced, width)
            longer = LONGER if holds else AGAIN
        step = longer * width / low
        if not holds and width > finest:
            continue
        if found.value <= 0.0:
            zero = _zero(run, low, high, found.angle)
            beyond = min(high, zero[0] * (1.0 + LAST_DIGIT))
            first = _first_below(run, beyond, zero[1])
            return Climb(FOUND, low, step, zero[0], zero[1], first)
        low, motion, floors, there = high, after, there, floors
        if looks > most:
            return Climb(PAUSED, low, step, low, 0.0, 0.0)
    return Climb(ABOVE, low, step, low, 0.0, 0.0)


def _step(
    run: ModeOnLaw, motion: OscillatorMotion, floors: Row, high: float, sags: Rows
) -> tuple[int, float, Sag]:
    """By what the output is told to be above zero up to a speed, and over what step (rad/s).

    By the law's harmonics, or group by group, whichever tells of the longer one; else what to try.
    """
    wide, part, size, sag = high - motion.speed, 0.0, motion.norm, Sag(0.0, 0.0, 0.0)
    if rings(run.mode, size):
        sag, tried = settled_sag(run, motion, high), TRIED * _lowest_of(floors)
        below = sag_of(run, motion, sag, motion.settled, high).below
        if below <= tried:
            return BY_HARMONICS, wide, sag
        part = NEARER * math.sqrt(tried / max(below, TINY))
    if part > AGAIN:
        return ANEW, part * wide, sag
    sags_between(run, size, motion.speed, high, sags)
    width = min(wide, _width(sags, floors, motion.group_lowest))
    if part * wide > width:
        return ANEW, part * wide, sag
    if WIDE * width < wide:  # what is told over so long a step is far too wide
        return ANEW, math.sqrt(width * wide), sag
    return BY_GROUPS, width, sag


def _next(sag: Sag, first: float, last: float) -> tuple[bool, float]:
    """Whether a step holds, from the least outputs; how much longer the next is to be.

    It holds where no output is below zero but where it becomes so once: above zero all along for
    a (1 − x) + c x > 4 x (1 − x) bow, so for 4 bow < (√a + √c)².
    """
    begin, end = math.sqrt(max(0.0, first)), math.sqrt(max(0.0, last))
    both, bow = begin + end, 4.0 * max(sag.bow, TINY)
    less = min(bow, 4.0 * max(sag.below, TINY))
    if sag.below <= min(first, last) or (bow <= both * both and first > 0.0 and last > 0.0):
        further = math.sqrt(max(0.0, min(last, 2.0 * last - first)))
        return True, min(LONGEST, max(AGAIN, (end + further) * math.sqrt(TRIED / less)))
    once = 0.5 * begin / math.sqrt(max(sag.bent, TINY))
    shorter = NEARER * max(once, both / math.sqrt(less))
    return once >= 1.0 and last <= 0.0, min(NEARER, max(AGAIN * AGAIN, shorter))


def _lowest_of(floors: Row) -> float:
    """The least of the groups."""
    lowest = math.inf
    for floor in floors:
        lowest = min(lowest, floor)
    return lowest


def _floors(run: ModeOnLaw, motion: OscillatorMotion, floors: Row) -> Least:
    """The least output of the run, nearly, and what it is not below in each group."""
    for i in range(len(floors)):
        floors[i] = math.inf
    whole = Stretch(0.0, end_of(motion, run.mode.duration), NEARLY)
    return least(run.law, run.mode, motion, whole, floors)


def _margins(run: ModeOnLaw, motion: OscillatorMotion, high: float, floors: Row, out: Row) -> int:
    """What the output is not below in each group up to where the run at a speed ``high`` ends."""
    for i in range(len(floors)):
        out[i] = floors[i]
    end, further = motion.speed * run.mode.duration, high * run.mode.duration
    if end >= len(motion.starts) * TURN or math.isinf(end):
        return 0
    return least(run.law, run.mode, motion, Stretch(end, further, NEARLY), out).looks


def _width(sags: Rows, floors: Row, lowest: Row) -> float:
    """Step of the speed (rad/s) over which the sags are but a part of the least outputs."""
    width = math.inf
    for i in range(len(floors)):
        if floors[i] < math.inf:
            free, forced = sags[FREE][i], 0.125 * max(sags[FORCED][i], TINY)
            wide = SAGS * floors[i] / (0.125 * max(sags[BENT][i], TINY))
            wide = max(wide, (SAGS * floors[i] - 2.0 * free) / forced)
            wide = max(wide, (SAGS * lowest[i] - free) / forced)
            width = min(width, math.sqrt(max(0.0, wide)))
    return width


def _holds(
    sags: Rows, before: Row, after: Row, forced: Row, forced_after: Row, width: float
) -> bool:
    """Whether no group is below zero between two speeds but where it becomes so once.

    The least outputs at both, and of the polynomial parts alone.
    """
    square = 0.125 * width * width
    for i in range(len(before)):
        bent, free = sags[BENT][i] * square, sags[FREE][i]
        alone = free + sags[FORCED][i] * square
        sag = min(bent, free + alone)
        if (
            before[i] < math.inf
            and alone > min(forced[i], forced_after[i])
            and (sag > before[i] or (sag > after[i] and 4.0 * bent > before[i]))
        ):
            return False
    return True


def _zero(run: ModeOnLaw, low: float, high: float, where: float) -> tuple[float, float]:
    """Where the least output is zero: above at one speed, not above at another and an angle.

    Sought near that angle alone. Where the output is below zero elsewhere a last digit slower, it
    is sought there anew.
    """
    for _ in range(MOST_STEPS):
        last, high, where = _zero_near(run, low, high, where)
        found = _lowest(run, last, Stretch(0.0, math.inf, POLISHED))
        if last == low or found.value > 0.0:
            break
        high, where = last, found.angle
    return high, where


def _zero_near(run: ModeOnLaw, low: float, high: float, where: float) -> Triple:
    """The last speed (rad/s) above it, the zero near an angle (rad), and the angle there.

    By the secant, whose value at the end that stays is halved (the Illinois method).
    """
    near = Stretch(max(0.0, where - NEARBY), where + NEARBY, POLISHED)
    above, below = _lowest(run, low, near), _lowest(run, high, near)
    first, last, where, side = above.value, below.value, below.angle, 0
    for _ in range(MOST_STEPS):
        if high - low <= ROOT * high or last == 0.0:
            break
        speed = high - last * (high - low) / (last - first)
        if not low < speed < high:
            speed = 0.5 * (low + high)
        now = _lowest(run, speed, near)
        if now.value > 0.0:
            low, first = speed, now.value
            last = 0.5 * last if side > 0 else last
            side = 1
        else:
            high, last, where = speed, now.value, now.angle
            first = 0.5 * first if side < 0 else first
            side = -1
    return low, high, where


def _first_below(run: ModeOnLaw, speed: float, where: float) -> float:
    """Where (rad) the first turn is lowest that is below zero at a speed; ``where`` if none is."""
    motion, nothing = motion_at(run, speed), zeros(len(run.law.groups) - 1)
    end = end_of(motion, run.mode.duration)
    for turn in range(len(motion.starts)):
        within = Stretch(turn * TURN, min(end, (turn + 1) * TURN), POLISHED)
        found = least(run.law, run.mode, motion, within, nothing)
        if found.value <= 0.0:
            return found.angle
    return where


def _lowest(run: ModeOnLaw, speed: float, within: Stretch) -> Least:
    """The least output at one speed, in a stretch that ends no later than the run."""
    motion = motion_at(run, speed)
    end = min(within.end, end_of(motion, run.mode.duration))
    stretch = Stretch(within.begin, end, within.relative)
    return least(run.law, run.mode, motion, stretch, zeros(len(run.law.groups) - 1))


def least_at(law: LawSeries, mode: Oscillator, speed: float) -> float:
    """The least output of the run at a speed (rad/s)."""
    return _lowest(on_law(borrowed(law), mode), speed, Stretch(0.0, math.inf, 0.0)).value

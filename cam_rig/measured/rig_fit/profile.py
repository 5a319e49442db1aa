"""How sure a restitution is, by the profile of its likelihood; the others where no bounce is.

A sample of force that comes to lie in a bounce changes the residuals at once, so along the
restitution the likelihood is level here and steep there: its curvature at one place does not say
how wide it is. The ratio of likelihoods does, the other numbers sought anew at each restitution.
"""

from __future__ import annotations

import math
from dataclasses import replace

from cam_rig.measured.rig_fit.numbers import NUMBERS, WITHIN_95
from cam_rig.measured.rig_fit.search import (
    FIRST_GUARD,
    Candidate,
    FitSolution,
    continued,
    inflation,
    log_ratio_of_all,
    search,
)
from cam_rig.measured.rig_fit.start import (
    LEAST_FLYING,
    SMALL_BOUNCE,
    SQUARE_95,
    forces_in_flight,
    freed,
)

#: First step from the likeliest restitution, each next one twice it; halvings of the last.
FIRST_STEP, HALVINGS = 0.01, 3
#: Looks about, each from the likeliest of the one before where that is by this log ratio.
LOOKS, LIKELIER = 4, 1.0
#: Restitutions at which a narrow interval is held against all that lies beside it.
ELSEWHERE = (0.1, 0.3, 0.5, 0.7, 0.9)


def profiled(found: FitSolution) -> FitSolution:
    """The restitution in the middle of its interval of 95 %, the others of what no bounce reaches.

    Of two masses there is none: their bounces depend on every number at once.
    """
    if "roller_share" in found.values or not any(found.landings):
        return found
    bounce = None
    if "restitution" in found.likelihood.sought:
        found, low, high = _interval(found)
        value = found.values["restitution"]
        # Near none, none is said: what is known is the end.
        middle = 0.5 * (low + high) if value >= SMALL_BOUNCE else 0.0
        bounce = middle, (high - middle) / WITHIN_95
        found = _at(found, middle)
    return replace(search(_settled(found)), bounce=bounce)


def _settled(found: FitSolution) -> Candidate:
    """A search of the samples that no bounce reaches; of the force's zero too, where these show it.

    Late in a series of bounces a landing passes samples within a standard error of a number: the
    sum of squares has a cliff there, and its curvature is that of a narrow valley.
    """
    start = Candidate(found.likelihood.settled(found.x, FIRST_GUARD), found.x)
    shown = forces_in_flight(start).size >= LEAST_FLYING
    zero_offset = found.likelihood.zero_offset and shown
    return continued(start, found.likelihood.sought, found.values, zero_offset=zero_offset)


def _interval(found: FitSolution) -> tuple[FitSolution, float, float]:
    """The likeliest of all that is tried on the way to the interval's ends; and these.

    A search ends in the valley it began in. One that is likelier beside another restitution is
    where the next look begins.
    """
    sought = found.likelihood.sought
    at, number = sought.index("restitution"), NUMBERS["restitution"]
    for _ in range(LOOKS):
        level = 0.5 * SQUARE_95 * max(1.0, inflation(found, at))
        (low, down), (high, up) = (_end(found, at, to, level) for to in (number.low, number.high))
        best = min((*down, *up), key=lambda trial: log_ratio_of_all(found, trial), default=found)
        if log_ratio_of_all(found, best) > -LIKELIER:
            break
        found = freed(best, sought)
    return found, *_widened(found, at, low, high, level)


def _widened(
    found: FitSolution, at: int, low: float, high: float, level: float
) -> tuple[float, float]:
    """The interval with what is as likely beside it, taken together.

    Where hardly a sample is in a bounce, the likelihood is nearly level, and the best of its many
    narrow valleys is likelier by chance. A valley outweighs a level as wide as the restitution's
    range only if it is likelier by more than the logarithm of the ratio of their widths.
    """
    number = NUMBERS["restitution"]
    least = FIRST_STEP / 2.0**HALVINGS
    outweighs = level + math.log((number.high - number.low) / max(high - low, least))
    beside = [
        there
        for there in ELSEWHERE
        if not low <= there <= high and _likely(found, _at(found, there), outweighs)
    ]
    return min([low, *beside]), max([high, *beside])


def _at(found: Candidate, bounce: float) -> FitSolution:
    return search(continued(found, found.smooth, found.values | {"restitution": bounce}))


def _end(
    found: FitSolution, at: int, limit: float, level: float
) -> tuple[float, list[FitSolution]]:
    """The last restitution towards ``limit`` that is likely: by a log ratio below ``level``.

    With it what was likely on the way there.
    """
    inside = float(found.x[at])
    likely = list[FitSolution]()
    step, outside, halvings = FIRST_STEP, None, HALVINGS
    while inside != limit and (outside is None or halvings > 0):
        if outside is None:
            there = inside + math.copysign(min(step, abs(limit - inside)), limit - inside)
        else:
            there, halvings = 0.5 * (inside + outside), halvings - 1
        trial = _at(likely[-1] if likely else found, there)
        if _likely(found, trial, level):
            inside, step = there, 2.0 * step
            likely.append(trial)
        else:
            outside = there
    return inside if outside is None else outside, likely


def _likely(found: FitSolution, trial: FitSolution, level: float) -> bool:
    """Whether every hold stays steady and the ratio of likelihoods is near one."""
    return len(trial.holds) == len(found.holds) and log_ratio_of_all(found, trial) < level

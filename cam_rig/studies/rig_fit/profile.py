"""How sure a restitution is, by the profile of its likelihood, and what that adds to the others.

A sample of force that comes to lie in a bounce changes the residuals at once, so along the
restitution the likelihood is level here and steep there: its curvature at one place does not say
how wide it is. The ratio of likelihoods does, the other numbers sought anew at each restitution.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cam_rig.studies.rig_fit.bounces import (
    SMALL_BOUNCE,
    SQUARE_95,
    WITHIN_95,
    as_sought,
    freed,
)
from cam_rig.studies.rig_fit.numbers import NUMBERS
from cam_rig.studies.rig_fit.search import (
    Candidate,
    FitSolution,
    continued,
    landings_of,
    log_ratio,
    search,
)
from cam_rig.studies.rig_fit.uncertainty import inflation

#: First step from the likeliest restitution, each next one twice it; halvings of the last.
FIRST_STEP, HALVINGS = 0.01, 3
#: Looks about, each from the likeliest of the one before where that is by this log ratio.
LOOKS, LIKELIER = 4, 1.0


def profiled(found: FitSolution) -> FitSolution:
    """The same in the middle of the restitution's interval of 95 %, its errors those of that.

    Of two masses there is none: their bounces depend on every number at once.
    """
    like = found.likelihood
    if "roller_share" in like.values(found.x) or not any(landings_of(found)):
        return found
    if "restitution" not in like.sought:
        return found
    found, low, high = _interval(found)
    at = like.sought.index("restitution")
    # Near none, none is said: what is known is the end.
    middle = 0.5 * (low + high) if found.x[at] >= SMALL_BOUNCE else 0.0
    fixed = _at(found, middle)
    if len(fixed.likelihood.holds) < len(like.holds):
        return found
    error = (high - middle) / WITHIN_95
    along = np.insert(_along(fixed, middle, error), at, error)
    return replace(as_sought(fixed, like.sought), along=along)


def _interval(found: FitSolution) -> tuple[FitSolution, float, float]:
    """What is likeliest of all that is tried on the way to the interval's ends, and these.

    A search ends in the valley it began in. One that is likelier beside another restitution is
    where the next look begins.
    """
    sought = found.likelihood.sought
    at, number = sought.index("restitution"), NUMBERS["restitution"]
    for _ in range(LOOKS):
        level = 0.5 * SQUARE_95 * max(1.0, inflation(found, at))
        (low, one), (high, other) = (_end(found, at, to, level) for to in (number.low, number.high))
        best = min((one, other), key=lambda trial: log_ratio(found, trial))
        if log_ratio(found, best) > -LIKELIER:
            break
        found = freed(best, sought)
    return found, low, high


def _at(found: Candidate, bounce: float) -> FitSolution:
    """The other numbers sought anew beside a restitution."""
    names = tuple(name for name in found.likelihood.sought if name != "restitution")
    values = found.likelihood.values(found.x) | {"restitution": bounce}
    return search(continued(found, names, values))


def _end(found: FitSolution, at: int, limit: float, level: float) -> tuple[float, FitSolution]:
    """The last restitution towards ``limit`` that is likely: by a log ratio below ``level``.

    With it the likeliest of what was tried.
    """
    inside = float(found.x[at])
    best = near = found
    step, outside, halvings = FIRST_STEP, None, HALVINGS
    while inside != limit and (outside is None or halvings > 0):
        if outside is None:
            there = inside + math.copysign(min(step, abs(limit - inside)), limit - inside)
        else:
            there, halvings = 0.5 * (inside + outside), halvings - 1
        trial = _at(near, there)
        if _likely(found, trial, level):
            inside, near, step = there, trial, 2.0 * step
            best = min((best, trial), key=lambda one: log_ratio(found, one))
        else:
            outside = there
    return inside if outside is None else outside, best


def _likely(found: FitSolution, trial: FitSolution, level: float) -> bool:
    """Whether every hold stays steady and the ratio of likelihoods is near one."""
    steady = len(trial.likelihood.holds) == len(found.likelihood.holds)
    return steady and log_ratio(found, trial) < level


def _along(fixed: FitSolution, bounce: float, error: float) -> np.ndarray:
    """By how much what was sought, ``(n,)``, changes with one standard error of a restitution."""
    number = NUMBERS["restitution"]
    ends = [min(max(bounce + side * error, number.low), number.high) for side in (-1.0, 1.0)]
    found = [_at(fixed, end) for end in ends]
    if any(one.x.size != fixed.x.size for one in found) or ends[0] == ends[1]:
        return np.zeros(fixed.x.size)
    return np.asarray((found[1].x - found[0].x) * error / (ends[1] - ends[0]))

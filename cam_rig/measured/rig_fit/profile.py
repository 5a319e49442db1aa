"""How sure a restitution is, by the profile of its likelihood, and what that adds to the others.

A sample of force that comes to lie in a bounce changes the residuals at once, so along the
restitution the likelihood is level here and steep there: its curvature at one place does not say
how wide it is. The ratio of likelihoods does, the other numbers sought anew at each restitution.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cam_rig.measured.rig_fit.numbers import NUMBERS
from cam_rig.measured.rig_fit.search import (
    Candidate,
    FitSolution,
    continued,
    inflation,
    landings_of,
    log_ratio,
    search,
)
from cam_rig.measured.rig_fit.start import SMALL_BOUNCE, SQUARE_95, WITHIN_95, as_sought, freed
from cam_rig.units import FloatArray

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
    found, likely, low, high = _interval(found)
    at = like.sought.index("restitution")
    # Near none, none is said: what is known is the end.
    middle = 0.5 * (low + high) if found.x[at] >= SMALL_BOUNCE else 0.0
    fixed = _at(found, middle)
    if fixed.x.size < found.x.size - 1:
        return found
    ends = _at(fixed, low), _at(fixed, high)
    along = np.insert(_along(fixed, [ends[0], *likely, ends[1]]), at, (high - middle) / WITHIN_95)
    return replace(as_sought(fixed, like.sought), along=along)


def _interval(found: FitSolution) -> tuple[FitSolution, list[FitSolution], float, float]:
    """The likeliest of all that is tried on the way to the interval's ends; what is likely; these.

    A search ends in the valley it began in. One that is likelier beside another restitution is
    where the next look begins.
    """
    sought = found.likelihood.sought
    at, number = sought.index("restitution"), NUMBERS["restitution"]
    for _ in range(LOOKS):
        level = 0.5 * SQUARE_95 * max(1.0, inflation(found, at))
        (low, down), (high, up) = (_end(found, at, to, level) for to in (number.low, number.high))
        likely = [*reversed(down), *up]
        best = min(likely, key=lambda trial: log_ratio(found, trial), default=found)
        if log_ratio(found, best) > -LIKELIER:
            break
        found = freed(best, sought)
    return found, likely, low, high


def _at(found: Candidate, bounce: float) -> FitSolution:
    """The other numbers sought anew beside a restitution."""
    names = tuple(name for name in found.likelihood.sought if name != "restitution")
    values = found.likelihood.values(found.x) | {"restitution": bounce}
    return search(continued(found, names, values))


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
    steady = len(trial.likelihood.holds) == len(found.likelihood.holds)
    return steady and log_ratio(found, trial) < level


def _along(fixed: FitSolution, likely: list[FitSolution]) -> FloatArray:
    """By how much what was sought, ``(n,)``, changes with one standard error of a restitution.

    Where landings pass samples it does not change along a line: the furthest of all that is likely
    counts, with the sign of what changes from the least restitution to the largest.
    """
    found = [one.x - fixed.x for one in likely if one.x.size == fixed.x.size]
    if not found:
        return np.zeros(fixed.x.size)
    furthest = np.abs(found).max(axis=0) / WITHIN_95
    return np.asarray(np.copysign(furthest, found[-1] - found[0]))

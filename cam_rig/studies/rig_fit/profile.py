"""How sure a restitution is, by the profile of its likelihood, and what that adds to the others.

A sample of force that comes to lie in a bounce changes the residuals at once, so along the
restitution the likelihood is level here and steep there: its curvature at one place does not say
how wide it is. The ratio of likelihoods does, the other numbers sought anew at each restitution.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cam_rig.studies.rig_fit.bounces import SMALL_BOUNCE, SQUARE_95, WITHIN_95
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


def profiled(found: FitSolution) -> FitSolution:
    """The same in the middle of the restitution's interval of 95 %, its errors those of that.

    Of two masses there is none: their bounces depend on every number at once. What was found
    beside the search keeps its own error, and those of the other numbers learn of it.
    """
    like = found.likelihood
    if "roller_share" in like.values(found.x) or not any(landings_of(found)):
        return found
    if "restitution" not in like.sought:
        return found if found.bounce is None else _beside(found, *found.bounce)
    at = like.sought.index("restitution")
    likeliest = float(found.x[at])
    level = 0.5 * SQUARE_95 * max(1.0, inflation(found, at))
    low, high = (_end(found, likeliest, to, level) for to in _limits())
    # Near none, none is said: what is known is the end.
    middle = 0.5 * (low + high) if likeliest >= SMALL_BOUNCE else 0.0
    fixed = _at(found, middle)
    if len(fixed.likelihood.holds) < len(like.holds):
        return found
    error = (high - middle) / WITHIN_95
    along = np.insert(_along(fixed, middle, error), at, error)
    start = continued(fixed, like.sought, fixed.likelihood.values(fixed.x))
    new = replace(start.likelihood, kept=fixed.likelihood.kept, pressing=fixed.likelihood.pressing)
    return replace(
        found,
        likelihood=new,
        x=start.x,
        slopes=new.slopes(start.x),
        residuals=new.residuals(start.x),
        along=along,
    )


def _beside(found: FitSolution, bounce: float, error: float) -> FitSolution:
    """The same, its errors with that of a restitution that is not among what was sought."""
    return replace(found, along=_along(found, bounce, error))


def _limits() -> tuple[float, float]:
    number = NUMBERS["restitution"]
    return number.low, number.high


def _at(found: Candidate, bounce: float) -> FitSolution:
    """The other numbers sought anew beside a restitution."""
    names = tuple(name for name in found.likelihood.sought if name != "restitution")
    values = found.likelihood.values(found.x) | {"restitution": bounce}
    return search(continued(found, names, values))


def _end(found: FitSolution, inside: float, limit: float, level: float) -> float:
    """The last restitution towards ``limit`` that is likely: by a log ratio below ``level``."""
    near: FitSolution = found
    step, outside = FIRST_STEP, None
    while outside is None and inside != limit:
        there = inside + np.sign(limit - inside) * min(step, abs(limit - inside))
        trial = _at(near, float(there))
        if _likely(found, trial, level):
            inside, near, step = float(there), trial, 2.0 * step
        else:
            outside = float(there)
    for _ in range(HALVINGS if outside is not None else 0):
        assert outside is not None
        trial = _at(near, 0.5 * (inside + outside))
        if _likely(found, trial, level):
            inside, near = 0.5 * (inside + outside), trial
        else:
            outside = 0.5 * (inside + outside)
    return inside if outside is None else outside


def _likely(found: FitSolution, trial: FitSolution, level: float) -> bool:
    """Whether every hold stays steady and the ratio of likelihoods is near one."""
    steady = len(trial.likelihood.holds) == len(found.likelihood.holds)
    return steady and log_ratio(found, trial) < level


def _along(fixed: FitSolution, bounce: float, error: float) -> np.ndarray:
    """By how much what was sought, ``(n,)``, changes with one standard error of a restitution."""
    low, high = _limits()
    ends = [min(max(bounce + side * error, low), high) for side in (-1.0, 1.0)]
    found = [_at(fixed, end) for end in ends]
    if any(one.x.size != fixed.x.size for one in found) or ends[0] == ends[1]:
        return np.zeros(fixed.x.size)
    return np.asarray((found[1].x - found[0].x) * error / (ends[1] - ends[0]))

"""The restitution: bounces make valleys of the likelihood, so it is looked for all over first."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.studies.rig_fit.likelihood import FAR, Likelihood, Predicted
from cam_rig.studies.rig_fit.search import (
    FIRST_GUARD,
    Solution,
    continued,
    landings_of,
    log_ratio,
    search,
)

#: Restitutions tried; a search that ends so near to the likeliest of them is in its valley, and so
#: many valleys are looked into at most.
BOUNCES = (1e-3, *(0.025 * k for k in range(1, 37)))
VALLEY, MOST_VALLEYS = 0.03, 3
#: Steps to the phase of a hold that goes with a restitution, and one of the angle (rad).
PHASE_STEPS, ANGLE_STEP = 4, 1e-6
#: Of a sum of squares, what 95 % of one number's errors stay below.
SQUARE_95 = 3.84


def with_bounces(found: Solution, given: dict[str, float]) -> Solution:
    """The restitution beside the other numbers; again until a search ends where it is likeliest."""
    if "restitution" in given:
        values = found.likelihood.values(found.x)
        return search(*continued(found, found.likelihood.sought, values))
    names = [name for name in found.likelihood.sought if name != "restitution"]
    best, before = found, math.inf
    for _ in range(MOST_VALLEYS):
        new, x = _likeliest(best, (*names, "restitution"))
        bounce = new.values(x)["restitution"]
        if abs(bounce - before) <= VALLEY:
            break
        trial = search(new, x)
        if math.isfinite(before) and log_ratio(trial, best) <= 0.0:
            break
        best, before = trial, trial.likelihood.values(trial.x)["restitution"]
    return best


def _likeliest(found: Solution, sought: tuple[str, ...]) -> tuple[Likelihood, FloatArray]:
    """The restitution of `BOUNCES`, and the phases with it, that come nearest at the landings.

    The other numbers stay.
    """
    values = found.likelihood.values(found.x)
    best: tuple[float, tuple[Likelihood, FloatArray]] | None = None
    for bounce in BOUNCES:
        new, x = continued(found, sought, values | {"restitution": bounce})
        new.keep_clear(x, FIRST_GUARD)
        missed = 0.0
        for i, landings in enumerate(landings_of(new, x)):
            if landings:
                x[new.instruments.phases.start + i], off = _phase(new, x, i)
                missed += off
        if best is None or missed < best[0]:
            best = missed, (new, x)
    assert best is not None
    return best[1]


def _phase(likelihood: Likelihood, x: FloatArray, i: int) -> tuple[float, float]:
    """The phase (rad) of a hold that goes with its turn, and what is missed a sample."""
    predicted, hold = likelihood.predicted(x, i), likelihood.holds[i]
    phase = float(x[likelihood.instruments.phases][i])
    if predicted is None:
        return phase, FAR**2
    lift = hold.lift.value.size > 0
    measured = hold.lift.value if lift else hold.force.value[likelihood.kept[i]]
    noise = likelihood.lift_noise if lift else likelihood.force_deviation(i)
    moved, off = 0.0, np.empty(0)
    for _ in range(PHASE_STEPS):
        off = (_shown(likelihood, x, predicted, moved, lift) - measured) / noise
        beside = (_shown(likelihood, x, predicted, moved + ANGLE_STEP, lift) - measured) / noise
        rise = (beside - off) / ANGLE_STEP
        moved -= float(rise @ off) / max(float(rise @ rise), 1e-300)
    return phase + moved, float(off @ off) / max(off.size, 1)


def _shown(
    likelihood: Likelihood, x: FloatArray, predicted: Predicted, moved: float, lift: bool
) -> FloatArray:
    if lift:
        return predicted.turn.at(predicted.lift_angle + moved)[0] + likelihood.single(x, "zero")
    return predicted.turn.at(predicted.force_angle + moved)[1]


def most_bounce(found: Solution) -> float:
    """The restitution beyond which what was measured is not likely any more, with 95 %."""
    likelihood, sought = found.likelihood, found.likelihood.sought
    at, least = sought.index("restitution"), float(found.residuals @ found.residuals)
    x = found.x.copy()
    for bounce in BOUNCES:
        x[at] = bounce
        residuals = likelihood.residuals(x)
        if float(residuals @ residuals) > least + SQUARE_95:
            return bounce
    return BOUNCES[-1]

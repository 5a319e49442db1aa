"""Interval of the restitution by its profile likelihood.

A force sample that enters a bounce changes the residuals abruptly, so along the restitution the
likelihood has plateaus and steps. Its curvature at a point is no measure of its width. The
likelihood ratio is one. The other parameters are searched for again at each restitution.
"""

from __future__ import annotations

import math
from dataclasses import replace

from cam_rig.studies.fit_rig.estimate import NORMAL_95
from cam_rig.studies.fit_rig.parameters import PARAMETERS
from cam_rig.studies.fit_rig.run.covariance import variance_inflation
from cam_rig.studies.fit_rig.run.force_zero import MIN_FLYING_SAMPLES, forces_in_flight
from cam_rig.studies.fit_rig.run.likelihood_ratio import log_ratio, log_ratio_of_all
from cam_rig.studies.fit_rig.run.restitution_start import CHI_SQUARED_95, free_restitution
from cam_rig.studies.fit_rig.run.search import (
    FIRST_GUARD,
    Candidate,
    FitSolution,
    continue_from,
    search,
)

#: First step from the likeliest restitution (absolute, no unit). Each further step is twice as
#: long.
FIRST_STEP = 0.01
#: Number of bisections of the last step. They locate the end of the interval to an eighth of that
#: step.
HALVINGS = 3
#: Largest number of searches for the interval. Each starts from the best restitution of the
#: previous search.
MAX_RESTARTS = 4
#: Smallest log likelihood ratio by which another restitution must be better to start another
#: search.
MIN_RESTART_LOG_RATIO = 1.0
#: Allowance of a log likelihood ratio for one sample on the wrong side of a landing, with a
#: residual of three standard deviations.
SAMPLE_LOG_RATIO = 0.5 * 3.0**2
#: Restitutions over the whole range that are tested after the search for the interval, if they are
#: outside the interval.
OTHER_RESTITUTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)
#: Smallest restitution that is reported with a value. For a smaller restitution only the upper
#: limit is reported.
SMALL_BOUNCE = 0.02


def profile_restitution(fit: FitSolution) -> FitSolution:
    """Return the fit with the restitution in the middle of its interval of 95 %.

    The other parameters are fitted to the samples that no bounce affects. Two masses have no such
    interval, because their bounces depend on every parameter at once.
    """
    if "roller_share" in fit.values or not any(fit.landings):
        return fit
    bounce = None
    if "restitution" in fit.likelihood.free:
        fit, low, high = _restitution_interval(fit)
        value = fit.values["restitution"]
        # A restitution near 0 is reported as 0: only the upper limit is known.
        middle = 0.5 * (low + high) if value >= SMALL_BOUNCE else 0.0
        bounce = middle, (high - middle) / NORMAL_95
        fit = _fit_at(fit, middle)
    return replace(search(_without_landings(fit)), bounce=bounce)


def _without_landings(fit: FitSolution) -> Candidate:
    """Return a candidate for a fit of the samples that no bounce affects.

    The force's zero is free if these samples identify it. Late in a series of bounces a landing
    passes samples within a standard error of a parameter. The sum of squares is discontinuous
    there, and its curvature is that of a narrow local minimum.
    """
    start = Candidate(fit.likelihood.without_landings(fit.x, FIRST_GUARD), fit.x)
    has_flying_samples = forces_in_flight(start).size >= MIN_FLYING_SAMPLES
    zero_offset = fit.likelihood.zero_offset and has_flying_samples
    return continue_from(start, fit.likelihood.free, fit.values, zero_offset=zero_offset)


def _restitution_interval(fit: FitSolution) -> tuple[FitSolution, float, float]:
    """Return the likeliest fit, and the limits of the restitution's interval.

    A search stops in a local maximum. If another restitution is likelier, the next search starts
    there (``test_error_of_restitution``, seed 27).
    """
    free = fit.likelihood.free
    index, number = free.index("restitution"), PARAMETERS["restitution"]
    for _ in range(MAX_RESTARTS):
        level = 0.5 * CHI_SQUARED_95 * max(1.0, variance_inflation(fit, index))
        (low, down), (high, up) = (
            _interval_end(fit, index, to, level) for to in (number.low, number.high)
        )
        best = min((*down, *up), key=lambda trial: log_ratio_of_all(fit, trial), default=fit)
        if log_ratio_of_all(fit, best) > -MIN_RESTART_LOG_RATIO:
            break
        fit = free_restitution(best, free)
    return fit, *_widen(fit, index, low, high, level)


def _widen(
    fit: FitSolution, index: int, low: float, high: float, level: float
) -> tuple[float, float]:
    """Return the restitution's interval, extended to equally likely values outside it.

    If hardly a sample is in a bounce, the likelihood is nearly constant, and the best of its many
    narrow maxima is likelier by chance. A maximum outweighs the whole range of the restitution only
    if its log ratio exceeds the logarithm of the ratio of their widths. Case: a restitution next to
    the end of a narrow interval (``test_flights_identify_the_restitution``).
    """
    number = PARAMETERS["restitution"]
    min_width = FIRST_STEP / 2.0**HALVINGS
    outweighs = level + math.log((number.high - number.low) / max(high - low, min_width))
    others = [
        other
        for other in OTHER_RESTITUTIONS
        if not low <= other <= high and _is_likely(fit, _fit_at(fit, other), outweighs)
    ]
    return min([low, *others]), max([high, *others])


def _fit_at(fit: Candidate, restitution: float) -> FitSolution:
    return search(continue_from(fit, fit.smooth, fit.values | {"restitution": restitution}))


def _interval_end(
    fit: FitSolution, index: int, limit: float, level: float
) -> tuple[float, list[FitSolution]]:
    """Return the last likely restitution towards ``limit``, and the likely trial fits.

    A trial is likely if its log ratio is below ``level``.
    """
    inside = float(fit.x[index])
    likely = list[FitSolution]()
    step, outside, halvings = FIRST_STEP, None, HALVINGS
    while inside != limit and (outside is None or halvings > 0):
        if outside is None:
            trial_value = inside + math.copysign(min(step, abs(limit - inside)), limit - inside)
        else:
            trial_value, halvings = 0.5 * (inside + outside), halvings - 1
        trial = _fit_at(likely[-1] if likely else fit, trial_value)
        if _is_likely(fit, trial, level):
            inside, step = trial_value, 2.0 * step
            likely.append(trial)
        else:
            outside = trial_value
    return inside if outside is None else outside, likely


def _is_likely(fit: FitSolution, trial: FitSolution, level: float) -> bool:
    """Return True if a trial fit is about as likely as a fit.

    Every segment must be periodic, and the log ratio below ``level``. A single sample may be on
    either side of a landing by chance. This alone does not end the interval.
    """
    if len(trial.segments) < len(fit.segments) or log_ratio(fit, trial) >= level:
        return False
    return log_ratio_of_all(fit, trial) < level + SAMPLE_LOG_RATIO

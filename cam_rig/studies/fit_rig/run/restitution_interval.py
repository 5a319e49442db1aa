"""95 % interval of the coefficient of restitution, by its profile likelihood.

A force sample changes its residual abruptly when it enters or leaves a bounce. As a function of the
restitution, the likelihood therefore has plateaus and steps, and its curvature at the maximum does
not measure the uncertainty. The interval consists of the restitutions whose likelihood ratio to the
best fit is small. At each restitution the other parameters are fitted again.
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

#: First step of the restitution (dimensionless) from its likeliest value in the search for an end
#: of the interval. Each further step is twice as long.
FIRST_STEP = 0.01
#: Number of bisections of the last step in the search for an end of the interval. They locate the
#: end within an eighth of that step.
HALVINGS = 3
#: Largest number of searches for the interval. Each starts from the best restitution that the
#: previous search tried.
MAX_RESTARTS = 4
#: Smallest log likelihood ratio by which another restitution must be better than the fit to start
#: another search from it.
MIN_RESTART_LOG_RATIO = 1.0
#: Additional log likelihood ratio that is tolerated in a comparison of restitutions: one sample may
#: be on the wrong side of a landing by chance, with a residual of three standard deviations.
SAMPLE_LOG_RATIO = 0.5 * 3.0**2
#: Restitutions over the whole range. Those outside the interval are tested after the search,
#: because an equally likely value may be separated from the interval.
OTHER_RESTITUTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)
#: Smallest restitution that is reported with a value. A smaller restitution is reported as 0 with
#: an upper limit.
SMALL_BOUNCE = 0.02


def profile_restitution(fit: FitSolution) -> FitSolution:
    """Return the fit with the restitution in the middle of its 95 % interval.

    The other parameters are fitted to the samples that no bounce affects. A fit of two masses is
    returned unchanged, because their bounces depend on every parameter at once. A fit without
    landings is returned unchanged too.
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
    """Return a start for a fit to the samples that no bounce affects.

    The zero offset of the force is a free parameter if these samples identify it. The samples in
    bounces are left out for this reason: late in a series of bounces, a change of a parameter by
    less than its standard error moves a landing past a sample. The sum of squares is discontinuous
    there, and its curvature is that of a narrow local minimum.
    """
    start = Candidate(fit.likelihood.without_landings(fit.x, FIRST_GUARD), fit.x)
    has_flying_samples = forces_in_flight(start).size >= MIN_FLYING_SAMPLES
    zero_offset = fit.likelihood.zero_offset and has_flying_samples
    return continue_from(start, fit.likelihood.free, fit.values, zero_offset=zero_offset)


def _restitution_interval(fit: FitSolution) -> tuple[FitSolution, float, float]:
    """Return the likeliest fit, and the lower and upper end of the 95 % interval.

    The interval is that of the restitution. A search may stop in a local maximum of the likelihood.
    If a trial restitution is likelier than the fit, the next search starts there
    (``test_error_of_restitution``, seed 27).
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
    """Return the interval of the restitution, extended to likely values outside it.

    ``low`` and ``high`` are the ends of the interval, and ``level`` is the log likelihood ratio at
    its ends. ``index`` is that of the restitution among the search variables. If few samples are in
    a bounce, the likelihood is nearly constant, and the best of its many narrow maxima is best only
    by chance. A maximum outweighs the whole range of the restitution only if its log ratio exceeds
    the logarithm of the ratio of their widths. Case: a restitution next to the end of a narrow
    interval (``test_flights_identify_the_restitution``).
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
    """Fit the other free parameters of a fit to a run, at a fixed restitution."""
    return search(continue_from(fit, fit.smooth, fit.values | {"restitution": restitution}))


def _interval_end(
    fit: FitSolution, index: int, limit: float, level: float
) -> tuple[float, list[FitSolution]]:
    """Return one end of the restitution's interval, and the trial fits inside it.

    The trials move from the fit's restitution towards ``limit``. A trial is inside the interval if
    its log likelihood ratio is below ``level``. ``index`` is that of the restitution among the
    search variables.
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
    """Return True if a trial fit is nearly as likely as a given fit.

    Every steady-speed segment must have a periodic motion, and the log ratio must be below
    ``level``. A single sample may be on either side of a landing by chance. The limit that includes
    such samples is therefore higher by `SAMPLE_LOG_RATIO`.
    """
    if len(trial.segments) < len(fit.segments) or log_ratio(fit, trial) >= level:
        return False
    return log_ratio_of_all(fit, trial) < level + SAMPLE_LOG_RATIO

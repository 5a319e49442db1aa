"""Choice of the model: one mass, vibrating force sensor, or masses with a stem.

Each search starts from the result of the previous one, and the likelier model is chosen. Then the
profile likelihood of the restitution is computed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.show.result import Progress
from cam_rig.studies.fit_rig.numbers import NUMBERS, ONE_MASS, TWO_MASS_ONLY, TWO_MASSES, WITHIN_95
from cam_rig.studies.fit_rig.residuals import BACKLASH, RATIO, RESONANCE, ZERO
from cam_rig.studies.fit_rig.search import (
    FIRST_GUARD,
    Candidate,
    FitSolution,
    continue_from,
    contradicts,
    design_matrix,
    log_ratio,
    log_ratio_of_all,
    search,
    uncertainty,
    variance_inflation,
)
from cam_rig.studies.fit_rig.start import (
    MIN_FLYING_SAMPLES,
    SMALL_BOUNCE,
    SQUARE_95,
    add_zero_offset,
    estimate_restitution,
    find_stem,
    find_zero_in_flight,
    forces_in_flight,
    free_restitution,
    has_pattern,
    pattern,
    search_restitution,
)
from cam_rig.units import TURN

AnyCandidate = TypeVar("AnyCandidate", bound=Candidate)
#: Log likelihood ratio above which an elastic model replaces a simpler one.
MIN_ELASTIC_LOG_RATIO = 30.0
#: Size of a gauge's backlash in standard errors above which it is a free parameter.
MIN_BACKLASH_ERRORS = 6.0
#: Smallest backlash relative to the lift. Less is rounding.
MIN_BACKLASH_FRACTION = 1e-7
#: Ratio of two pattern strengths up to which both are of the same noise.
MAX_PATTERN_RATIO = 2.0
#: Restitutions from which a fit of lifts alone starts.
START_RESTITUTIONS = (0.05, 0.25, 0.45, 0.65)


def fit_one_mass(aligned: FitSolution, fixed: dict[str, float]) -> FitSolution:
    """Return one rigid mass. The restitution is free if there are landings."""
    if not _has_force(aligned):
        return _fit_lifts(aligned, fixed)
    still = _fit_in_contact(aligned, _without_restitution(fixed), _start_values(aligned, fixed))
    fit = _fit_all(aligned, still, fixed)
    if _has_backlash(fit):
        start = continue_from(fit, fit.likelihood.free, fit.values, backlash=True)
        fit = replace(search(start), bounce=fit.bounce)
    return still if still is not None and contradicts(still, fit) else fit


def _without_restitution(
    fixed: dict[str, float], names: tuple[str, ...] = ONE_MASS
) -> tuple[str, ...]:
    return tuple(name for name in names if name not in fixed and name != "restitution")


def _start_values(aligned: FitSolution, fixed: dict[str, float]) -> dict[str, float]:
    return aligned.values | {"restitution": 0.0} | fixed


def _fit_in_contact(
    one_mass: Candidate, free: tuple[str, ...], values: dict[str, float]
) -> FitSolution | None:
    """Return one mass fitted to the speeds in contact only.

    The result is None if all speeds are in contact, or these speeds have no force.
    """
    indices = _contact_segments(one_mass)
    if len(indices) == len(one_mass.segments) or not _has_force(one_mass, indices):
        return None
    return search(continue_from(one_mass, free, values, indices, zero_offset=False))


def _fit_all(
    aligned: FitSolution, still: FitSolution | None, fixed: dict[str, float]
) -> FitSolution:
    """Return one rigid mass at all speeds.

    The search starts from the fit of the speeds without landings, if there is one.
    """
    start = _extend(aligned, still) if still is not None else None
    if start is None or not any(start.landings):
        fit = search(
            start
            or continue_from(aligned, _without_restitution(fixed), _start_values(aligned, fixed))
        )
        if not any(fit.landings):
            return fit
        start = fit
    return search_restitution(add_zero_offset(start), fixed)


def _extend(one_mass: Candidate, still: FitSolution) -> Candidate:
    """Return the solution of some speeds as a candidate for all segments of ``one``.

    The phases of all segments are on the line through those of some, ψ = a + b ω t. A single
    segment gives no line. All phases are then shifted by the change of its phase.
    """
    like = still.likelihood
    start = continue_from(
        one_mass, like.free, still.values, resonance=like.resonance, zero_offset=like.zero_offset
    )
    new, x = start.likelihood, start.x
    phases = np.unwrap(still.x[like.instruments.phases])
    if phases.size > 1:
        line = np.linalg.lstsq(design_matrix(still), phases, rcond=None)[0]
        x[new.instruments.phases] = design_matrix(start) @ line
    else:
        index = new.instruments.phases.start + new.segments.index(still.segments[0])
        x[new.instruments.phases] += phases[0] - x[index]
    for name, index in new.instruments.index.items():
        x[index] = like.single(still.x, name)
    return start


def _contact_segments(fit: Candidate) -> list[int]:
    """Return the indices of the segments in which the follower stays on the cam.

    The forces are used too. On a stem a follower leaves a cam with acceleration steps at lower
    speeds than a rigid mass.
    """
    still = [i for i, landings in enumerate(fit.landings) if not landings]
    return [i for i in still if fit.segments[i].presses] or still


def _has_force(fit: Candidate, segments: list[int] | None = None) -> bool:
    indices = range(len(fit.segments)) if segments is None else segments
    return any(fit.segments[i].force.value.size for i in indices)


def _fit_lifts(aligned: FitSolution, fixed: dict[str, float]) -> FitSolution:
    """Return one rigid mass fitted to lifts alone.

    Flights and bounces are identifiable together or not at all. The search therefore starts from
    several restitutions, and the best result is returned.
    """
    free = tuple(name for name in ONE_MASS if name not in fixed)
    bounces = [fixed["restitution"]] if "restitution" in fixed else START_RESTITUTIONS
    values = _start_values(aligned, fixed)
    fits = [search(continue_from(aligned, free, values | {"restitution": b})) for b in bounces]
    steady = [fit for fit in fits if len(fit.steady) == len(fit.segments)]
    if not steady:
        raise ConfigError(
            "no follower fits the lifts with a periodic motion at every speed; "
            "needed: a contact force too, or speeds at which it bounces less"
        )
    return min(steady, key=lambda fit: fit.likelihood.lift_noise)


def _search_two_masses(
    one_mass: Candidate, still: Candidate, stem: dict[str, float], fixed: dict[str, float]
) -> FitSolution:
    """Return two masses, from a stem and one mass ``still`` fitted to some speeds."""
    free = _without_restitution(fixed, TWO_MASSES)
    start = still.values | {"restitution": fixed.get("restitution", 0.0)} | stem | fixed
    quiet = _fit_two_masses_in_contact(still, free, start)
    if quiet is None:
        fit = search(continue_from(one_mass, free, start))
        if "restitution" not in fixed and any(fit.landings):
            fit = search_restitution(fit, fixed)
        return fit
    return quiet if "restitution" in fixed else _add_restitution(one_mass, quiet)


def _add_restitution(one_mass: Candidate, quiet: FitSolution) -> FitSolution:
    """Return the solution in contact, with the restitution of the speeds with flights."""
    if len(quiet.segments) == len(one_mass.segments):
        return quiet
    flying = _extend(one_mass, quiet)
    if not any(flying.landings):
        return quiet
    rings = any(segment.rings for segment in flying.segments)
    zero = None if rings else find_zero_in_flight(flying)
    return replace(quiet, bounce=estimate_restitution(flying) if zero is None else None, zero=zero)


def _fit_two_masses_in_contact(
    still: Candidate, free: tuple[str, ...], start: dict[str, float]
) -> FitSolution | None:
    """Return two masses at the speeds without landings, or None if there is no force.

    Bounces on a stem depend on every parameter at once, and their likelihood has a local maximum
    for each. Its curvature there does not identify the others. On the cam the motion is linear. The
    fastest speed is left out while the force residual has a pattern. The speeds left out may have
    led to a wrong stem, so a stem is also searched for without them. A pattern that is as strong
    with fewer speeds is that of correlated noise, not of flights. The largest number of speeds with
    it is therefore kept.
    """
    indices, tried = _contact_segments(still), list[FitSolution]()
    while _has_force(still, indices):
        fit = search(continue_from(still, free, start, indices, zero_offset=False))
        if len(indices) < len(still.segments):
            fit = _restart_from_stem(still, fit, indices)
        start, flying = fit.values, fit.landings
        if any(flying):
            indices, tried = (
                [i for i, landings in zip(indices, flying, strict=True) if not landings],
                [],
            )
            continue
        tried.append(fit)
        if len(indices) == 1 or not has_pattern(fit):
            limit = MAX_PATTERN_RATIO * _pattern_strength(fit)
            return next(trial for trial in tried if _pattern_strength(trial) <= limit)
        fastest = max(indices, key=lambda i: still.segments[i].speed)
        indices = [i for i in indices if i != fastest]
    return None


def _pattern_strength(fit: Candidate) -> float:
    squares, parts = pattern(fit)
    return squares / max(parts, 1.0)


def _restart_from_stem(still: Candidate, fit: FitSolution, indices: list[int]) -> FitSolution:
    """Return two masses at some segments: the solution, or a likelier one.

    The other search starts from the stem that clearly improves one mass at these segments.
    """
    rigid = search(continue_from(still, still.smooth, still.values, indices, zero_offset=False))
    stem, gain = find_stem(rigid)
    if gain < MIN_ELASTIC_LOG_RATIO:
        return fit
    free = fit.likelihood.free
    begin = rigid.values | stem | fit.likelihood.fixed
    other = search(continue_from(still, free, begin, indices, zero_offset=False))
    return other if log_ratio(other, fit) > 0.0 else fit


def _search_resonance(one_mass: FitSolution, stem: dict[str, float]) -> FitSolution:
    values = one_mass.values
    end = values["mass"] * (1.0 - stem["roller_share"])
    rate = math.sqrt((stem["stem_stiffness"] + values["spring_stiffness"]) / end)
    start = continue_from(one_mass, one_mass.likelihood.free, values, resonance=True)
    index = start.likelihood.instruments.index
    start.x[index[RESONANCE]] = math.log(rate / TURN)
    start.x[index[RATIO]] = 0.5 * stem["stem_damping"] / (end * rate)
    return replace(search(start), bounce=one_mass.bounce)


def fit_two_masses(
    aligned: FitSolution, fixed: dict[str, float], progress: Progress
) -> FitSolution:
    """Return two masses and a stem, if this model is requested.

    One mass is searched for only as far as the start requires.
    """
    rigid = {name: value for name, value in fixed.items() if name not in TWO_MASS_ONLY}
    still = _fit_in_contact(aligned, _without_restitution(rigid), _start_values(aligned, rigid))
    one_mass = fit_one_mass(aligned, rigid) if still is None else _extend(aligned, still)
    begin = _with_pattern(one_mass)
    progress.describe("two masses and a stem")
    return _search_two_masses(one_mass, begin, find_stem(begin)[0], fixed)


def fit_elastic(one_mass: FitSolution, fixed: dict[str, float], progress: Progress) -> FitSolution:
    """Return the likeliest of one mass, a vibrating force sensor, and a stem.

    The vibration is identified at the speeds in contact, if it is visible there. Bounces of a rigid
    mass on data of an elastic stem identify nothing.
    """
    if any(segment.rings for segment in one_mass.segments):
        progress.describe("a resonance of the force sensor")
        return _fit_ringing(one_mass)
    if not has_pattern(one_mass):
        return one_mass
    still = _with_pattern(one_mass)
    stem, gain = find_stem(still)
    if gain < MIN_ELASTIC_LOG_RATIO:
        return one_mass
    best = one_mass
    progress.describe("a resonance of the force sensor")
    sensor = _search_resonance(still, stem)
    if not has_pattern(sensor):
        sensor = sensor if still is one_mass else _search_resonance(one_mass, stem)
        if log_ratio(sensor, one_mass) > MIN_ELASTIC_LOG_RATIO:
            best = sensor
            if not has_pattern(sensor):
                return sensor
    progress.describe("two masses and a stem")
    two = _search_two_masses(one_mass, still, stem, fixed)
    return two if log_ratio(two, best) > MIN_ELASTIC_LOG_RATIO else best


def _with_pattern(one_mass: AnyCandidate) -> AnyCandidate | FitSolution:
    """Return one mass at the speeds in contact, if its force residual has a pattern."""
    calm = _fit_in_contact(one_mass, one_mass.smooth, one_mass.values)
    return one_mass if calm is None or not has_pattern(calm) else calm


def _fit_ringing(one_mass: FitSolution) -> FitSolution:
    """Return one mass under a force sensor that shows pulls.

    No cam pulls, so no stem is searched for. The speeds in contact are used, because a landing
    excites the sensor for the rest of the turn.
    """
    likelier = calm = _fit_in_contact(one_mass, one_mass.smooth, one_mass.values) or one_mass
    if has_pattern(calm):
        sensor = _search_resonance(calm, find_stem(calm)[0])
        likelier = sensor if log_ratio(sensor, calm) > MIN_ELASTIC_LOG_RATIO else calm
    return likelier if calm is one_mass else _add_restitution(one_mass, likelier)


def _has_backlash(fit: FitSolution) -> bool:
    """Return True if the lift residuals after rises and after falls differ."""
    if ZERO not in fit.likelihood.instruments.index:
        return False
    start = continue_from(fit, fit.likelihood.free, fit.values, backlash=True)
    new, x = start.likelihood, start.x
    slopes, residuals = new.slopes(x), new.residuals(x)
    index = new.instruments.index[BACKLASH]
    step, *_ = np.linalg.lstsq(slopes, -residuals, rcond=1e-12)
    error = uncertainty(FitSolution(new, x, slopes, residuals + slopes @ step)).errors[index]
    return bool(
        abs(step[index]) > max(MIN_BACKLASH_ERRORS * error, MIN_BACKLASH_FRACTION * new.law.lift)
    )


# Interval of the restitution by its profile likelihood. A force sample that enters a bounce changes
# the residuals abruptly, so along the restitution the likelihood has plateaus and steps. Its
# curvature at a point is no measure of its width. The likelihood ratio is one. The other parameters
# are searched for again at each restitution.

#: First step from the likeliest restitution. Each further step is twice the previous one.
FIRST_STEP = 0.01
#: Number of bisections of the last step.
HALVINGS = 3
#: Largest number of searches for the interval, each from the best restitution of the previous one.
MAX_RESTARTS = 4
#: Log likelihood ratio above which a better restitution starts another search.
MIN_RESTART_LOG_RATIO = 1.0
#: Change of a log ratio by one sample with a residual of three standard deviations.
SAMPLE_LOG_RATIO = 0.5 * 3.0**2
#: Restitutions outside a narrow interval that are compared with it.
OTHER_RESTITUTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)


def profile_restitution(fit: FitSolution) -> FitSolution:
    """Return the solution with the restitution in the middle of its interval of 95 %.

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
        bounce = middle, (high - middle) / WITHIN_95
        fit = _fit_at(fit, middle)
    return replace(search(_without_landings(fit)), bounce=bounce)


def _without_landings(fit: FitSolution) -> Candidate:
    """Return a candidate for the samples that no bounce affects.

    The force's zero is free if these samples identify it. Late in a series of bounces a landing
    passes samples within a standard error of a parameter. The sum of squares is discontinuous
    there, and its curvature is that of a narrow local minimum.
    """
    start = Candidate(fit.likelihood.without_landings(fit.x, FIRST_GUARD), fit.x)
    shown = forces_in_flight(start).size >= MIN_FLYING_SAMPLES
    zero_offset = fit.likelihood.zero_offset and shown
    return continue_from(start, fit.likelihood.free, fit.values, zero_offset=zero_offset)


def _restitution_interval(fit: FitSolution) -> tuple[FitSolution, float, float]:
    """Return the likeliest solution, and the limits of the restitution's interval.

    A search stops in a local maximum. If another restitution is likelier, the next search starts
    there.
    """
    free = fit.likelihood.free
    index, number = free.index("restitution"), NUMBERS["restitution"]
    for _ in range(MAX_RESTARTS):
        level = 0.5 * SQUARE_95 * max(1.0, variance_inflation(fit, index))
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
    """Return the interval, extended to equally likely restitutions outside it.

    If hardly a sample is in a bounce, the likelihood is nearly constant, and the best of its many
    narrow maxima is likelier by chance. A maximum outweighs the whole range of the restitution only
    if its log ratio exceeds the logarithm of the ratio of their widths.
    """
    number = NUMBERS["restitution"]
    least = FIRST_STEP / 2.0**HALVINGS
    outweighs = level + math.log((number.high - number.low) / max(high - low, least))
    others = [
        other
        for other in OTHER_RESTITUTIONS
        if not low <= other <= high and _is_likely(fit, _fit_at(fit, other), outweighs)
    ]
    return min([low, *others]), max([high, *others])


def _fit_at(fit: Candidate, bounce: float) -> FitSolution:
    return search(continue_from(fit, fit.smooth, fit.values | {"restitution": bounce}))


def _interval_end(
    fit: FitSolution, index: int, limit: float, level: float
) -> tuple[float, list[FitSolution]]:
    """Return the last likely restitution towards ``limit``, and the likely trials.

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
    """Return True if every segment is periodic and the log ratio is below ``level``.

    A single sample may be on either side of a landing by chance. This alone does not end the
    interval.
    """
    if len(trial.segments) < len(fit.segments) or log_ratio(fit, trial) >= level:
        return False
    return log_ratio_of_all(fit, trial) < level + SAMPLE_LOG_RATIO

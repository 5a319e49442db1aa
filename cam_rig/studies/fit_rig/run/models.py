"""Choice of the model of a run: one mass, vibrating force sensor, or two masses and a stem.

Each search starts from the result of the previous one, and the likelier model is chosen.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.show.result import Progress
from cam_rig.studies.fit_rig.parameters import ONE_MASS, TWO_MASS_ONLY, TWO_MASSES
from cam_rig.studies.fit_rig.run.covariance import sandwich_covariance
from cam_rig.studies.fit_rig.run.force_zero import add_zero_offset, find_zero_in_flight
from cam_rig.studies.fit_rig.run.instruments import BACKLASH, RATIO, RESONANCE, ZERO
from cam_rig.studies.fit_rig.run.likelihood_ratio import contradicts, log_ratio
from cam_rig.studies.fit_rig.run.restitution_start import estimate_restitution, search_restitution
from cam_rig.studies.fit_rig.run.search import (
    Candidate,
    FitSolution,
    continue_from,
    phase_line_matrix,
    search,
)
from cam_rig.studies.fit_rig.run.stem_start import find_stem, has_residual_pattern, residual_pattern
from cam_rig.units import TURN

AnyCandidate = TypeVar("AnyCandidate", bound=Candidate)
#: Smallest log likelihood ratio at which a model with an elastic stem, or with a vibrating force
#: sensor, replaces a rigid model. In the runs of ``test_rig_fit.py``, white and correlated noise
#: alone give up to 3, a stem or a resonance 90 or more.
MIN_ELASTIC_LOG_RATIO = 30.0
#: Smallest backlash of the lift gauge, in standard errors, at which it becomes a free parameter.
#: Normally distributed errors exceed six standard errors once in 5e8 fits.
FREE_BACKLASH_ERRORS = 6.0
#: Smallest backlash at which it becomes a free parameter, relative to the total lift. A smaller
#: backlash is rounding.
MIN_BACKLASH_FRACTION = 1e-7
#: Largest ratio of the repeating force residuals (see `residual_pattern`) of two fits at which they
#: are attributed to the same noise, not to a vibration.
MAX_PATTERN_RATIO = 2.0
#: Restitutions from which a fit to lifts without forces is started, one search each.
START_RESTITUTIONS = (0.05, 0.25, 0.45, 0.65)


def fit_one_mass(aligned: FitSolution, fixed: dict[str, float]) -> FitSolution:
    """Fit one rigid mass to a run.

    ``aligned`` is the fit of the start values, and ``fixed`` are known values in SI. The
    restitution is a free parameter if the computed follower lands on the cam. If the fit to all
    speeds contradicts the speeds without flights, the fit to the latter is returned.
    """
    if not _has_force(aligned):
        return _fit_lifts(aligned, fixed)
    in_contact = _fit_in_contact(
        aligned, _without_restitution(fixed), _start_values(aligned, fixed)
    )
    fit = _fit_all(aligned, in_contact, fixed)
    if _has_backlash(fit):
        start = continue_from(fit, fit.likelihood.free, fit.values, backlash=True)
        fit = replace(search(start), bounce=fit.bounce)
    return in_contact if in_contact is not None and contradicts(in_contact, fit) else fit


def fit_two_masses(
    aligned: FitSolution, fixed: dict[str, float], progress: Progress
) -> FitSolution:
    """Fit two masses and a stem to a run, if the user has requested this model.

    ``aligned`` is the fit of the start values, and ``fixed`` are known values in SI. One rigid mass
    is fitted first, only to the extent required for the start values of the search.
    """
    rigid = {name: value for name, value in fixed.items() if name not in TWO_MASS_ONLY}
    in_contact = _fit_in_contact(
        aligned, _without_restitution(rigid), _start_values(aligned, rigid)
    )
    one_mass = (
        fit_one_mass(aligned, rigid) if in_contact is None else extend_solution(aligned, in_contact)
    )
    start = _in_contact_if_patterned(one_mass)
    progress.describe("two masses and a stem")
    return _search_two_masses(one_mass, start, find_stem(start)[0], fixed)


def fit_elastic(one_mass: FitSolution, fixed: dict[str, float], progress: Progress) -> FitSolution:
    """Return the likeliest of one rigid mass, a vibrating force sensor, and a stem.

    ``one_mass`` is the fit of the simplest model. The vibration is searched for at the speeds in
    contact, if the residuals show it there. At speeds with flights, a rigid mass does not fit the
    data of an elastic stem, and its residuals do not identify the stem.
    """
    if any(segment.rings for segment in one_mass.segments):
        progress.describe("a resonance of the force sensor")
        return _fit_ringing(one_mass)
    if not has_residual_pattern(one_mass):
        return one_mass
    in_contact = _in_contact_if_patterned(one_mass)
    stem, gain = find_stem(in_contact)
    if gain < MIN_ELASTIC_LOG_RATIO:
        return one_mass
    best = one_mass
    progress.describe("a resonance of the force sensor")
    sensor = _search_resonance(in_contact, stem)
    if not has_residual_pattern(sensor):
        sensor = sensor if in_contact is one_mass else _search_resonance(one_mass, stem)
        if log_ratio(sensor, one_mass) > MIN_ELASTIC_LOG_RATIO:
            best = sensor
            if not has_residual_pattern(sensor):
                return sensor
    progress.describe("two masses and a stem")
    two_masses = _search_two_masses(one_mass, in_contact, stem, fixed)
    return two_masses if log_ratio(two_masses, best) > MIN_ELASTIC_LOG_RATIO else best


# Fits of one rigid mass.


def _without_restitution(
    fixed: dict[str, float], names: tuple[str, ...] = ONE_MASS
) -> tuple[str, ...]:
    """Return the free parameters among ``names``, without the restitution.

    They are those that are not in ``fixed``.
    """
    return tuple(name for name in names if name not in fixed and name != "restitution")


def _start_values(aligned: FitSolution, fixed: dict[str, float]) -> dict[str, float]:
    return aligned.values | {"restitution": 0.0} | fixed


def _fit_in_contact(
    one_mass: Candidate, free: tuple[str, ...], values: dict[str, float]
) -> FitSolution | None:
    """Fit one mass to those speeds only at which the follower keeps contact.

    Returns None if contact is kept at all speeds, or if no force was measured at these speeds.
    """
    indices = _contact_segments(one_mass)
    if len(indices) == len(one_mass.segments) or not _has_force(one_mass, indices):
        return None
    return search(continue_from(one_mass, free, values, indices, zero_offset=False))


def _contact_segments(fit: Candidate) -> list[int]:
    """Return the indices of the steady speeds at which the follower keeps contact.

    A speed is included if the computed follower does not land and the measured force shows no loss
    of contact. The force is needed because a follower on an elastic stem leaves a cam with
    acceleration steps at lower speeds than a rigid mass
    (``test_a_stem_that_leaves_a_cam_of_arcs``). If the force excludes all speeds, only the computed
    follower decides.
    """
    in_contact = [i for i, landings in enumerate(fit.landings) if not landings]
    return [i for i in in_contact if fit.segments[i].presses] or in_contact


def _has_force(fit: Candidate, segments: list[int] | None = None) -> bool:
    """Return True if the run of a fit has a measured force at any steady speed.

    ``segments`` are the indices of the steady speeds to check, None for all.
    """
    indices = range(len(fit.segments)) if segments is None else segments
    return any(fit.segments[i].force.value.size for i in indices)


def _fit_all(
    aligned: FitSolution, in_contact: FitSolution | None, fixed: dict[str, float]
) -> FitSolution:
    """Fit one rigid mass to all speeds.

    The search starts from ``in_contact``, the fit to the speeds without landings, if there is one.
    If the follower lands at some speeds, the restitution is fitted too. ``aligned`` is the fit of
    the start values, and ``fixed`` are known values in SI.
    """
    if in_contact is None:
        free, values = _without_restitution(fixed), _start_values(aligned, fixed)
        start = continue_from(aligned, free, values)
    else:
        start = extend_solution(aligned, in_contact)
    if in_contact is None or not any(start.landings):
        start = fit = search(start)
        if not any(fit.landings):
            return fit
    return search_restitution(add_zero_offset(start), fixed)


def extend_solution(one_mass: Candidate, partial: FitSolution) -> Candidate:
    """Return a start at all speeds of ``one_mass`` from the solution at some of them.

    The phase ψ (cam angle minus encoder angle) of each speed follows the line ψ = a + b ω t through
    the known phases. If only one phase is known, all phases are shifted by its change. Case: speeds
    with flights next to speeds in contact (``test_a_partial_solution_is_extended_to_all_speeds``).
    """
    likelihood = partial.likelihood
    start = continue_from(
        one_mass,
        likelihood.free,
        partial.values,
        resonance=likelihood.resonance,
        zero_offset=likelihood.zero_offset,
    )
    new, x = start.likelihood, start.x
    phases = np.unwrap(partial.x[likelihood.instruments.phases])
    if phases.size > 1:
        line = np.linalg.lstsq(phase_line_matrix(partial), phases, rcond=None)[0]
        x[new.instruments.phases] = phase_line_matrix(start) @ line
    else:
        index = new.instruments.phases.start + new.segments.index(partial.segments[0])
        x[new.instruments.phases] += phases[0] - x[index]
    for name, index in new.instruments.index.items():
        x[index] = likelihood.single(partial.x, name)
    return start


def _fit_lifts(aligned: FitSolution, fixed: dict[str, float]) -> FitSolution:
    """Fit one rigid mass to lifts without forces.

    The flights depend on all parameters together, including the restitution. The search therefore
    starts from several restitutions, and the best result is returned. Raises a `ConfigError` if no
    result has a periodic motion at every speed. Case: lifts of a rig far from the start values
    (``test_lifts_identify_a_rig_far_from_the_start``). ``aligned`` is the fit of the start values,
    and ``fixed`` are known values in SI.
    """
    free = tuple(name for name in ONE_MASS if name not in fixed)
    bounces = [fixed["restitution"]] if "restitution" in fixed else START_RESTITUTIONS
    values = _start_values(aligned, fixed)
    fits = [search(continue_from(aligned, free, values | {"restitution": b})) for b in bounces]
    steady = [fit for fit in fits if len(fit.steady) == len(fit.segments)]
    if not steady:
        raise ConfigError(
            "no follower has a periodic motion at every speed that fits the lifts; record a "
            "contact force too, or speeds at which it bounces less"
        )
    return min(steady, key=lambda fit: fit.likelihood.lift_noise)


def _has_backlash(fit: FitSolution) -> bool:
    """Return True if the lift gauge has a significant backlash.

    The lift residuals after rises and after falls then differ. The backlash is estimated by one
    linear step. Case: a gauge with backlash, which otherwise changes the fitted damping
    (``test_backlash_is_identified``).
    """
    if ZERO not in fit.likelihood.instruments.index:
        return False
    start = continue_from(fit, fit.likelihood.free, fit.values, backlash=True)
    new, x = start.likelihood, start.x
    jacobian, residuals = new.jacobian(x), new.residuals(x)
    index = new.instruments.index[BACKLASH]
    step, *_ = np.linalg.lstsq(jacobian, -residuals, rcond=1e-12)
    linearised = FitSolution(new, x, jacobian, residuals + jacobian @ step)
    error = sandwich_covariance(linearised).errors[index]
    threshold = max(FREE_BACKLASH_ERRORS * error, MIN_BACKLASH_FRACTION * new.law.lift)
    return bool(abs(step[index]) > threshold)


# Fits with an elastic stem, or with a resonance of the force sensor.


def _in_contact_if_patterned(one_mass: AnyCandidate) -> AnyCandidate | FitSolution:
    """Return a refit to the speeds without flights, if its force residuals vibrate.

    The rigid mass of ``one_mass`` is fitted to the steady-speed segments in which the follower
    keeps contact. If this is not possible, or `has_residual_pattern` finds no vibration in the
    residuals of the force, ``one_mass`` is returned.
    """
    in_contact = _fit_in_contact(one_mass, one_mass.smooth, one_mass.values)
    return one_mass if in_contact is None or not has_residual_pattern(in_contact) else in_contact


def _search_two_masses(
    one_mass: Candidate,
    one_mass_in_contact: Candidate,
    stem: dict[str, float],
    fixed: dict[str, float],
) -> FitSolution:
    """Fit two masses and an elastic stem between them to a run.

    The search starts from the stem ``stem`` (SI by name) and from ``one_mass_in_contact``, the
    rigid mass fitted to the speeds without flights. The restitution is fitted afterwards.
    ``one_mass`` is the rigid mass fitted to all speeds, and ``fixed`` are known values in SI.
    """
    free = _without_restitution(fixed, TWO_MASSES)
    start = one_mass_in_contact.values | {"restitution": 0.0} | stem | fixed
    in_contact = _fit_two_masses_in_contact(one_mass_in_contact, free, start)
    if in_contact is None:
        fit = search(continue_from(one_mass, free, start))
        if "restitution" not in fixed and any(fit.landings):
            fit = search_restitution(fit, fixed)
        return fit
    return in_contact if "restitution" in fixed else _add_restitution(one_mass, in_contact)


def _add_restitution(one_mass: Candidate, in_contact: FitSolution) -> FitSolution:
    """Add an estimate of the restitution to a fit of the speeds without flights.

    ``in_contact`` is this fit. The restitution is estimated at the speeds with flights, with the
    other parameters fixed. If the flights show a zero offset of the force sensor, this offset is
    added instead. ``one_mass`` contains all speeds.
    """
    if len(in_contact.segments) == len(one_mass.segments):
        return in_contact
    flying = extend_solution(one_mass, in_contact)
    if not any(flying.landings):
        return in_contact
    rings = any(segment.rings for segment in flying.segments)
    zero = None if rings else find_zero_in_flight(flying)
    return replace(
        in_contact, bounce=estimate_restitution(flying) if zero is None else None, zero=zero
    )


def _fit_two_masses_in_contact(
    one_mass: Candidate, free: tuple[str, ...], start: dict[str, float]
) -> FitSolution | None:
    """Fit two masses to the speeds without landings, or return None without a force.

    Bounces on a stem depend on every parameter at once and cause many local maxima of the
    likelihood, so speeds with landings are left out. In contact the motion is linear. ``one_mass``
    is the fit of one rigid mass. ``free`` are the names of the free parameters, and ``start`` the
    start values of all parameters (SI).

    The fastest speed is left out as long as the force residuals have a pattern, because undetected
    flights cause one. The speeds that are left out may have led to a wrong start for the stem, so
    the stem is also searched for without them. If the pattern is as strong with fewer speeds, it is
    correlated noise. The fit with the most speeds of this pattern strength is then returned
    (``test_correlated_noise_of_the_force_drops_no_speed_on_the_cam``).
    """
    indices, trials = _contact_segments(one_mass), list[FitSolution]()
    while _has_force(one_mass, indices):
        fit = search(continue_from(one_mass, free, start, indices, zero_offset=False))
        if len(indices) < len(one_mass.segments):
            fit = _restart_from_stem(one_mass, fit, indices)
        start, flying = fit.values, fit.landings
        if any(flying):
            indices = [i for i, landings in zip(indices, flying, strict=True) if not landings]
            trials = []
            continue
        trials.append(fit)
        if len(indices) == 1 or not has_residual_pattern(fit):
            limit = MAX_PATTERN_RATIO * _pattern_strength(fit)
            return next(trial for trial in trials if _pattern_strength(trial) <= limit)
        fastest = max(indices, key=lambda i: one_mass.segments[i].speed)
        indices = [i for i in indices if i != fastest]
    return None


def _pattern_strength(fit: Candidate) -> float:
    """Return how strongly force residuals repeat from turn to turn.

    It is the statistic of `residual_pattern`, relative to its mean for white noise.
    """
    squares, parts = residual_pattern(fit)
    return squares / max(parts, 1.0)


def _restart_from_stem(one_mass: Candidate, fit: FitSolution, indices: list[int]) -> FitSolution:
    """Repeat a fit of two masses from another stem, and return the likelier fit.

    The other stem is searched for with one rigid mass at the same steady speeds ``indices``. It is
    used only if it clearly improves the fit of the rigid mass. Case: the first stem was searched
    for with flights (``test_a_stem_that_leaves_a_cam_of_arcs``, and ``test_errors_of_two_masses``,
    seed 179).
    """
    rigid = search(
        continue_from(one_mass, one_mass.smooth, one_mass.values, indices, zero_offset=False)
    )
    stem, gain = find_stem(rigid)
    if gain < MIN_ELASTIC_LOG_RATIO:
        return fit
    free = fit.likelihood.free
    values = rigid.values | stem | fit.likelihood.fixed
    other = search(continue_from(one_mass, free, values, indices, zero_offset=False))
    return other if log_ratio(other, fit) > 0.0 else fit


def _search_resonance(one_mass: FitSolution, stem: dict[str, float]) -> FitSolution:
    """Fit one mass with a resonance of the force sensor.

    The start values of frequency and damping are those of the stem ``stem`` (SI by name).
    """
    values = one_mass.values
    end_mass = values["mass"] * (1.0 - stem["roller_share"])
    rate = math.sqrt((stem["stem_stiffness"] + values["spring_stiffness"]) / end_mass)
    start = continue_from(one_mass, one_mass.likelihood.free, values, resonance=True)
    index = start.likelihood.instruments.index
    start.x[index[RESONANCE]] = math.log(rate / TURN)
    start.x[index[RATIO]] = 0.5 * stem["stem_damping"] / (end_mass * rate)
    return replace(search(start), bounce=one_mass.bounce)


def _fit_ringing(one_mass: FitSolution) -> FitSolution:
    """Return the fit of one rigid mass to a run whose force sensor vibrates.

    The sensor shows its vibration by negative forces: a cam cannot pull the follower. No elastic
    stem is fitted. Only the speeds without flights are used, because a landing excites the sensor
    for the rest of the turn. The resonance of the sensor is added if it improves the fit
    (``test_a_ringing_sensor_is_no_stem``).
    """
    likelier = in_contact = _fit_in_contact(one_mass, one_mass.smooth, one_mass.values) or one_mass
    if has_residual_pattern(in_contact):
        sensor = _search_resonance(in_contact, find_stem(in_contact)[0])
        likelier = sensor if log_ratio(sensor, in_contact) > MIN_ELASTIC_LOG_RATIO else in_contact
    return likelier if in_contact is one_mass else _add_restitution(one_mass, likelier)

"""Start value of the coefficient of restitution, from trials over its whole range.

Bounces cause many local maxima of the likelihood, and a search stops in the nearest. Restitutions
over the whole range are therefore tried before a search.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cam_rig.studies.fit_rig.run.instruments import FORCE_ZERO, ZERO
from cam_rig.studies.fit_rig.run.likelihood import NO_TURN_RESIDUAL, PredictedSegment
from cam_rig.studies.fit_rig.run.likelihood_ratio import MAX_SQUARE, log_ratio_of_all
from cam_rig.studies.fit_rig.run.search import Candidate, FitSolution, continue_from, search
from cam_rig.units import FloatArray

#: Restitutions of the first trials: nearly 0, then 0.025 to 0.9 in steps of 0.025.
COARSE_RESTITUTIONS = (1e-3, *(0.025 * k for k in range(1, 37)))
#: Number of equal steps of the second trials. They cover the likely first trials and their
#: neighbours.
FINE_RESTITUTION_STEPS = 16
#: Number of Gauss-Newton steps that fit the phase (cam angle minus encoder angle) of a steady-speed
#: segment in a trial of a restitution.
PHASE_STEPS = 4
#: Step of the phase (rad) of a steady-speed segment for the difference quotients of the
#: Gauss-Newton steps that fit the phase. The phase is the cam angle minus the encoder angle.
PHASE_DERIVATIVE_STEP = 1e-6
#: Largest mean squared residual, in squared standard deviations, at which a restitution explains
#: the flights to their noise. It is above 1 because of samples next to landings.
MAX_NOISE_SQUARES = 1.5
#: Largest excess of a trial's sum of squared residuals over that of the best trial at which its
#: restitution counts as likely. It is the 95 % quantile of χ² with one degree of freedom.
CHI_SQUARED_95 = 3.84
#: Smallest logarithm of the likelihood ratio by which a free restitution must improve a fit. The
#: tolerance of the search alone reaches 1e-7 if no landing depends on the restitution. A gain of
#: 1e-4 corresponds to a change by 0.014 standard errors.
MIN_LOG_RATIO = 1e-4


def search_restitution(fit: Candidate, fixed: dict[str, float]) -> FitSolution:
    """Fit the restitution and the other free parameters.

    The restitution is first tried over its whole range with the other values of the candidate
    ``fit``. The search starts from the likeliest. If ``fixed`` contains the restitution, only the
    other parameters are fitted. Case: several local maxima
    (``test_all_restitutions_are_tried_before_a_search``).
    """
    if "restitution" in fixed:
        return search(continue_from(fit, fit.likelihood.free, fit.values))
    trials, _, _ = _likely_restitutions(fit)
    middle = _try_restitution(fit, 0.5 * (trials[0].bounce + trials[-1].bounce))
    bounce = {"restitution": max(middle.bounce, COARSE_RESTITUTIONS[0])}
    start = continue_from(fit, fit.smooth, fit.values | bounce)
    start.x[start.likelihood.instruments.phases] = middle.phases
    return free_restitution(search(start), (*fit.smooth, "restitution"))


def free_restitution(fixed: FitSolution, free: tuple[str, ...]) -> FitSolution:
    """Return a fit with the coefficient of restitution as one more free parameter.

    ``fixed`` is the fit without it, and ``free`` the names of all free parameters of the new fit. A
    search starts from ``fixed``. Its result is returned if its log likelihood is higher by
    `MIN_LOG_RATIO` and it can predict every steady-speed segment that ``fixed`` predicts. Otherwise
    the parameters of ``fixed`` are returned, with the derivatives by the restitution added. This
    happens if bounces are lower than the noise of the lift, because the data then do not determine
    the restitution and the search drifts (``test_error_of_restitution``, seeds 27, 61 and 151).
    """
    released = search(continue_from(fixed, free, fixed.values))
    if (
        len(released.segments) == len(fixed.segments)
        and log_ratio_of_all(released, fixed) >= MIN_LOG_RATIO
    ):
        return released
    start = continue_from(fixed, free, fixed.values)
    masks = [fixed.likelihood.force_masks[i] for i in fixed.steady]
    pressing = [fixed.likelihood.pressing[i] for i in fixed.steady]
    new = replace(start.likelihood, force_masks=masks, pressing=pressing)
    return FitSolution(new, start.x, new.jacobian(start.x), new.residuals(start.x))


def estimate_restitution(fit: Candidate) -> tuple[float, float] | None:
    """Return the restitution and its standard error, with the other parameters fixed.

    The error is half the range of possible values. This is wide on purpose, because the other
    parameters are not varied. The result is None if no restitution explains the flights to their
    noise. Case: a stem with flights at the fastest speeds
    (``test_a_stem_that_leaves_a_cam_of_arcs``).
    """
    _, possible, step = _likely_restitutions(fit)
    best = min(possible, key=lambda trial: trial.sse)
    if best.sse >= MAX_NOISE_SQUARES * best.samples:
        return None
    low, high = possible[0].bounce, possible[-1].bounce
    return 0.5 * (low + high), 0.5 * (high - low + step)


def _likely_restitutions(
    fit: Candidate,
) -> tuple[list[RestitutionTrial], list[RestitutionTrial], float]:
    """Return trials of the likely and of the possible restitutions, and their step.

    A trial is a fit with a fixed restitution. It is likely if its sum of squared residuals exceeds
    the smallest by at most `CHI_SQUARED_95`, and possible up to `MAX_SQUARE`. The step is the
    difference between neighbouring restitutions.
    """
    coarse = [_try_restitution(fit, bounce) for bounce in COARSE_RESTITUTIONS]
    min_sse = min(trial.sse for trial in coarse)
    indices = [k for k, trial in enumerate(coarse) if trial.sse <= min_sse + MAX_SQUARE]
    last = len(COARSE_RESTITUTIONS) - 1
    ends = (
        COARSE_RESTITUTIONS[max(0, indices[0] - 1)],
        COARSE_RESTITUTIONS[min(last, indices[-1] + 1)],
    )
    fine = [
        _try_restitution(fit, bounce)
        for bounce in np.linspace(*ends, FINE_RESTITUTION_STEPS + 1).tolist()
    ]
    min_sse = min(trial.sse for trial in fine)
    likely, possible = (
        [trial for trial in fine if trial.sse <= min_sse + allowance]
        for allowance in (CHI_SQUARED_95, MAX_SQUARE)
    )
    return likely, possible, (ends[1] - ends[0]) / FINE_RESTITUTION_STEPS


class RestitutionTrial(NamedTuple):
    """Trial of a fixed restitution ``bounce``: the errors of a run with this value.

    ``sse`` is the sum of squared residuals, in squared standard deviations, over ``samples``
    samples. ``phases`` (rad) are the fitted phases of the steady-speed segments.
    """

    bounce: float
    sse: float
    phases: FloatArray
    samples: int


def _try_restitution(fit: Candidate, bounce: float) -> RestitutionTrial:
    """Fit the phase of each segment at a fixed restitution, and return the trial.

    The phase of a steady-speed segment is the cam angle minus the encoder angle. ``bounce`` is the
    restitution, and the other parameters are those of ``fit``. The sum of squared residuals covers
    the segments with lift-offs or landings, and those for which no periodic turn exists.
    """
    start = continue_from(fit, fit.smooth, fit.values | {"restitution": bounce})
    new, x = start.likelihood, start.x
    sse, samples = 0.0, 0
    # All forces are included: without those near bounces, a wrong restitution could fit.
    for i, segment in enumerate(new.segments):
        predicted = new.predicted(x, i)
        if predicted is None:
            samples += segment.lift.value.size + segment.force.value.size
            sse += NO_TURN_RESIDUAL**2 * segment.force.value.size
        elif predicted.turn.events:
            new.pressing[i] = np.abs(predicted.turn.evaluate(predicted.force.angle)[1])
            samples += segment.lift.value.size + segment.force.value.size
            x[new.instruments.phases.start + i], segment_sse = _fit_phase(start, i, predicted)
            sse += segment_sse
    return RestitutionTrial(bounce, sse, x[new.instruments.phases], samples)


def _fit_phase(start: Candidate, i: int, predicted: PredictedSegment) -> tuple[float, float]:
    """Return the phase (rad) that fits a steady-speed segment, and its sum of squares.

    ``i`` is the index of the segment. ``predicted`` is its computed turn. The squares are in
    squared standard deviations, each limited to `MAX_SQUARE`.
    """
    phase = float(start.x[start.likelihood.instruments.phases][i])
    use_lift, shift = start.segments[i].lift.value.size > 0, 0.0
    for _ in range(PHASE_STEPS):
        residuals = _signal_residuals(start, i, predicted, shift, use_lift)
        slopes = (
            _signal_residuals(start, i, predicted, shift + PHASE_DERIVATIVE_STEP, use_lift)
            - residuals
        ) / PHASE_DERIVATIVE_STEP
        shift -= float(slopes @ residuals) / max(float(slopes @ slopes), 1e-300)
    squares = [
        _signal_residuals(start, i, predicted, shift, is_lift) ** 2 for is_lift in (True, False)
    ]
    # The square is limited, because a landing that is early or late by less than a sample can
    # change the force of that sample completely.
    return phase + shift, float(sum(np.minimum(part, MAX_SQUARE).sum() for part in squares))


def _signal_residuals(
    start: Candidate, i: int, predicted: PredictedSegment, shift: float, use_lift: bool
) -> FloatArray:
    """Return a segment's residuals of lift or force at angles ``shift`` rad later.

    They are those of the lift if ``use_lift`` is True, otherwise of the force, in standard
    deviations. ``i`` is the index of the steady-speed segment.
    """
    like, x = start.likelihood, start.x
    measured = like.samples(i)
    if use_lift:
        computed = predicted.turn.evaluate(predicted.lift.angle + shift)[0] + like.single(x, ZERO)
        return (computed - measured[0].value) / like.lift_noise
    computed = predicted.turn.evaluate(predicted.force.angle + shift)[1] + like.single(
        x, FORCE_ZERO
    )
    return (computed - measured[1].value) / like.force_deviation(i)

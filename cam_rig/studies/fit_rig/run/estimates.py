"""Estimates of a fit to a run: parameters with errors, or reasons for missing values."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.studies.fit_rig.estimate import (
    MAX_RELATIVE_ERROR,
    NORMAL_95,
    ParameterEstimate,
    correlation_matrix,
    interval_text,
)
from cam_rig.studies.fit_rig.parameters import ONE_MASS, PARAMETERS, TWO_MASSES, parameter_slope
from cam_rig.studies.fit_rig.run.covariance import Uncertainty, sandwich_covariance
from cam_rig.studies.fit_rig.run.instruments import BACKLASH, FORCE_ZERO, RATIO, RESONANCE, ZERO
from cam_rig.studies.fit_rig.run.result import InstrumentEstimate, RigFit, SegmentFit
from cam_rig.studies.fit_rig.run.search import FitSolution, phase_line_matrix
from cam_rig.studies.fit_rig.run.turns import MeasuredSegment
from cam_rig.units import TURN, rms

#: Standard error (dimensionless) below which a restitution counts as identified.
MAX_RESTITUTION_ERROR = 0.1
#: Reason why a parameter has no value if steady speeds were left out of the fit, by the parameter's
#: key in a rig file.
LEFT_OUT_REASONS = {
    "restitution": "no follower fits the speeds that were left out",
    "stem_stiffness": "a rigid stem fits the speeds in contact: try --model two_mass",
}
#: Largest ratio of the residuals' r.m.s. to that of the noise at which a fit is accepted as
#: reliable. It is also the largest accepted correlation length of the lift residuals, in samples,
#: if no force was measured.
MAX_MISFIT = 3.0


def build_rig_fit(
    run: MeasuredRun,
    solution: FitSolution,
    fixed: dict[str, float],
    scale: tuple[str, ...],
    segments: tuple[MeasuredSegment, ...],
) -> RigFit:
    """Return the result of a fit to a measured run.

    ``fixed`` are the known values in SI by name. ``scale`` are the parameters that were fixed
    because only ratios to them are identifiable. ``segments`` are all steady-speed segments of the
    run, including those that the search left out.
    """
    errors, free = sandwich_covariance(solution), solution.likelihood.free
    misfit = explain_misfit(solution, errors.correlation_lengths)
    model = "two_mass" if "roller_share" in solution.values else "one_mass"
    names = TWO_MASSES if model == "two_mass" else (*ONE_MASS, "stem_stiffness")
    steady = [segment.line for segment in solution.segments]
    excluded = tuple(segment.line.rpm for segment in segments if segment.line not in steady)
    reasons = LEFT_OUT_REASONS if excluded else {}
    numbers = [_estimate(name, solution, errors, fixed, scale, reasons) for name in names]
    if misfit:
        numbers = [
            n if n.origin == "given" else ParameterEstimate.unidentified(n.name, misfit)
            for n in numbers
        ]
    identified = [free.index(n.name) for n in numbers if n.name in free and n.value is not None]
    correlation = correlation_matrix(errors.covariance[np.ix_(identified, identified)])
    follower = solution.likelihood.law, model, tuple(numbers), correlation
    speeds = tuple(_segment_fit(solution, i) for i in range(len(steady)))
    instruments = tuple(_instruments(solution, errors))
    return RigFit(
        *follower, run, speeds, instruments, solution, errors.correlation_lengths, excluded
    )


def _estimate(
    name: str,
    solution: FitSolution,
    errors: Uncertainty,
    fixed: dict[str, float],
    scale: tuple[str, ...],
    excluded: dict[str, str],
) -> ParameterEstimate:
    """Return the estimate of the parameter ``name``, or the reason for its absence.

    ``fixed`` are the known values. ``scale`` are the parameters to which only ratios are
    identifiable. ``excluded`` are the reasons that apply if speeds were left out, by name.
    ``solution`` is the fit, and ``errors`` its covariance.
    """
    free = solution.likelihood.free
    if name in fixed:
        return ParameterEstimate(name, fixed[name], None, "given")
    if name == "preload" and solution.zero is not None:
        text = f"in flight the force reads {solution.zero:.3g} N: adjust the sensor's zero"
        return ParameterEstimate.unidentified(name, text)
    if name == "restitution" and solution.bounce is not None:
        return _restitution_estimate(*solution.bounce, "roller_share" in solution.values)
    if name not in free:
        text = excluded.get(name) or _fixed_reason(name, scale, solution)
        return ParameterEstimate.unidentified(name, text)
    k, value = free.index(name), solution.values[name]
    error = float(errors.errors[k]) * parameter_slope(name, value)
    group = next((g for g in errors.null_groups if k in g), None)
    reason = ""
    if group is not None or error == 0.0:
        others = [free[i] for i in group or () if i < len(free) and i != k]
        reason = _null_reason(others, solution)
    elif scale:
        mass = solution.likelihood.fixed["mass"]
        ratio = f"{value / mass:.5g} ± {error / mass:.2g} in SI"
        reason = f"only its ratio to the mass is identifiable from lifts, {ratio}; set --fix mass"
    elif error >= MAX_RELATIVE_ERROR * value:
        reason = f"{interval_text(value, NORMAL_95 * error, PARAMETERS[name].unit)}: too wide"
    if reason:
        return ParameterEstimate.unidentified(name, reason, error)
    return ParameterEstimate(name, value, error, "identified")


def _restitution_estimate(value: float, error: float, stem: bool) -> ParameterEstimate:
    """Return the estimate of a restitution that was determined after the search.

    ``stem`` is True for two masses. Their restitution has no reliable interval, so it gets a reason
    instead of a value.
    """
    if error < MAX_RESTITUTION_ERROR and not stem:
        return ParameterEstimate("restitution", value, error, "identified")
    if stem:
        likely = f"{max(0.0, value - error):.2g} to {value + error:.2g}"
        reason = f"bounces on a stem depend on every parameter: with these values it is {likely}"
    else:
        interval = interval_text(value, NORMAL_95 * error, PARAMETERS["restitution"].unit)
        reason = f"{interval}: the measured landings are too soft"
    return ParameterEstimate.unidentified("restitution", reason, error)


def _fixed_reason(name: str, scale: tuple[str, ...], solution: FitSolution) -> str:
    """Return the reason why a parameter that was not free in the fit has no value.

    ``name`` is the parameter. ``scale`` are the parameters that were fixed because only ratios to
    them are identifiable.
    """
    if name == "restitution" and not any(solution.landings):
        return "no landing was measured: the follower never leaves the cam"
    if name == "stem_stiffness":
        forces = any(segment.force.value.size for segment in solution.segments)
        return "a rigid stem fits the samples" if forces else "only a force identifies a stem"
    if name in scale:
        return (
            "only ratios to the mass are identifiable from lifts alone: measure a force too, or "
            "set --fix mass"
        )
    return "it is not a free parameter of this model"


def _null_reason(others: list[str], solution: FitSolution) -> str:
    """Return the reason why a free parameter is not identifiable.

    ``others`` are the parameters that can change together with it without a change of the
    residuals.
    """
    if others:
        return f"not identifiable apart from {', '.join(others)}: set one of them with --fix"
    if not any(solution.landings):
        return "on the cam the lift does not depend on it: measure a force, or faster speeds"
    return "not identifiable: no sample depends on it"


def _segment_fit(solution: FitSolution, i: int) -> SegmentFit:
    """Return the residuals and lift-offs of the fit at steady-speed segment ``i``."""
    predicted = solution.predicted[i]
    assert predicted is not None  # every segment of a solution has a periodic turn
    lift, force = predicted.lift.residual, predicted.force.residual
    rpm = solution.likelihood.speed_of(solution.x, i) * 60.0 / TURN
    samples = solution.segments[i].line.turns, lift.size + force.size
    residuals = [rms(off) if off.size else None for off in (lift, force)]
    lift_offs = sum(event.kind == "lift-off" for event in predicted.turn.events)
    return SegmentFit(rpm, *samples, residuals[0], residuals[1], lift_offs)


def _instruments(solution: FitSolution, errors: Uncertainty) -> Iterator[InstrumentEstimate]:
    """Yield the estimates of the errors of the measuring instruments.

    The encoder offset and the clock error follow from a weighted straight line through the phases ψ
    of the steady-speed segments: ψ = −offset − clock ω t.
    """
    likelihood, x, segments = solution.likelihood, solution.x, solution.segments
    instruments = likelihood.instruments
    design = phase_line_matrix(solution)[:, : min(2, len(segments))]
    covariance = errors.covariance[instruments.phases, instruments.phases]
    covariance = covariance + np.diag([segment.line.angle_error**2 for segment in segments])
    weights = np.linalg.pinv(covariance, hermitian=True)
    normal = np.linalg.inv(design.T @ weights @ design)
    line = -normal @ design.T @ weights @ np.unwrap(x[instruments.phases])
    deviation = np.sqrt(np.diag(normal)).tolist()

    def estimate(key: str, name: str) -> InstrumentEstimate:
        index = instruments.index.get(name)
        error = None if index is None else float(errors.errors[index])
        return InstrumentEstimate(key, likelihood.single(x, name), error)

    yield InstrumentEstimate("encoder_offset", math.remainder(float(line[0]), TURN), deviation[0])
    if line.size > 1:
        yield InstrumentEstimate("clock_drift", float(line[1]), deviation[1])
    if any(segment.lift.value.size for segment in segments):
        yield estimate("lift_zero", ZERO)
        if likelihood.backlash:
            yield estimate("lift_backlash", BACKLASH)
        yield InstrumentEstimate("lift_noise", likelihood.lift_noise)
    if likelihood.zero_offset:
        yield estimate("force_zero", FORCE_ZERO)
    if any(segment.force.value.size for segment in segments):
        yield InstrumentEstimate("force_noise", likelihood.force_noise)
        yield InstrumentEstimate("force_noise_part", likelihood.relative_force_noise)
    if likelihood.resonance:
        yield InstrumentEstimate(
            "force_sensor_resonance", math.exp(x[instruments.index[RESONANCE]])
        )
        yield InstrumentEstimate("force_sensor_damping", likelihood.single(x, RATIO))


def explain_misfit(solution: FitSolution, correlation_lengths: tuple[float, float]) -> str:
    """Return the reason why a fit is not reliable, or an empty text if it is.

    The noise is estimated from the differences between readings at nearly the same cam angle. The
    residuals should not be much larger. With lifts alone, flights and bounces cause many local
    minima of the sum of squares. A search may stop in one of them close to the best fit, where
    neighbouring residuals are correlated. If only one speed has flights, several minima are equally
    likely. ``correlation_lengths`` are those of `Uncertainty`.
    """
    flying = sum(map(bool, solution.landings))
    if flying and not any(segment.force.value.size for segment in solution.segments):
        if correlation_lengths[0] > MAX_MISFIT:
            return (
                f"the residuals of the lift are correlated over {correlation_lengths[0]:.2g} "
                "samples: measure a force too, or speeds at which the follower bounces less"
            )
        if flying == 1:
            return "a single speed with lift-offs is not enough: measure another, or a force"
    for name, unit, factor in (("lift", "mm", 1e3), ("force", "N", 1.0)):
        signals = [
            getattr(predicted, name) for predicted in solution.predicted if predicted is not None
        ]
        residuals = np.concatenate([signal.residual for signal in signals])
        noise = [
            np.diff((signal.value - signal.residual)[np.argsort(np.mod(signal.angle, TURN))])
            / math.sqrt(2.0)
            for signal in signals
        ]
        residual_rms = rms(residuals) if residuals.size else 0.0
        noise_rms = rms(np.concatenate(noise)) if residual_rms else 0.0
        if residual_rms > MAX_MISFIT * noise_rms:
            return (
                f"the {name} differs by {residual_rms * factor:.3g} {unit} r.m.s. from that of the "
                f"best follower, and its noise is {noise_rms * factor:.2g} {unit}: are cam, unit "
                "and sign correct?"
            )
    return ""

"""Identification of a follower from a bag of a run, or from a jump speed table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.dynamics.parameters import si_or_none
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.extras import friendly_import_errors
from cam_rig.files import new_yaml, write_new
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import assumed_numbers, quantity_data, to_yaml
from cam_rig.schema.scene import present_model_name
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.inputs import Rig, resolve_cams
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.studies.fit_rig.jump_fit import JumpFit, fit_jumps
from cam_rig.studies.fit_rig.jump_table import read_jump_table
from cam_rig.studies.fit_rig.models import (
    fit_elastic,
    fit_one_mass,
    fit_two_masses,
    profile_restitution,
)
from cam_rig.studies.fit_rig.numbers import (
    MAX_RELATIVE_ERROR,
    NUMBERS,
    ONE_MASS,
    TWO_MASS_ONLY,
    TWO_MASSES,
    WITHIN_95,
    ParameterEstimate,
    check_fixed,
    correlation_matrix,
    interval_text,
    slope,
)
from cam_rig.studies.fit_rig.residuals import (
    BACKLASH,
    FORCE_ZERO,
    RATIO,
    RESONANCE,
    ZERO,
    Likelihood,
)
from cam_rig.studies.fit_rig.result import InstrumentNumber, RigFit, SegmentFit
from cam_rig.studies.fit_rig.search import (
    Candidate,
    FitSolution,
    Uncertainty,
    design_matrix,
    explain_misfit,
    search,
    uncertainty,
)
from cam_rig.studies.fit_rig.start import rough_start
from cam_rig.studies.fit_rig.turns import MeasuredSegment, measured_segments
from cam_rig.units import TURN, rms

#: Suffixes of tables. All other sources are bags.
TABLES = (".csv", ".txt", ".tsv")
#: Models that can be fitted.
MODELS = ("one_mass", "two_mass")


@check_arguments
def fit_rig(
    source: str | Path,
    cam: str | Path | CamConfig,
    *,
    topics: str | None = None,
    one_cam: str | None = None,
    namespace: str | None = None,
    rig: Rig = None,
    model: str | None = None,
    fix: Mapping[str, float] | None = None,
    tolerance: float | None = None,
    out: str | Path | None = None,
    progress: Progress = NULL_PROGRESS,
) -> RigFit | JumpFit:
    r"""Identify a follower's parameters from a measured run, or from its jump speeds.

    Each parameter has its standard error. A parameter that is not identifiable has no value, and
    a reason. The command is ``cam-rig fit rig``.

    Parameters
    ----------
    source : bag with cam angle, and lift or force or both; or .csv or .txt of jump speeds
    cam : cam of the measured rig: a name, a path or a cam, or a scene's name or path
    topics, namespace : topics or namespace of a bag, as in `compare`
    one_cam : cam of a scene or a bag with several cams
    rig : name, path or rig with the values of parameters that are not identifiable (default: as
        in `jump`)
    model : ``one_mass`` or ``two_mass`` (default: the likelier)
    fix : known values in SI by their keys in a rig file: ``{"mass": 1.3}``
    tolerance : standard error of a jump speed in rpm (default: from the residuals)
    out : new .yaml file for the identified rig; ``assumed`` lists what it takes from ``rig``
    progress : receiver of the progress

    Returns
    -------
    RigFit of a bag, or JumpFit of a table.

    Raises
    ------
    BagError, ConfigError : a source that cannot be read, or arguments that cannot be combined
    OutputError : ``out`` exists already, or cannot be written

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> table = "preload [N],jump speed [rpm]\n20,446.7\n40,469\n60,490.3\n"
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
    ...     _ = file.write(table), file.flush()
    ...     known = {"spring_stiffness": 4030.0, "damping": 8.6}
    ...     fit = cam_rig.fit_rig(file.name, "poly345", rig="tm21", fix=known)
    >>> [number.name for number in fit.identified]
    ['mass']
    """
    target, bag = new_yaml(out), Path(source)
    known, cams = dict(fix or {}), resolve_cams([cam], rig)
    model = _check_arguments(model, known, tolerance)
    if bag.suffix.lower() in TABLES:
        _require_none(topics=topics, namespace=namespace)
        law, table = _law_of(cams, one_cam), read_jump_table(bag)
        fit: JumpFit | RigFit = fit_jumps(law, table, cams.rig, model, known, tolerance, progress)
    else:
        _require_none(tolerance=tolerance)
        law, run = _read(bag, cams, one_cam, topics, namespace)
        fit = fit_run(law, run, cams.rig, model, known, progress)
    return fit if target is None else _write_rig(target, fit, cams.rig, bag)


def _check_arguments(
    model: str | None, fixed: Mapping[str, float], tolerance: float | None
) -> str | None:
    """Return the name of the model, after a check of the arguments.

    Model names of older releases are accepted.
    """
    name: str | None = present_model_name(model)
    if name is not None and name not in MODELS:
        raise ConfigError(f"--model: is {model!r}; allowed: {' or '.join(MODELS)}")
    if tolerance is not None and not tolerance > 0.0:
        raise ConfigError(f"--tolerance: is {tolerance:g} rpm; allowed: > 0")
    for key, value in fixed.items():
        if key not in NUMBERS:
            raise ConfigError(
                f"--fix {key}={value:g}: {key!r} is not a parameter of a follower; allowed: "
                f"{', '.join(NUMBERS)}{did_you_mean(key, list(NUMBERS))}"
            )
    return name


def _read(
    bag: Path, cams: CamSet, one_cam: str | None, topics: str | None, namespace: str | None
) -> tuple[Law, MeasuredRun]:
    """Return the law and the run of a bag, read by topics or by namespace."""
    with friendly_import_errors():
        from cam_rig.bag.foreign.topic_line import parse_topics
        from cam_rig.bag.measured_run import read_measured

    mapping = None if topics is None else parse_topics(topics)
    cam = one_cam or (next(iter(cams.laws)) if len(cams.laws) == 1 else None)
    if mapping is not None:
        _require_none(namespace=namespace)
        cam = _law_of(cams, one_cam).name
    run = read_measured(bag, mapping, cam, namespace)
    return _law_of(cams, run.cam), run


def _law_of(cams: CamSet, name: str | None) -> Law:
    names = list(cams.laws)
    if name is None and len(names) > 1:
        raise ConfigError(f"cams are {', '.join(names)}; say with --cam which one was on")
    chosen = name or names[0]
    if chosen not in cams.laws:
        raise ConfigError(
            f"--cam {chosen}: the bag's or the scene's has no such cam; allowed: "
            f"{', '.join(names)}{did_you_mean(chosen, names)}"
        )
    return cams.laws[chosen]


def _require_none(**options: object) -> None:
    """Raise an error if an option is set that this source cannot use."""
    for name, value in options.items():
        if value is not None:
            raise ConfigError(
                f"--{name} {value}: has no meaning for this source; allowed: leave it out"
            )


# From a run.

#: Relative r.m.s. difference of the lift from the law at the slowest speed, beyond which it is
#: taken for that of another cam.
MAX_LIFT_ERROR = 0.05


def fit_run(
    law: Law,
    run: MeasuredRun,
    base: RigConfig,
    model: str | None = None,
    fixed: dict[str, float] | None = None,
    progress: Progress = NULL_PROGRESS,
) -> RigFit:
    """Identify a follower from its measured lift and contact force at steady speeds.

    Parameters
    ----------
    law : law of the cam
    run : measured run
    base : rig with the start values, and the values of parameters that are not identifiable
    model : one_mass, two_mass (two masses and a stem), or None for the likelier
    fixed : known values in SI by name
    progress : receiver of the progress

    Raises
    ------
    ConfigError : values outside their limits, a run without steady speeds, or without the signals
        that the model needs
    """
    fixed = dict(fixed or {})
    check_fixed(fixed, model)
    run, segments = measured_segments(run)
    rigid = {name: value for name, value in fixed.items() if name not in TWO_MASS_ONLY}
    why = "the fit, which begins at it", "begin at another rig"
    values = {n: base.need(n, *why).si for n in ONE_MASS if n not in rigid} | rigid
    progress.start(None, "reading")
    progress.describe("the encoder's zero")
    rough, phase, zero = rough_start(law, segments, values)
    values = rough | rigid
    forces = any(segment.force.value.size for segment in segments)
    if model == "two_mass" and not forces:
        raise ConfigError(
            f"{run.source}: has no contact force, which alone shows a stem; allowed: "
            "--model one_mass"
        )
    scale = {} if forces or set(fixed) & set(ONE_MASS[:4]) else {"mass": values["mass"]}
    stem = fixed.get("stem_stiffness", si_or_none(base.follower.stem_stiffness))
    start = Likelihood(law, segments, (), values, stem)
    start.force_noise = 0.01 * max(h.force.value.max(initial=0.0) for h in segments) or 1.0
    progress.describe("one rigid mass")
    aligned = search(Candidate(start, start.start(values, phase, zero)))
    if _is_of_another_cam(aligned):
        return build_rig_fit(run, aligned, fixed, tuple(scale), segments)
    if model == "two_mass":
        solution = fit_two_masses(aligned, fixed, progress)
    else:
        solution = fit_one_mass(aligned, rigid | scale)
        if model is None and forces:
            solution = fit_elastic(solution, fixed, progress)
    progress.describe("standard errors")
    return build_rig_fit(run, profile_restitution(solution), fixed, tuple(scale), segments)


def _is_of_another_cam(aligned: FitSolution) -> bool:
    """Return True if the lift at the slowest speed differs from the law under load.

    The lift of a follower that has left the cam differs too. The contact force must therefore show
    that it has not.
    """
    slowest = min(range(len(aligned.segments)), key=lambda i: aligned.segments[i].speed)
    segment, predicted = aligned.segments[slowest], aligned.predicted[slowest]
    if predicted is None or not (
        segment.lift.value.size and segment.force.value.size and segment.presses
    ):
        return False
    return rms(predicted.lift.residual) > MAX_LIFT_ERROR * aligned.likelihood.law.lift


# Estimates of a solution: a value with its standard error, or a reason.

#: Standard error of a restitution below which it is identified.
MAX_RESTITUTION_ERROR = 0.1
#: Reasons for a missing value if some speeds are left out.
LEFT_OUT_REASONS = {
    "restitution": "the speeds left out fit no such follower",
    "stem_stiffness": "a rigid stem explains the speeds on the cam: try --model two_mass",
}


def build_rig_fit(
    run: MeasuredRun,
    solution: FitSolution,
    fixed: dict[str, float],
    scale: tuple[str, ...],
    segments: tuple[MeasuredSegment, ...],
) -> RigFit:
    """Return the result of a solution.

    ``scale`` are parameters that are fixed because only ratios to them are identifiable.
    """
    errors, free = uncertainty(solution), solution.likelihood.free
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
    free = solution.likelihood.free
    if name in fixed:
        return ParameterEstimate(name, fixed[name], None, "given")
    if name == "preload" and solution.zero is not None:
        text = f"in flight the force reads {solution.zero:.3g} N: set its zero"
        return ParameterEstimate.unidentified(name, text)
    if name == "restitution" and solution.bounce is not None:
        return _restitution_estimate(*solution.bounce, "roller_share" in solution.values)
    if name not in free:
        text = excluded.get(name) or _fixed_reason(name, scale, solution)
        return ParameterEstimate.unidentified(name, text)
    k, value = free.index(name), solution.values[name]
    error = float(errors.errors[k]) * slope(name, value)
    group = next((g for g in errors.null_groups if k in g), None)
    reason = ""
    if group is not None or error == 0.0:
        others = [free[i] for i in group or () if i < len(free) and i != k]
        reason = _null_reason(others, solution)
    elif scale:
        mass = solution.likelihood.fixed["mass"]
        ratio = f"{value / mass:.5g} ± {error / mass:.2g} in SI"
        reason = f"only its ratio to the mass is identifiable from lifts, {ratio}; give a mass"
    elif error >= MAX_RELATIVE_ERROR * value:
        reason = f"{interval_text(value, WITHIN_95 * error, NUMBERS[name].unit)}: too wide"
    if reason:
        return ParameterEstimate.unidentified(name, reason, error)
    return ParameterEstimate(name, value, error, "identified")


def _restitution_estimate(value: float, error: float, stem: bool) -> ParameterEstimate:
    if error < MAX_RESTITUTION_ERROR and not stem:
        return ParameterEstimate("restitution", value, error, "identified")
    likely = f"{max(0.0, value - error):.2g} to {value + error:.2g}"
    reason = f"bounces on a stem depend on every number: with the others as found, {likely}"
    if not stem:
        interval = interval_text(value, WITHIN_95 * error, NUMBERS["restitution"].unit)
        reason = f"{interval}: the landings that were measured are too soft"
    return ParameterEstimate.unidentified("restitution", reason, error)


def _fixed_reason(name: str, scale: tuple[str, ...], solution: FitSolution) -> str:
    if name == "restitution" and not any(solution.landings):
        return "no landing was measured: the follower never leaves the cam"
    if name == "stem_stiffness":
        forces = any(segment.force.value.size for segment in solution.segments)
        return "a rigid stem explains what was measured" if forces else "only a force shows a stem"
    if name in scale:
        return (
            "only ratios to the mass are identifiable from lifts alone: measure a force too, or "
            "give a mass"
        )
    return "not a free parameter here"


def _null_reason(others: list[str], solution: FitSolution) -> str:
    if others:
        return f"not identifiable apart from {', '.join(others)}: give one of them"
    if not any(solution.landings):
        return "on the cam the lift is the law's whatever it is: measure a force, or faster speeds"
    return "not identifiable: nothing that was measured changes with it"


def _segment_fit(solution: FitSolution, i: int) -> SegmentFit:
    predicted = solution.predicted[i]
    assert predicted is not None  # a search ends with steady turns
    lift, force = predicted.lift.residual, predicted.force.residual
    rpm = solution.likelihood.speed_of(solution.x, i) * 60.0 / TURN
    samples = solution.segments[i].line.turns, lift.size + force.size
    residuals = [rms(off) if off.size else None for off in (lift, force)]
    lift_offs = sum(event.kind == "lift-off" for event in predicted.turn.events)
    return SegmentFit(rpm, *samples, residuals[0], residuals[1], lift_offs)


def _instruments(solution: FitSolution, errors: Uncertainty) -> Iterator[InstrumentNumber]:
    """Yield the estimates of the instruments' errors.

    Offset and clock are a line through the phases: ψ = −offset − clock ω t.
    """
    likelihood, x, segments = solution.likelihood, solution.x, solution.segments
    instruments = likelihood.instruments
    design = design_matrix(solution)[:, : min(2, len(segments))]
    covariance = errors.covariance[instruments.phases, instruments.phases]
    covariance = covariance + np.diag([segment.line.angle_error**2 for segment in segments])
    weights = np.linalg.pinv(covariance, hermitian=True)
    normal = np.linalg.inv(design.T @ weights @ design)
    line = -normal @ design.T @ weights @ np.unwrap(x[instruments.phases])
    deviation = np.sqrt(np.diag(normal)).tolist()

    def estimate(key: str, name: str) -> InstrumentNumber:
        index = instruments.index.get(name)
        error = None if index is None else float(errors.errors[index])
        return InstrumentNumber(key, likelihood.single(x, name), error)

    yield InstrumentNumber("encoder_offset", math.remainder(float(line[0]), TURN), deviation[0])
    if line.size > 1:
        yield InstrumentNumber("clock_drift", float(line[1]), deviation[1])
    if any(h.lift.value.size for h in segments):
        yield estimate("lift_zero", ZERO)
        if likelihood.backlash:
            yield estimate("lift_backlash", BACKLASH)
        yield InstrumentNumber("lift_noise", likelihood.lift_noise)
    if likelihood.zero_offset:
        yield estimate("force_zero", FORCE_ZERO)
    if any(h.force.value.size for h in segments):
        yield InstrumentNumber("force_noise", likelihood.force_noise)
        yield InstrumentNumber("force_noise_part", likelihood.force_part)
    if likelihood.resonance:
        yield InstrumentNumber("force_sensor_resonance", math.exp(x[instruments.index[RESONANCE]]))
        yield InstrumentNumber("force_sensor_damping", likelihood.single(x, RATIO))


# Rig file with the identified parameters. The others are those of another rig, and assumed.


def fitted_rig(
    name: str, numbers: Iterable[ParameterEstimate], base: RigConfig, source: str, residual: str
) -> tuple[str, tuple[str, ...]]:
    """Return the text of a rig file, and a sentence for each part taken from ``base``."""
    data: dict[str, Any] = {"name": name, "title": f"{name}: identified from {source}"}
    borrowed = f"the rig {base.name}'s, not identified by {source}"
    numbers_of = {number.name: number for number in numbers}
    follower = assumed_numbers(base.follower, borrowed)
    if "roller_share" not in numbers_of:
        follower = {key: entry for key, entry in follower.items() if key not in TWO_MASS_ONLY}
    for key, number in numbers_of.items():
        if number.value is not None:
            follower[key] = _quantity(number, source, residual)
    data["follower"] = follower
    if base.radiation is not None:
        data["radiation"] = assumed_numbers(base.radiation, borrowed)
    missing = [key for key, value in follower.items() if "assumed" in value]
    assumed = [f"{', '.join(missing)}: the rig {base.name}'s"] if missing else []
    if base.radiation is not None:
        assumed.append(f"sound: the rig {base.name}'s, levels are relative")
    return to_yaml(data), tuple(assumed)


def _quantity(number: ParameterEstimate, source: str, residual: str) -> dict[str, Any]:
    assert number.value is not None
    if number.origin == "given":
        return quantity_data("given", number.value, number.unit, "given to the fit")
    value = float(number.shown)
    return quantity_data("identified", value, number.unit, source, f"{number.gist}; {residual}")


def _write_rig(out: Path, fit: JumpFit | RigFit, base: RigConfig, source: Path) -> RigFit | JumpFit:
    if not any(number.value is not None for number in fit.numbers):
        raise ConfigError(f"--out {out}: nothing was found to write; allowed: a fit with numbers")
    command = f"cam-rig fit rig {source.name}"
    text, assumed = fitted_rig(out.stem, fit.numbers, base, command, fit.residual)
    write_new(out.parent, {out.name: text})
    return replace(fit, assumed=assumed)

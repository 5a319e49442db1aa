"""A follower's numbers from what was measured: a bag of a run, or a table of jump speeds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cam_rig.arguments import checked
from cam_rig.dynamics.parameters import si_or_none
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.extras import libraries_named
from cam_rig.files import new_yaml, write_new
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import assumed_numbers, quantity, to_yaml
from cam_rig.schema.scene import model_named
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.asked import Rig, asked_cams
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.studies.fit_rig.jump_fit import JumpFit, fit_jumps
from cam_rig.studies.fit_rig.jump_table import read_jump_table
from cam_rig.studies.fit_rig.models import elastic, one_mass, profiled, two_masses
from cam_rig.studies.fit_rig.numbers import (
    NUMBERS,
    OF_TWO,
    ONE_MASS,
    TOLD,
    TWO_MASSES,
    WITHIN_95,
    FoundNumber,
    correlation_of,
    interval_words,
    require_in_model,
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
from cam_rig.studies.fit_rig.result import HoldFit, InstrumentNumber, RigFit
from cam_rig.studies.fit_rig.search import (
    Candidate,
    FitSolution,
    Uncertainty,
    lever,
    misfit,
    search,
    uncertainty,
)
from cam_rig.studies.fit_rig.start import rough_start
from cam_rig.studies.fit_rig.turns import MeasuredHold, measured_holds
from cam_rig.units import TURN, rms

#: Kinds of file that hold a table; all others are bags.
TABLES = (".csv", ".txt", ".tsv")
#: What is fitted.
MODELS = ("one_mass", "two_mass")


@checked
def fit_rig(
    source: str | Path,
    cam: str | Path | CamConfig,
    *,
    topics: str | None = None,
    one_cam: str | None = None,
    namespace: str | None = None,
    rig: Rig = None,
    model: str | None = None,
    given: Mapping[str, float] | None = None,
    tolerance: float | None = None,
    out: str | Path | None = None,
    progress: Progress = NULL_PROGRESS,
) -> RigFit | JumpFit:
    r"""A follower's numbers from a run measured on it, or from its jump speeds.

    Each has its standard error; what is not identifiable gets no number, and a reason.
    The command is ``cam-rig fit rig``.

    Parameters
    ----------
    source : a bag with cam angle, and lift or force or both; or a .csv or .txt of jump speeds
    cam : that was on: a name, a path or a cam, or a scene's name or path
    topics, namespace : of a bag, as `compare` takes them
    one_cam : of a scene or a bag with several
    rig : a name, a path or a rig, whose numbers stand where nothing tells any; None: as `jump`
    model : ``one_mass`` or ``two_mass``; None: the likelier
    given : numbers that are known, by their keys in a rig file, SI: ``{"mass": 1.3}``
    tolerance : standard error of a jump speed, rpm; None: from the residuals
    out : a new .yaml file for a rig of what was found; ``assumed`` says what it has of another
    progress : told how far it is

    Raises
    ------
    BagError, ConfigError : a source that cannot be read, or arguments that do not go together
    OutputError : ``out`` is there already, or cannot be written

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> table = "preload [N],jump speed [rpm]\n20,446.7\n40,469\n60,490.3\n"
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
    ...     _ = file.write(table), file.flush()
    ...     known = {"spring_stiffness": 4030.0, "damping": 8.6}
    ...     found = cam_rig.fit_rig(file.name, "poly345", rig="tm21", given=known)
    >>> [number.name for number in found.identified]
    ['mass']
    """
    target, bag = new_yaml(out), Path(source)
    known, cams = dict(given or {}), asked_cams([cam], rig)
    sought = _checked(model, known, tolerance)
    if bag.suffix.lower() in TABLES:
        _require_none(topics=topics, namespace=namespace)
        asked = _law_of(cams, one_cam), read_jump_table(bag), cams.rig, sought, known
        found: JumpFit | RigFit = fit_jumps(*asked, tolerance, progress)
    else:
        _require_none(tolerance=tolerance)
        law, run = _read(bag, cams, one_cam, topics, namespace)
        found = fit_run(law, run, cams.rig, sought, known, progress)
    return found if target is None else _written(target, found, cams.rig, bag)


def _checked(model: str | None, given: Mapping[str, float], tolerance: float | None) -> str | None:
    """The model, by its name of older releases too, if what is given beside it can be."""
    known: str | None = model_named(model)
    if known is not None and known not in MODELS:
        raise ConfigError(f"--model: is {model!r}; allowed: {' or '.join(MODELS)}")
    if tolerance is not None and not tolerance > 0.0:
        raise ConfigError(f"--tolerance: is {tolerance:g} rpm; allowed: > 0")
    for name, value in given.items():
        if name not in NUMBERS:
            raise ConfigError(
                f"--given {name}={value:g}: {name!r} is no number of a follower; allowed: "
                f"{', '.join(NUMBERS)}{did_you_mean(name, list(NUMBERS))}"
            )
    return known


def _read(
    bag: Path, cams: CamSet, one_cam: str | None, topics: str | None, namespace: str | None
) -> tuple[Law, MeasuredRun]:
    """The run of a bag: of another program by its topics, of the rig in its namespace."""
    with libraries_named():
        from cam_rig.bag.foreign.topic_line import parse_topics
        from cam_rig.bag.measured_run import read_measured

    mapping = None if topics is None else parse_topics(topics)
    asked = one_cam or (next(iter(cams.laws)) if len(cams.laws) == 1 else None)
    if mapping is not None:
        _require_none(namespace=namespace)
        asked = _law_of(cams, one_cam).name
    run = read_measured(bag, mapping, asked, namespace)
    return _law_of(cams, run.cam), run


def _law_of(cams: CamSet, name: str | None) -> Law:
    there = list(cams.laws)
    if name is None and len(there) > 1:
        raise ConfigError(f"cams are {', '.join(there)}; say with --cam which one was on")
    chosen = name or there[0]
    if chosen not in cams.laws:
        raise ConfigError(
            f"--cam {chosen}: the bag's or the scene's has no such cam; allowed: "
            f"{', '.join(there)}{did_you_mean(chosen, there)}"
        )
    return cams.laws[chosen]


def _require_none(**options: object) -> None:
    """Refuse an option that the source has no use for, rather than pass it over."""
    for name, value in options.items():
        if value is not None:
            raise ConfigError(
                f"--{name} {value}: has no meaning for this source; allowed: leave it out"
            )


# From a run.

#: A lift that is further from the law's than this part of it, r.m.s., at the slowest speed is of
#: another cam.
FAR_OFF = 0.05


def fit_run(
    law: Law,
    run: MeasuredRun,
    base: RigConfig,
    model: str | None = None,
    given: dict[str, float] | None = None,
    progress: Progress = NULL_PROGRESS,
) -> RigFit:
    """Find a follower's numbers from its measured lift and contact force at steady speeds.

    ``base``: rig whose numbers the search takes for those that nothing tells; ``model``: one_mass,
    two_mass (two masses and a stem), or None for the likelier; ``given``: numbers that are known,
    by name, SI.
    """
    given = dict(given or {})
    require_in_model(given, model)
    run, holds = measured_holds(run)
    rigid = {name: value for name, value in given.items() if name not in OF_TWO}
    why = "the fit, which begins at it", "begin at another rig"
    values = {n: base.need(n, *why).si for n in ONE_MASS if n not in rigid} | rigid
    progress.start(None, "reading")
    progress.describe("the encoder's zero")
    rough, phase, zero = rough_start(law, holds, values)
    values = rough | rigid
    forces = any(hold.force.value.size for hold in holds)
    if model == "two_mass" and not forces:
        raise ConfigError(
            f"{run.source}: has no contact force, which alone shows a stem; allowed: "
            "--model one_mass"
        )
    scale = {} if forces or set(given) & set(ONE_MASS[:4]) else {"mass": values["mass"]}
    stem = given.get("stem_stiffness", si_or_none(base.follower.stem_stiffness))
    start = Likelihood(law, holds, (), values, stem)
    start.force_noise = 0.01 * max(h.force.value.max(initial=0.0) for h in holds) or 1.0
    progress.describe("one rigid mass")
    aligned = search(Candidate(start, start.start(values, phase, zero)))
    if _is_of_another_cam(aligned):
        return found_of(run, aligned, given, tuple(scale), holds)
    if model == "two_mass":
        found = two_masses(aligned, given, progress)
    else:
        found = one_mass(aligned, rigid | scale)
        if model is None and forces:
            found = elastic(found, given, progress)
    progress.describe("standard errors")
    return found_of(run, profiled(found), given, tuple(scale), holds)


def _is_of_another_cam(aligned: FitSolution) -> bool:
    """Whether the lift at the slowest speed is far from the law's though the follower presses.

    A follower that has left the cam may be as far from it, so a force has to say that it has not.
    """
    slowest = min(range(len(aligned.holds)), key=lambda i: aligned.holds[i].speed)
    hold, predicted = aligned.holds[slowest], aligned.predicted[slowest]
    if predicted is None or not (hold.lift.value.size and hold.force.value.size and hold.presses):
        return False
    return rms(predicted.lift.left) > FAR_OFF * aligned.likelihood.law.lift


# What a solution says of each number: its value with a standard error, or why there is none.

#: A restitution is identified where its standard error is below this.
TOLD_RESTITUTION = 0.1
#: What the speeds that were left out might have told.
LEFT_OUT = {
    "restitution": "the speeds left out fit no such follower",
    "stem_stiffness": "a rigid stem explains the speeds on the cam: try --model two_mass",
}


def found_of(
    run: MeasuredRun,
    solution: FitSolution,
    given: dict[str, float],
    scale: tuple[str, ...],
    holds: tuple[MeasuredHold, ...],
) -> RigFit:
    """All that a solution says; ``scale``: numbers fixed since only ratios to them are told."""
    errors, sought = uncertainty(solution), solution.likelihood.sought
    unfit = misfit(solution, errors.alike)
    model = "two_mass" if "roller_share" in solution.values else "one_mass"
    names = TWO_MASSES if model == "two_mass" else (*ONE_MASS, "stem_stiffness")
    steady = [hold.hold for hold in solution.holds]
    left_out = tuple(hold.hold.rpm for hold in holds if hold.hold not in steady)
    untold = LEFT_OUT if left_out else {}
    numbers = [_number(name, solution, errors, given, scale, untold) for name in names]
    if unfit:
        numbers = [
            n if n.origin == "given" else FoundNumber.unidentified(n.name, unfit) for n in numbers
        ]
    told = [sought.index(n.name) for n in numbers if n.name in sought and n.value is not None]
    correlation = correlation_of(errors.covariance[np.ix_(told, told)])
    follower = solution.likelihood.law, model, tuple(numbers), correlation
    speeds = tuple(_hold_fit(solution, i) for i in range(len(steady)))
    instruments = tuple(_instruments(solution, errors))
    return RigFit(*follower, run, speeds, instruments, solution, errors.alike, left_out)


def _number(
    name: str,
    solution: FitSolution,
    errors: Uncertainty,
    given: dict[str, float],
    scale: tuple[str, ...],
    left_out: dict[str, str],
) -> FoundNumber:
    sought = solution.likelihood.sought
    if name in given:
        return FoundNumber(name, given[name], None, "given")
    if name == "preload" and solution.zero is not None:
        words = f"in flight the force reads {solution.zero:.3g} N: set its zero"
        return FoundNumber.unidentified(name, words)
    if name == "restitution" and solution.bounce is not None:
        return _bounce(*solution.bounce, "roller_share" in solution.values)
    if name not in sought:
        words = left_out.get(name) or _not_sought(name, scale, solution)
        return FoundNumber.unidentified(name, words)
    k, value = sought.index(name), solution.values[name]
    error = float(errors.errors[k]) * slope(name, value)
    group = next((g for g in errors.null_groups if k in g), None)
    reason = ""
    if group is not None or error == 0.0:
        others = [sought[i] for i in group or () if i < len(sought) and i != k]
        reason = _null_reason(others, solution)
    elif scale:
        mass = solution.likelihood.given["mass"]
        ratio = f"{value / mass:.5g} ± {error / mass:.2g} in SI"
        reason = f"only its ratio to the mass is identifiable from lifts, {ratio}; give a mass"
    elif error >= TOLD * value:
        reason = f"{interval_words(value, WITHIN_95 * error, NUMBERS[name].unit)}: too wide"
    if reason:
        return FoundNumber.unidentified(name, reason, error)
    return FoundNumber(name, value, error, "identified")


def _bounce(value: float, error: float, stem: bool) -> FoundNumber:
    if error < TOLD_RESTITUTION and not stem:
        return FoundNumber("restitution", value, error, "identified")
    likely = f"{max(0.0, value - error):.2g} to {value + error:.2g}"
    reason = f"bounces on a stem depend on every number: with the others as found, {likely}"
    if not stem:
        words = interval_words(value, WITHIN_95 * error, NUMBERS["restitution"].unit)
        reason = f"{words}: the landings that were measured are too soft"
    return FoundNumber.unidentified("restitution", reason, error)


def _not_sought(name: str, scale: tuple[str, ...], solution: FitSolution) -> str:
    if name == "restitution" and not any(solution.landings):
        return "no landing was measured: the follower never leaves the cam"
    if name == "stem_stiffness":
        forces = any(hold.force.value.size for hold in solution.holds)
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


def _hold_fit(solution: FitSolution, i: int) -> HoldFit:
    predicted = solution.predicted[i]
    assert predicted is not None  # a search ends at steady turns
    lift, force = predicted.lift.left, predicted.force.left
    rpm = solution.likelihood.speed_of(solution.x, i) * 60.0 / TURN
    samples = solution.holds[i].hold.turns, lift.size + force.size
    left = [rms(off) if off.size else None for off in (lift, force)]
    lift_offs = sum(event.kind == "lift-off" for event in predicted.turn.events)
    return HoldFit(rpm, *samples, left[0], left[1], lift_offs)


def _instruments(solution: FitSolution, errors: Uncertainty) -> Iterator[InstrumentNumber]:
    """Offset and clock are a line through the phases: ψ = −offset − clock ω t."""
    likelihood, x, holds = solution.likelihood, solution.x, solution.holds
    where = likelihood.instruments
    design = lever(solution)[:, : min(2, len(holds))]
    covariance = errors.covariance[where.phases, where.phases]
    covariance = covariance + np.diag([hold.hold.angle_error**2 for hold in holds])
    weights = np.linalg.pinv(covariance, hermitian=True)
    normal = np.linalg.inv(design.T @ weights @ design)
    line = -normal @ design.T @ weights @ np.unwrap(x[where.phases])
    deviation = np.sqrt(np.diag(normal)).tolist()

    def known(key: str, name: str) -> InstrumentNumber:
        at = where.at.get(name)
        error = None if at is None else float(errors.errors[at])
        return InstrumentNumber(key, likelihood.single(x, name), error)

    yield InstrumentNumber("encoder_offset", math.remainder(float(line[0]), TURN), deviation[0])
    if line.size > 1:
        yield InstrumentNumber("clock_fast_by", float(line[1]), deviation[1])
    if any(h.lift.value.size for h in holds):
        yield known("lift_zero", ZERO)
        if likelihood.backlash:
            yield known("lift_backlash", BACKLASH)
        yield InstrumentNumber("lift_noise", likelihood.lift_noise)
    if likelihood.zero_offset:
        yield known("force_zero", FORCE_ZERO)
    if any(h.force.value.size for h in holds):
        yield InstrumentNumber("force_noise", likelihood.force_noise)
        yield InstrumentNumber("force_noise_part", likelihood.force_part)
    if likelihood.resonance:
        yield InstrumentNumber("force_sensor_resonance", math.exp(x[where.at[RESONANCE]]))
        yield InstrumentNumber("force_sensor_damping", likelihood.single(x, RATIO))


# A rig file of what was identified; what nothing tells is another rig's, and assumed.


def fitted_rig(
    name: str, numbers: Iterable[FoundNumber], base: RigConfig, source: str, residual: str
) -> tuple[str, tuple[str, ...]]:
    """The file's text, and what it takes from ``base``, a sentence each."""
    data: dict[str, Any] = {"name": name, "title": f"{name}: identified from {source}"}
    borrowed = f"the rig {base.name}'s, not identified by {source}"
    numbers_of = {number.name: number for number in numbers}
    follower = assumed_numbers(base.follower, borrowed)
    if "roller_share" not in numbers_of:
        follower = {key: one for key, one in follower.items() if key not in OF_TWO}
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


def _quantity(number: FoundNumber, source: str, residual: str) -> dict[str, Any]:
    assert number.value is not None
    if number.origin == "given":
        return quantity("given", number.value, number.unit, "given to the fit")
    value = float(number.shown)
    return quantity("identified", value, number.unit, source, f"{number.gist}; {residual}")


def _written(out: Path, found: JumpFit | RigFit, base: RigConfig, source: Path) -> RigFit | JumpFit:
    if not any(number.value is not None for number in found.numbers):
        raise ConfigError(f"--out {out}: nothing was found to write; allowed: a fit with numbers")
    words = f"cam-rig fit rig {source.name}"
    text, assumed = fitted_rig(out.stem, found.numbers, base, words, found.residual)
    write_new(out.parent, {out.name: text})
    return replace(found, assumed=assumed)

"""What a solution says of each number: its value with a standard error, or why there is none."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cam_rig.laws import Law
from cam_rig.measured.rig_fit.found import FoundNumber, interval_words
from cam_rig.measured.rig_fit.numbers import (
    BACKLASH,
    NUMBERS,
    ONE_MASS,
    RATIO,
    RESONANCE,
    TARE,
    TWO_MASSES,
    ZERO,
    slope,
)
from cam_rig.measured.rig_fit.residuals import Likelihood
from cam_rig.measured.rig_fit.result import HoldFit, InstrumentNumber, RigFit
from cam_rig.measured.rig_fit.search import (
    FitSolution,
    Uncertainty,
    landings_of,
    misfit,
    uncertainty,
)
from cam_rig.measured.rig_fit.start import WITHIN_95
from cam_rig.measured.rig_fit.turns import MeasuredHold
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.units import TURN, rms

#: A number is identified where its standard error is below this part of it; a restitution below
#: this.
TOLD, TOLD_RESTITUTION = 0.5, 0.1

#: What the speeds that were left out might have told.
LEFT_OUT = {
    "restitution": "the speeds that lift off fit no such follower",
    "stem_stiffness": "a rigid stem explains the speeds on the cam: try --model two_mass",
}


def found_of(
    law: Law,
    run: MeasuredRun,
    solution: FitSolution,
    given: dict[str, float],
    scale: tuple[str, ...],
    holds: tuple[MeasuredHold, ...],
) -> RigFit:
    """All that a solution says.

    ``given``: numbers that are known; ``scale``: those that were fixed since only ratios to them
    are told; ``holds``: all that were measured.
    """
    errors = uncertainty(solution)
    likelihood, x = solution.likelihood, solution.x
    unfit = misfit(solution, errors.alike)
    model = "two_mass" if "roller_share" in likelihood.values(x) else "one_mass"
    names = TWO_MASSES if model == "two_mass" else (*ONE_MASS, "stem_stiffness")
    landings = landings_of(solution)
    steady = [hold.hold for hold in likelihood.holds]
    left_out = tuple(hold.hold.rpm for hold in holds if hold.hold not in steady)
    numbers = tuple(_number(name, solution, errors, given, scale, landings) for name in names)
    if left_out:
        numbers = tuple(_without_flights(number) for number in numbers)
    if unfit:
        numbers = tuple(
            n if n.origin == "given" else FoundNumber.unidentified(n.name, unfit) for n in numbers
        )
    told = [
        likelihood.sought.index(n.name)
        for n in numbers
        if n.name in likelihood.sought and n.value is not None
    ]
    part = errors.covariance[np.ix_(told, told)]
    deviation = np.maximum(np.sqrt(np.diag(part)), 1e-300)
    return RigFit(
        law,
        run,
        model,
        numbers,
        part / np.outer(deviation, deviation),
        tuple(_hold_fit(solution, i) for i in range(len(likelihood.holds))),
        tuple(_instruments(solution, errors)),
        solution,
        errors.alike,
        left_out,
    )


def _number(
    name: str,
    solution: FitSolution,
    errors: Uncertainty,
    given: dict[str, float],
    scale: tuple[str, ...],
    landings: list[int],
) -> FoundNumber:
    likelihood = solution.likelihood
    if name in given:
        return FoundNumber(name, given[name], None, "given")
    if name == "preload" and solution.zero is not None:
        words = f"in flight the force reads {solution.zero:.3g} N: set its zero"
        return FoundNumber.unidentified(name, words)
    if name == "restitution" and solution.bounce is not None:
        return _bounce(*solution.bounce, "roller_share" in likelihood.values(solution.x))
    if name not in likelihood.sought:
        forces = any(hold.force.value.size for hold in likelihood.holds)
        reason = _not_sought(name, scale, landings, forces)
        return FoundNumber.unidentified(name, reason)
    k = likelihood.sought.index(name)
    value = likelihood.values(solution.x)[name]
    error = float(errors.errors[k]) * slope(name, value)
    group = next((g for g in errors.blind if k in g), None)
    reason = ""
    if group is not None or error == 0.0:
        reason = _blind(k, group, likelihood, landings)
    elif scale:
        mass = likelihood.given["mass"]
        ratio = f"{value / mass:.5g} ± {error / mass:.2g} in SI"
        reason = f"only its ratio to the mass is identifiable from lifts, {ratio}; give a mass"
    elif error >= TOLD * value:
        reason = f"{interval_words(value, WITHIN_95 * error, NUMBERS[name].unit)}: too wide"
    return (
        FoundNumber.unidentified(name, reason, error)
        if reason
        else FoundNumber(name, value, error, "identified")
    )


def _bounce(value: float, error: float, stem: bool) -> FoundNumber:
    """A restitution that was found beside the search."""
    likely = f"{max(0.0, value - error):.2g} to {value + error:.2g}"
    if stem:
        reason = f"bounces on a stem depend on every number: with the others as found, {likely}"
    elif error < TOLD_RESTITUTION:
        return FoundNumber("restitution", value, error, "identified")
    else:
        words = interval_words(value, WITHIN_95 * error, NUMBERS["restitution"].unit)
        reason = f"{words}: the landings that were measured are too soft"
    return FoundNumber.unidentified("restitution", reason, error)


def _without_flights(number: FoundNumber) -> FoundNumber:
    """The same with the reason of what the speeds that were left out might have told."""
    if number.value is not None or number.error is not None:
        return number
    return replace(number, reason=LEFT_OUT.get(number.name, number.reason))


def _not_sought(name: str, scale: tuple[str, ...], landings: list[int], forces: bool) -> str:
    if name == "restitution" and not any(landings):
        return "no landing was measured: the follower never leaves the cam"
    if name == "stem_stiffness":
        return "a rigid stem explains what was measured" if forces else "only a force shows a stem"
    if name in scale:
        return (
            "only ratios to the mass are identifiable from lifts alone: measure a force too, or "
            "give a mass"
        )
    return "not a free parameter here"


def _blind(
    k: int, group: tuple[int, ...] | None, likelihood: Likelihood, landings: list[int]
) -> str:
    sought = likelihood.sought
    others = [sought[i] for i in group or () if i < len(sought) and i != k]
    if others:
        return f"not identifiable apart from {', '.join(others)}: give one of them"
    if not any(landings):
        return "on the cam the lift is the law's whatever it is: measure a force, or faster speeds"
    return "not identifiable: nothing that was measured changes with it"


def _hold_fit(solution: FitSolution, i: int) -> HoldFit:
    likelihood = solution.likelihood
    hold, predicted = likelihood.holds[i], likelihood.predicted(solution.x, i)
    assert predicted is not None  # a search ends at steady turns
    lift, force = predicted.lift_left, predicted.force_left
    lift_offs = sum(event.kind == "lift-off" for event in predicted.turn.events)
    return HoldFit(
        likelihood.speed_of(solution.x, i) * 60.0 / TURN,
        hold.hold.turns,
        lift.size + force.size,
        rms(lift) if lift.size else None,
        rms(force) if force.size else None,
        lift_offs,
    )


def _instruments(solution: FitSolution, errors: Uncertainty) -> Iterator[InstrumentNumber]:
    """Offset and clock are a line through the phases: ψ = −offset − clock ω t."""
    likelihood, x = solution.likelihood, solution.x
    where, holds = likelihood.instruments, likelihood.holds
    middle = np.array([0.5 * (h.hold.begin + h.hold.end) for h in holds])
    speeds = np.array([h.speed for h in holds])
    columns = [np.ones(len(holds)), speeds * middle][: 2 if len(holds) > 2 else 1]
    design = np.stack(columns, axis=1)
    covariance = errors.covariance[where.phases, where.phases]
    weights = np.linalg.pinv(covariance, hermitian=True)
    normal = np.linalg.inv(design.T @ weights @ design)
    line = -normal @ design.T @ weights @ np.unwrap(x[where.phases])
    deviation = np.sqrt(np.diag(normal)).tolist()
    frequency = where.at(RESONANCE)

    def known(key: str, name: str) -> InstrumentNumber:
        at = where.at(name)
        error = None if at is None else float(errors.errors[at])
        return InstrumentNumber(key, likelihood.single(x, name), error)

    yield InstrumentNumber("encoder_offset", math.remainder(float(line[0]), TURN), deviation[0])
    if line.size > 1:
        yield InstrumentNumber("clock_fast_by", float(line[1]), deviation[1])
    if any(h.lift.value.size for h in holds):
        yield known("lift_zero", ZERO)
        if likelihood.play:
            yield known("lift_backlash", BACKLASH)
        yield InstrumentNumber("lift_noise", likelihood.lift_noise)
    if likelihood.tare:
        yield known("force_zero", TARE)
    if any(h.force.value.size for h in holds):
        yield InstrumentNumber("force_noise", likelihood.force_noise)
        yield InstrumentNumber("force_noise_part", likelihood.force_part)
    if frequency is not None:
        yield InstrumentNumber("force_sensor_resonance", math.exp(x[frequency]))
        yield InstrumentNumber("force_sensor_damping", likelihood.single(x, RATIO))

"""What a search found of a rig: numbers with standard errors, or why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.laws import Law
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
from cam_rig.units import TURN, FloatArray, rms, rounded_to_error

#: A number is identified where its standard error is below this part of it; a restitution below
#: this. From a third of the value on, it is identified with a caution.
TOLD, TOLD_RESTITUTION, CAUTION = 0.5, 0.1, 1.0 / 3.0

#: What the speeds that were left out might have told.
LEFT_OUT = {
    "restitution": "the speeds that lift off fit no such follower",
    "stem_stiffness": "a rigid stem explains the speeds on the cam: try --model two_mass",
}


@dataclass(frozen=True)
class FoundNumber:
    """One number, SI: given; identified, with its standard error; or not identified, and why.

    ``within`` is how many standard errors its interval of 95 % reaches to either side.
    """

    name: str
    value: float | None
    error: float | None
    origin: str
    reason: str = ""
    within: float = WITHIN_95

    @classmethod
    def unidentified(cls, name: str, reason: str, error: float | None = None) -> FoundNumber:
        """One without a value; ``error`` is what a search would have stated."""
        return cls(name, None, error, "not identified", reason)

    @property
    def unit(self) -> str:
        """Of both."""
        return NUMBERS[self.name].unit

    @property
    def shown(self) -> str:
        """The value, to two digits of its standard error where it has one; empty without one."""
        return "" if self.value is None else rounded_to_error(self.value, self.error or 0.0)

    @property
    def shown_error(self) -> str:
        """The standard error, to two digits; empty without a value."""
        if self.value is None or self.error is None:
            return ""
        return rounded_to_error(self.error, self.error)

    @property
    def caution(self) -> str:
        """What stands beside a value whose error is a third of it or more, or larger than it."""
        if self.value is None or self.error is None or self.error < CAUTION * self.value:
            return ""
        half = self.within * self.error
        words = interval_words(self.value, half, self.unit)
        return f"{'may be 0' if self.value < half else 'uncertain'}: {words}"


def interval_words(value: float, half: float, unit: str) -> str:
    """An interval of 95 % of a number that is not below zero, in words."""
    low, end = value - half, f"{value + half:.3g} {unit}".removesuffix(" 1")
    return f"with 95 % it is below {end}" if low <= 0.0 else f"with 95 % it is {low:.3g} to {end}"


@dataclass(frozen=True)
class HoldFit:
    """What is left at one speed: r.m.s. of lift (m) and force (N), and what the follower does."""

    rpm: float
    turns: float
    samples: int
    lift: float | None
    force: float | None
    lift_offs: int


@dataclass(frozen=True, eq=False)
class Gauges:
    """What the same samples say of the instruments; errors are standard errors.

    ``offset`` (rad) is the encoder's angle where the cam is at θ = 0; ``clock`` by which part the
    sensors' clock is fast beside the encoder's; ``zero`` and ``backlash`` of the lift in m; the
    noise of the force is a floor (N) and a part of the force; its sensor's resonance is in Hz.
    """

    offset: float
    offset_error: float
    clock: float | None
    clock_error: float | None
    zero: float | None
    zero_error: float | None
    backlash: float | None
    backlash_error: float | None
    lift_noise: float | None
    force_noise: float | None
    force_part: float | None
    sensor_frequency: float | None
    sensor_damping: float | None
    force_zero: float | None
    force_zero_error: float | None


@dataclass(frozen=True, eq=False)
class RigFit:
    """What a run says of its rig.

    ``correlation`` ``(n, n)`` is of the numbers that were identified, in their order; ``model`` is
    one_mass or two_mass; ``alike`` as in `Uncertainty`; ``left_out`` are speeds (rpm) whose
    motion told nothing but perhaps the restitution.
    """

    law: Law
    run: MeasuredRun
    model: str
    numbers: tuple[FoundNumber, ...]
    correlation: FloatArray
    holds: tuple[HoldFit, ...]
    gauges: Gauges
    solution: FitSolution
    alike: tuple[float, float]
    left_out: tuple[float, ...]

    @property
    def identified(self) -> tuple[FoundNumber, ...]:
        """The numbers that the run tells."""
        return tuple(n for n in self.numbers if n.origin == "identified")

    @property
    def correlated(self) -> tuple[str, ...]:
        """The names of those in ``correlation``."""
        sought = self.solution.likelihood.sought
        return tuple(n.name for n in self.identified if n.name in sought)


def found_of(
    law: Law,
    run: MeasuredRun,
    solution: FitSolution,
    given: dict[str, float],
    scale: tuple[str, ...],
    holds: tuple[MeasuredHold, ...],
) -> RigFit:
    """All that a solution says.

    Parameters
    ----------
    given : numbers that are known
    scale : those that were fixed since only ratios to them are told
    holds : all that were measured
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
        _gauges(solution, errors),
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


def _gauges(solution: FitSolution, errors: Uncertainty) -> Gauges:
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
    deviation = np.sqrt(np.diag(normal))
    clock, clock_error = (line[1], deviation[1]) if line.size > 1 else (None, None)
    frequency = where.at(RESONANCE)

    def error(name: str) -> float | None:
        at = where.at(name)
        return None if at is None else float(errors.errors[at])

    lift = any(h.lift.value.size for h in holds)
    force = any(h.force.value.size for h in holds)
    return Gauges(
        math.remainder(float(line[0]), TURN),
        float(deviation[0]),
        None if clock is None else float(clock),
        None if clock_error is None else float(clock_error),
        likelihood.single(x, ZERO) if lift else None,
        error(ZERO),
        likelihood.single(x, BACKLASH) if likelihood.play else None,
        error(BACKLASH),
        likelihood.lift_noise if lift else None,
        likelihood.force_noise if force else None,
        likelihood.force_part if force else None,
        None if frequency is None else math.exp(x[frequency]),
        None if frequency is None else likelihood.single(x, RATIO),
        likelihood.single(x, TARE) if likelihood.tare else None,
        error(TARE),
    )

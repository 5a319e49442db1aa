"""The numbers of a rig from a run that was measured on it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.arrays import FloatArray, rms
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.simulation.measured_run import MeasuredRun
from cam_rig.studies.rig_fit.likelihood import Likelihood
from cam_rig.studies.rig_fit.measured_turns import measured_holds
from cam_rig.studies.rig_fit.numbers import NUMBERS, ONE_MASS, TWO_MASSES, slope, to_search
from cam_rig.studies.rig_fit.search import Solution, search
from cam_rig.studies.rig_fit.start import likely_stem, rough_start
from cam_rig.studies.rig_fit.uncertainty import Uncertainty, uncertainty
from cam_rig.units import TURN

#: A number is told where its standard error is below this part of it; a restitution below this.
TOLD, TOLD_RESTITUTION = 0.5, 0.1
#: 95 % of a normal distribution lie within so many standard deviations.
WITHIN_95 = 1.96
#: Two masses are taken where the logarithm of their likelihood ratio is above this.
CLEARLY_LIKELIER = 30.0
#: Restitutions tried first.
BOUNCES = (0.0, 0.1, 0.3, 0.6)
#: A gauge's backlash is sought where it is beyond so many standard errors.
PLAY = 6.0


@dataclass(frozen=True)
class FoundNumber:
    """One number of the follower: what was found, or why it was not.

    ``value`` and ``error`` (one standard error) in SI; ``value`` is None where nothing tells it,
    and ``reason`` says why. ``origin`` is given or identified.
    """

    name: str
    value: float | None
    error: float | None
    origin: str
    reason: str = ""

    @property
    def unit(self) -> str:
        """Of both."""
        return NUMBERS[self.name].unit


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
    noise of the force is a floor (N) and a part of the force.
    """

    offset: float
    offset_error: float
    clock: float | None
    clock_error: float | None
    zero: float | None
    backlash: float | None
    backlash_error: float | None
    lift_noise: float | None
    force_noise: float | None
    force_part: float | None


@dataclass(frozen=True, eq=False)
class RigFit:
    """What a run says of its rig.

    ``correlation`` ``(n, n)`` is of the numbers that were identified, in their order; ``model`` is
    one_mass or separation; ``notes`` are sentences on what was left out or looks odd.
    """

    law: Law
    run: MeasuredRun
    model: str
    numbers: tuple[FoundNumber, ...]
    correlation: FloatArray
    holds: tuple[HoldFit, ...]
    gauges: Gauges
    solution: Solution
    alike: tuple[float, float]
    notes: tuple[str, ...] = ()

    @property
    def identified(self) -> tuple[FoundNumber, ...]:
        """The numbers that the run tells."""
        return tuple(n for n in self.numbers if n.origin == "identified" and n.value is not None)


def fit_rig(
    law: Law,
    run: MeasuredRun,
    base: RigConfig,
    model: str | None = None,
    given: dict[str, float] | None = None,
    on_step: Callable[[str], None] = lambda _: None,
) -> RigFit:
    """Find a follower's numbers from its measured lift and contact force at steady speeds.

    Parameters
    ----------
    base : rig whose numbers the search takes for those that nothing tells
    model : one_mass, separation (two masses and a stem), or None for the likelier
    given : numbers that are known, by name, SI
    on_step : told what is being done

    Raises
    ------
    ConfigError : the cam nowhere turns steadily, nothing was measured, or nothing fits
    """
    given = dict(given or {})
    holds = measured_holds(run)
    values = {name: _of_base(base, name) for name in ONE_MASS} | given
    on_step("the encoder's zero")
    rough, phase, zero = rough_start(law, holds, values)
    values = rough | given
    forces = any(hold.force.value.size for hold in holds)
    scale = {} if forces or set(given) & set(ONE_MASS[:4]) else {"mass": values["mass"]}
    start = Likelihood(law, holds, (), values, base.follower.stem_stiffness.si)
    start.force_noise = (
        0.01 * max((h.force.value.max(initial=0.0) for h in holds), default=1.0) or 1.0
    )
    on_step("one rigid mass")
    aligned = search(start, start.start(values, phase, zero))
    one = _one_mass(aligned, given | scale)
    solution = one
    if model == "separation" or (model is None and forces and "roller_share" not in given):
        on_step("two masses and a stem")
        stem, gain = likely_stem(one.likelihood, one.x)
        if model == "separation" or gain > CLEARLY_LIKELIER:
            two = _two_masses(one, stem, given)
            if model == "separation" or log_ratio(two, one) > CLEARLY_LIKELIER:
                solution = two
    on_step("standard errors")
    return _found(law, run, solution, given, tuple(scale))


def _of_base(base: RigConfig, name: str) -> float:
    quantity = getattr(base.follower, name)
    return float(quantity.si)


def _continued(
    before: Solution, sought: tuple[str, ...], values: dict[str, float], play: bool
) -> tuple[Likelihood, FloatArray]:
    """A likelihood of other numbers, with the instruments as they were."""
    old = before.likelihood
    steady = [i for i in range(len(old.holds)) if old.predicted(before.x, i) is not None]
    if not steady:
        raise ConfigError(
            "at no speed does the follower move alike from turn to turn; needed: a speed at which "
            "it does, so one below the jump speed"
        )
    new = replace(
        old,
        holds=tuple(old.holds[i] for i in steady),
        sought=sought,
        given={name: value for name, value in values.items() if name not in sought},
        play=play,
        kept=[],
        pressing=[],
    )
    x = np.zeros(new.instruments.size)
    x[: len(sought)] = [to_search(name, values[name]) for name in sought]
    here, there = new.instruments, old.instruments
    x[here.phases] = before.x[there.phases][steady]
    x[here.speeds] = before.x[there.speeds][steady]
    for name in ("clock", "zero", "backlash"):
        to, start = getattr(here, name), getattr(there, name)
        if to is not None and start is not None:
            x[to] = before.x[start]
    return new, x


def _one_mass(aligned: Solution, given: dict[str, float]) -> Solution:
    """One rigid mass; the restitution once there are landings to tell it."""
    smooth = tuple(name for name in ONE_MASS if name not in given and name != "restitution")
    values = aligned.likelihood.values(aligned.x)
    found = search(*_continued(aligned, smooth, values | {"restitution": 0.0} | given, False))
    values = found.likelihood.values(found.x)
    if "restitution" not in given:
        found = _with_bounces(found, values)
    if _has_play(found):
        values = found.likelihood.values(found.x)
        found = search(*_continued(found, found.likelihood.sought, values, True))
    return found


def _with_bounces(found: Solution, values: dict[str, float]) -> Solution:
    """The restitution beside the other numbers, where the follower lands."""
    if not any(_landings(found)):
        return found
    play = found.likelihood.play
    sought = (*found.likelihood.sought, "restitution")
    trials = []
    for bounce in BOUNCES:
        new, x = _continued(found, sought, values | {"restitution": max(bounce, 1e-3)}, play)
        new.keep_clear(x, 0.0)
        residuals = new.residuals(x)
        trials.append((float(residuals @ residuals) / residuals.size, bounce))
    values = values | {"restitution": max(min(trials)[1], 1e-3)}
    return search(*_continued(found, sought, values, play))


def _landings(found: Solution) -> list[int]:
    turns = (found.likelihood.predicted(found.x, i) for i in range(len(found.likelihood.holds)))
    return [
        0 if turn is None else sum(event.kind == "landing" for event in turn.turn.events)
        for turn in turns
    ]


def _two_masses(one: Solution, stem: dict[str, float], given: dict[str, float]) -> Solution:
    """Two masses, from a stem beside the numbers of one."""
    values = one.likelihood.values(one.x) | {"restitution": given.get("restitution", 0.0)}
    sought = tuple(name for name in TWO_MASSES if name not in given and name != "restitution")
    play = one.likelihood.play
    found = search(*_continued(one, sought, values | stem | given, play))
    if "restitution" not in given:
        found = _with_bounces(found, found.likelihood.values(found.x))
    return found


def log_ratio(one: Solution, other: Solution) -> float:
    """Logarithm of how much likelier what was measured is by one solution than by another."""
    logs = []
    for solution in (one, other):
        like, total = solution.likelihood, 0.0
        for i, hold in enumerate(like.holds):
            deviation = like.force_deviation(i)
            total += hold.lift.value.size * math.log(like.lift_noise)
            # of all samples, as the two leave out different ones beside landings
            total += (
                hold.force.value.size * float(np.log(deviation).mean()) if deviation.size else 0.0
            )
        logs.append(-total)
    return logs[0] - logs[1]


def _has_play(found: Solution) -> bool:
    """Whether what is left of the lift stands apart after rises and after falls."""
    likelihood = found.likelihood
    if likelihood.instruments.zero is None:
        return False
    new, x = _continued(found, likelihood.sought, likelihood.values(found.x), True)
    slopes, residuals = new.slopes(x), new.residuals(x)
    at = new.instruments.backlash
    assert at is not None
    step, *_ = np.linalg.lstsq(slopes, -residuals, rcond=1e-12)
    error = uncertainty(Solution(new, x, slopes, residuals + slopes @ step)).errors[at]
    return bool(abs(step[at]) > PLAY * error)


def _found(
    law: Law, run: MeasuredRun, solution: Solution, given: dict[str, float], scale: tuple[str, ...]
) -> RigFit:
    errors = uncertainty(solution)
    likelihood, x = solution.likelihood, solution.x
    model = "separation" if "roller_share" in likelihood.values(x) else "one_mass"
    names = TWO_MASSES if model == "separation" else (*ONE_MASS, "stem_stiffness")
    landings = _landings(solution)
    numbers = tuple(_number(name, solution, errors, given, scale, landings) for name in names)
    told = [
        likelihood.sought.index(n.name)
        for n in numbers
        if n.origin == "identified" and n.value is not None
    ]
    part = errors.covariance[np.ix_(told, told)]
    deviation = np.sqrt(np.diag(part))
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
    )


def _number(
    name: str,
    solution: Solution,
    errors: Uncertainty,
    given: dict[str, float],
    scale: tuple[str, ...],
    landings: list[int],
) -> FoundNumber:
    likelihood = solution.likelihood
    if name in given:
        return FoundNumber(name, given[name], None, "given")
    if name not in likelihood.sought:
        return FoundNumber(name, None, None, "identified", _not_sought(name, scale, landings))
    k = likelihood.sought.index(name)
    value = likelihood.values(solution.x)[name]
    error = float(errors.errors[k]) * slope(name, value)
    group = next((g for g in errors.blind if k in g), None)
    reason = ""
    if name == "restitution" and error == 0.0:
        reason = "the landings that were measured are too soft to tell it"
    elif group is not None or error == 0.0:
        reason = _blind(k, group, likelihood, landings)
    elif scale and name != "restitution":
        mass = likelihood.given["mass"]
        ratio = f"{value / mass:.5g} ± {error / mass:.2g} in SI"
        reason = f"lifts tell only its ratio to the mass, {ratio}; give a mass"
    elif error >= (TOLD_RESTITUTION if name == "restitution" else TOLD * value):
        low, high = max(0.0, value - WITHIN_95 * error), value + WITHIN_95 * error
        reason = f"with 95 % it is between {low:.3g} and {high:.3g} {NUMBERS[name].unit}: too wide"
    return FoundNumber(name, None if reason else value, error, "identified", reason)


def _not_sought(name: str, scale: tuple[str, ...], landings: list[int]) -> str:
    if name == "restitution" and not any(landings):
        return "no landing was measured: the follower never leaves the cam"
    if name == "stem_stiffness":
        return "a rigid stem explains what was measured"
    if name in scale:
        return "lifts alone tell only ratios to the mass: measure a force too, or give a mass"
    return "not sought"


def _blind(
    k: int, group: tuple[int, ...] | None, likelihood: Likelihood, landings: list[int]
) -> str:
    sought = likelihood.sought
    others = [sought[i] for i in group or () if i < len(sought) and i != k]
    if others:
        return f"told only together with {', '.join(others)}: give one of them"
    if not any(landings):
        return "on the cam the lift is the law's whatever it is: measure a force, or faster speeds"
    return "nothing that was measured changes with it"


def _hold_fit(solution: Solution, i: int) -> HoldFit:
    likelihood = solution.likelihood
    hold, predicted = likelihood.holds[i], likelihood.predicted(solution.x, i)
    assert predicted is not None  # a search ends at steady turns
    lift = predicted.lift - hold.lift.value
    force = predicted.force - hold.force.value[likelihood.kept[i]]
    lift_offs = sum(event.kind == "lift-off" for event in predicted.turn.events)
    return HoldFit(
        likelihood.speed_of(solution.x, i) * 60.0 / TURN,
        hold.hold.turns,
        lift.size + force.size,
        rms(lift) if lift.size else None,
        rms(force) if force.size else None,
        lift_offs,
    )


def _gauges(solution: Solution, errors: Uncertainty) -> Gauges:
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
    play = where.backlash
    lift = any(h.lift.value.size for h in holds)
    force = any(h.force.value.size for h in holds)
    return Gauges(
        math.remainder(float(line[0]), TURN),
        float(deviation[0]),
        None if clock is None else float(clock),
        None if clock_error is None else float(clock_error),
        None if where.zero is None else float(x[where.zero]),
        None if play is None else float(x[play]),
        None if play is None else float(errors.errors[play]),
        likelihood.lift_noise if lift else None,
        likelihood.force_noise if force else None,
        likelihood.force_part if force else None,
    )

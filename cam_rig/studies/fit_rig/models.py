"""Which follower is sought: one rigid mass, a force sensor that vibrates, two masses and a stem.

Each begins where the one before it ended, and the likelier stays; then its restitution is profiled.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.show.result import Progress
from cam_rig.studies.fit_rig.numbers import NUMBERS, OF_TWO, ONE_MASS, TWO_MASSES, WITHIN_95
from cam_rig.studies.fit_rig.residuals import BACKLASH, RATIO, RESONANCE, ZERO
from cam_rig.studies.fit_rig.search import (
    FIRST_GUARD,
    Candidate,
    FitSolution,
    continued,
    contradict,
    inflation,
    lever,
    log_ratio,
    log_ratio_of_all,
    search,
    uncertainty,
)
from cam_rig.studies.fit_rig.start import (
    LEAST_FLYING,
    SMALL_BOUNCE,
    SQUARE_95,
    bounce_beside,
    forces_in_flight,
    freed,
    leaves_a_pattern,
    likely_stem,
    pattern,
    with_bounces,
    with_zero_offset,
    zero_in_flight,
)
from cam_rig.units import TURN

One = TypeVar("One", bound=Candidate)
#: What vibrates is sought where the logarithm of its likelihood ratio is above this.
CLEARLY_LIKELIER = 30.0
#: A gauge's backlash is sought where it is beyond so many standard errors, and beyond this part of
#: the lift: less is rounding.
CLEAR_BACKLASH, LEAST_BACKLASH = 6.0, 1e-7
#: A pattern up to so many times another's is of the same noise.
NO_MORE = 2.0
#: Restitutions from which lifts alone are searched.
BOUNCES_TRIED = (0.05, 0.25, 0.45, 0.65)


def one_mass(aligned: FitSolution, given: dict[str, float]) -> FitSolution:
    """One rigid mass; the restitution once there are landings to tell it."""
    if not _forces(aligned):
        return _of_lifts(aligned, given)
    still = _calm(aligned, _smooth(given), _begun(aligned, given))
    found = _everywhere(aligned, still, given)
    if _has_backlash(found):
        start = continued(found, found.likelihood.sought, found.values, backlash=True)
        found = replace(search(start), bounce=found.bounce)
    return still if still is not None and contradict(still, found) else found


def _smooth(given: dict[str, float], names: tuple[str, ...] = ONE_MASS) -> tuple[str, ...]:
    return tuple(name for name in names if name not in given and name != "restitution")


def _begun(aligned: FitSolution, given: dict[str, float]) -> dict[str, float]:
    return aligned.values | {"restitution": 0.0} | given


def _calm(one: Candidate, sought: tuple[str, ...], values: dict[str, float]) -> FitSolution | None:
    """One mass at the speeds on the cam alone; None where these are all, or have no force."""
    here = _on_the_cam(one)
    if len(here) == len(one.holds) or not _forces(one, here):
        return None
    return search(continued(one, sought, values, here, zero_offset=False))


def _everywhere(
    aligned: FitSolution, still: FitSolution | None, given: dict[str, float]
) -> FitSolution:
    """One rigid mass at all speeds, from those without landings where there are any."""
    start = _of_all(aligned, still) if still is not None else None
    if start is None or not any(start.landings):
        found = search(start or continued(aligned, _smooth(given), _begun(aligned, given)))
        if not any(found.landings):
            return found
        start = found
    return with_bounces(with_zero_offset(start), given)


def _of_all(one: Candidate, still: FitSolution) -> Candidate:
    """What was found at some speeds, at all of ``one``: a search may begin there.

    The phases of all holds are on a line through those of some, ψ = a + b ω t. One hold tells no
    line: then all phases are moved as its own is.
    """
    like = still.likelihood
    start = continued(
        one, like.sought, still.values, resonance=like.resonance, zero_offset=like.zero_offset
    )
    new, x = start.likelihood, start.x
    phases = np.unwrap(still.x[like.instruments.phases])
    if phases.size > 1:
        line = np.linalg.lstsq(lever(still), phases, rcond=None)[0]
        x[new.instruments.phases] = lever(start) @ line
    else:
        at = new.instruments.phases.start + new.holds.index(still.holds[0])
        x[new.instruments.phases] += phases[0] - x[at]
    for name, at in new.instruments.at.items():
        x[at] = like.single(still.x, name)
    return start


def _on_the_cam(found: Candidate) -> list[int]:
    """The holds at which the follower stays on the cam.

    By the forces too: on a stem it leaves a cam with steps of acceleration at slower speeds than
    one rigid mass does.
    """
    still = [i for i, landings in enumerate(found.landings) if not landings]
    return [i for i in still if found.holds[i].presses] or still


def _forces(found: Candidate, holds: list[int] | None = None) -> bool:
    there = range(len(found.holds)) if holds is None else holds
    return any(found.holds[i].force.value.size for i in there)


def _of_lifts(aligned: FitSolution, given: dict[str, float]) -> FitSolution:
    """One rigid mass from lifts alone: flights and bounces are told together or not at all.

    So from several restitutions on, and the least that is missed stays.
    """
    sought = tuple(name for name in ONE_MASS if name not in given)
    bounces = [given["restitution"]] if "restitution" in given else BOUNCES_TRIED
    values = _begun(aligned, given)
    found = [search(continued(aligned, sought, values | {"restitution": b})) for b in bounces]
    steady = [one for one in found if len(one.steady) == len(one.holds)]
    if not steady:
        raise ConfigError(
            "no follower comes near the lifts and moves alike from turn to turn at every speed; "
            "needed: a contact force too, or speeds at which it bounces less"
        )
    return min(steady, key=lambda one: one.likelihood.lift_noise)


def _two_masses(
    one: Candidate, still: Candidate, stem: dict[str, float], given: dict[str, float]
) -> FitSolution:
    """Two masses, from a stem and the numbers of one mass ``still`` at some speeds of ``one``."""
    sought = _smooth(given, TWO_MASSES)
    start = still.values | {"restitution": given.get("restitution", 0.0)} | stem | given
    quiet = _quiet(still, sought, start)
    if quiet is None:
        found = search(continued(one, sought, start))
        if "restitution" not in given and any(found.landings):
            found = with_bounces(found, given)
        return found
    return quiet if "restitution" in given else _beside_flights(one, quiet)


def _beside_flights(one: Candidate, quiet: FitSolution) -> FitSolution:
    """Numbers of the speeds on the cam, with what those that lift off say of the restitution."""
    if len(quiet.holds) == len(one.holds):
        return quiet
    flying = _of_all(one, quiet)
    if not any(flying.landings):
        return quiet
    rings = any(hold.rings for hold in flying.holds)
    zero = None if rings else zero_in_flight(flying)
    return replace(quiet, bounce=bounce_beside(flying) if zero is None else None, zero=zero)


def _quiet(
    still: Candidate, sought: tuple[str, ...], start: dict[str, float]
) -> FitSolution | None:
    """Two masses at the speeds without landings; None where there is none with a force.

    Bounces on a stem depend on every number at once, and their likelihood has a valley for each: a
    curvature there tells nothing of the others. On the cam the motion is linear. The fastest speed
    is left out as long as what is left of the forces has a pattern. What is left out may have
    led to a wrong stem, so one is looked for without it too. A pattern that is as strong with fewer
    speeds is no flight's, but noise that is correlated: so the most speeds are kept that have it.
    """
    here, tried = _on_the_cam(still), list[FitSolution]()
    while _forces(still, here):
        found = search(continued(still, sought, start, here, zero_offset=False))
        if len(here) < len(still.holds):
            found = _anew(still, found, here)
        start, flying = found.values, found.landings
        if any(flying):
            here, tried = [i for i, landings in zip(here, flying, strict=True) if not landings], []
            continue
        tried.append(found)
        if len(here) == 1 or not leaves_a_pattern(found):
            return next(one for one in tried if _strength(one) <= NO_MORE * _strength(found))
        fastest = max(here, key=lambda i: still.holds[i].speed)
        here = [i for i in here if i != fastest]
    return None


def _strength(found: Candidate) -> float:
    squares, parts = pattern(found)
    return squares / max(parts, 1.0)


def _anew(still: Candidate, found: FitSolution, here: list[int]) -> FitSolution:
    """Two masses at some holds: found, or from a stem that clearly shows beside one mass there."""
    rigid = search(continued(still, still.smooth, still.values, here, zero_offset=False))
    stem, gain = likely_stem(rigid)
    if gain < CLEARLY_LIKELIER:
        return found
    sought = found.likelihood.sought
    begin = rigid.values | stem | found.likelihood.given
    other = search(continued(still, sought, begin, here, zero_offset=False))
    return other if log_ratio(other, found) > 0.0 else found


def _with_resonance(one: FitSolution, stem: dict[str, float]) -> FitSolution:
    values = one.values
    end = values["mass"] * (1.0 - stem["roller_share"])
    rate = math.sqrt((stem["stem_stiffness"] + values["spring_stiffness"]) / end)
    start = continued(one, one.likelihood.sought, values, resonance=True)
    at = start.likelihood.instruments.at
    start.x[at[RESONANCE]] = math.log(rate / TURN)
    start.x[at[RATIO]] = 0.5 * stem["stem_damping"] / (end * rate)
    return replace(search(start), bounce=one.bounce)


def two_masses(aligned: FitSolution, given: dict[str, float], progress: Progress) -> FitSolution:
    """Two masses and a stem, asked for: of one mass only as much is searched as they begin from."""
    rigid = {name: value for name, value in given.items() if name not in OF_TWO}
    still = _calm(aligned, _smooth(rigid), _begun(aligned, rigid))
    one = one_mass(aligned, rigid) if still is None else _of_all(aligned, still)
    begin = _where_it_shows(one)
    progress.describe("two masses and a stem")
    return _two_masses(one, begin, likely_stem(begin)[0], given)


def elastic(one: FitSolution, given: dict[str, float], progress: Progress) -> FitSolution:
    """What vibrates: the force sensor, where that explains all, else the stem; or nothing.

    It is looked for at the speeds on the cam, if it shows there, as bounces of a rigid mass on what
    has a stem tell nothing.
    """
    if any(hold.rings for hold in one.holds):
        progress.describe("a resonance of the force sensor")
        return _ringing(one)
    if not leaves_a_pattern(one):
        return one
    still = _where_it_shows(one)
    stem, gain = likely_stem(still)
    if gain < CLEARLY_LIKELIER:
        return one
    best = one
    progress.describe("a resonance of the force sensor")
    sensor = _with_resonance(still, stem)
    if not leaves_a_pattern(sensor):
        sensor = sensor if still is one else _with_resonance(one, stem)
        if log_ratio(sensor, one) > CLEARLY_LIKELIER:
            best = sensor
            if not leaves_a_pattern(sensor):
                return sensor
    progress.describe("two masses and a stem")
    two = _two_masses(one, still, stem, given)
    return two if log_ratio(two, best) > CLEARLY_LIKELIER else best


def _where_it_shows(one: One) -> One | FitSolution:
    """One mass at the speeds on the cam alone, if what is left of the force has a pattern there."""
    calm = _calm(one, one.smooth, one.values)
    return one if calm is None or not leaves_a_pattern(calm) else calm


def _ringing(one: FitSolution) -> FitSolution:
    """One mass under a force sensor that shows pulls: no cam does, so no stem is sought.

    From the speeds on the cam, for a landing rings all that comes after it.
    """
    likelier = calm = _calm(one, one.smooth, one.values) or one
    if leaves_a_pattern(calm):
        sensor = _with_resonance(calm, likely_stem(calm)[0])
        likelier = sensor if log_ratio(sensor, calm) > CLEARLY_LIKELIER else calm
    return likelier if calm is one else _beside_flights(one, likelier)


def _has_backlash(found: FitSolution) -> bool:
    """Whether what is left of the lift stands apart after rises and after falls."""
    if ZERO not in found.likelihood.instruments.at:
        return False
    start = continued(found, found.likelihood.sought, found.values, backlash=True)
    new, x = start.likelihood, start.x
    slopes, residuals = new.slopes(x), new.residuals(x)
    at = new.instruments.at[BACKLASH]
    step, *_ = np.linalg.lstsq(slopes, -residuals, rcond=1e-12)
    error = uncertainty(FitSolution(new, x, slopes, residuals + slopes @ step)).errors[at]
    return bool(abs(step[at]) > max(CLEAR_BACKLASH * error, LEAST_BACKLASH * new.law.lift))


# How sure a restitution is, by the profile of its likelihood; the others where no bounce is. A
# force that comes to lie in a bounce changes the residuals at once, so along the restitution the
# likelihood is level here and steep there: its curvature at one place does not say how wide it is.
# The ratio of likelihoods does, the other numbers sought anew at each restitution.

#: First step from the likeliest restitution, each next one twice it; halvings of the last.
FIRST_STEP, HALVINGS = 0.01, 3
#: Looks about, each from the likeliest of the one before where that is by this log ratio.
LOOKS, LIKELIER = 4, 1.0
#: By what a sample that is three standard deviations off makes a log ratio larger.
ONE_SAMPLE = 0.5 * 3.0**2
#: Restitutions at which a narrow interval is held against all that lies beside it.
ELSEWHERE = (0.1, 0.3, 0.5, 0.7, 0.9)


def profiled(found: FitSolution) -> FitSolution:
    """The restitution in the middle of its interval of 95 %, the others of what no bounce reaches.

    Of two masses there is none: their bounces depend on every number at once.
    """
    if "roller_share" in found.values or not any(found.landings):
        return found
    bounce = None
    if "restitution" in found.likelihood.sought:
        found, low, high = _interval(found)
        value = found.values["restitution"]
        # Near none, none is said: what is known is the end.
        middle = 0.5 * (low + high) if value >= SMALL_BOUNCE else 0.0
        bounce = middle, (high - middle) / WITHIN_95
        found = _at(found, middle)
    return replace(search(_settled(found)), bounce=bounce)


def _settled(found: FitSolution) -> Candidate:
    """A search of the samples that no bounce reaches; of the force's zero too, where these show it.

    Late in a series of bounces a landing passes samples within a standard error of a number: the
    sum of squares has a cliff there, and its curvature is that of a narrow valley.
    """
    start = Candidate(found.likelihood.settled(found.x, FIRST_GUARD), found.x)
    shown = forces_in_flight(start).size >= LEAST_FLYING
    zero_offset = found.likelihood.zero_offset and shown
    return continued(start, found.likelihood.sought, found.values, zero_offset=zero_offset)


def _interval(found: FitSolution) -> tuple[FitSolution, float, float]:
    """The likeliest of all that is tried on the way to the interval's ends; and these.

    A search ends in the valley it began in. One that is likelier beside another restitution is
    where the next look begins.
    """
    sought = found.likelihood.sought
    at, number = sought.index("restitution"), NUMBERS["restitution"]
    for _ in range(LOOKS):
        level = 0.5 * SQUARE_95 * max(1.0, inflation(found, at))
        (low, down), (high, up) = (_end(found, at, to, level) for to in (number.low, number.high))
        best = min((*down, *up), key=lambda trial: log_ratio_of_all(found, trial), default=found)
        if log_ratio_of_all(found, best) > -LIKELIER:
            break
        found = freed(best, sought)
    return found, *_widened(found, at, low, high, level)


def _widened(
    found: FitSolution, at: int, low: float, high: float, level: float
) -> tuple[float, float]:
    """The interval with what is as likely beside it, taken together.

    Where hardly a sample is in a bounce, the likelihood is nearly level, and the best of its many
    narrow valleys is likelier by chance. A valley outweighs a level as wide as the restitution's
    range only if it is likelier by more than the logarithm of the ratio of their widths.
    """
    number = NUMBERS["restitution"]
    least = FIRST_STEP / 2.0**HALVINGS
    outweighs = level + math.log((number.high - number.low) / max(high - low, least))
    beside = [
        there
        for there in ELSEWHERE
        if not low <= there <= high and _likely(found, _at(found, there), outweighs)
    ]
    return min([low, *beside]), max([high, *beside])


def _at(found: Candidate, bounce: float) -> FitSolution:
    return search(continued(found, found.smooth, found.values | {"restitution": bounce}))


def _end(
    found: FitSolution, at: int, limit: float, level: float
) -> tuple[float, list[FitSolution]]:
    """The last restitution towards ``limit`` that is likely: by a log ratio below ``level``.

    With it what was likely on the way there.
    """
    inside = float(found.x[at])
    likely = list[FitSolution]()
    step, outside, halvings = FIRST_STEP, None, HALVINGS
    while inside != limit and (outside is None or halvings > 0):
        if outside is None:
            there = inside + math.copysign(min(step, abs(limit - inside)), limit - inside)
        else:
            there, halvings = 0.5 * (inside + outside), halvings - 1
        trial = _at(likely[-1] if likely else found, there)
        if _likely(found, trial, level):
            inside, step = there, 2.0 * step
            likely.append(trial)
        else:
            outside = there
    return inside if outside is None else outside, likely


def _likely(found: FitSolution, trial: FitSolution, level: float) -> bool:
    """Whether every hold stays steady and the ratio of likelihoods is near one.

    Beside a landing a single sample comes near or far at once, by chance: that alone is no end.
    """
    if len(trial.holds) < len(found.holds) or log_ratio(found, trial) >= level:
        return False
    return log_ratio_of_all(found, trial) < level + ONE_SAMPLE

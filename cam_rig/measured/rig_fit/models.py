"""Which follower is sought: one rigid mass, a force sensor that vibrates, two masses and a stem.

Each begins where the one before it ended, and the likelier stays.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.measured.rig_fit.numbers import OF_TWO, ONE_MASS, TWO_MASSES
from cam_rig.measured.rig_fit.residuals import BACKLASH, RATIO, RESONANCE, ZERO
from cam_rig.measured.rig_fit.search import (
    Candidate,
    FitSolution,
    continued,
    contradict,
    lever,
    log_ratio,
    search,
    uncertainty,
)
from cam_rig.measured.rig_fit.start import (
    bounce_beside,
    leaves_a_pattern,
    likely_stem,
    with_bounces,
    with_zero_offset,
    zero_in_flight,
)
from cam_rig.show.result import Progress
from cam_rig.units import TURN

One = TypeVar("One", bound=Candidate)
#: What vibrates is sought where the logarithm of its likelihood ratio is above this.
CLEARLY_LIKELIER = 30.0
#: A gauge's backlash is sought where it is beyond so many standard errors, and beyond this part of
#: the lift: less is rounding.
CLEAR_BACKLASH, LEAST_BACKLASH = 6.0, 1e-7
#: Restitutions from which lifts alone are searched.
BOUNCES_TRIED = (0.05, 0.25, 0.45, 0.65)


def one_mass(aligned: FitSolution, given: dict[str, float]) -> FitSolution:
    """One rigid mass; the restitution once there are landings to tell it."""
    if not _forces(aligned):
        return _of_lifts(aligned, given)
    still = _still(aligned, given)
    found = _everywhere(aligned, still, given)
    if _has_backlash(found):
        start = continued(found, found.likelihood.sought, found.values, backlash=True)
        found = replace(search(start), bounce=found.bounce)
    return still if still is not None and contradict(still, found) else found


def _smooth(given: dict[str, float], names: tuple[str, ...] = ONE_MASS) -> tuple[str, ...]:
    return tuple(name for name in names if name not in given and name != "restitution")


def _begun(aligned: FitSolution, given: dict[str, float]) -> dict[str, float]:
    return aligned.values | {"restitution": 0.0} | given


def _still(aligned: FitSolution, given: dict[str, float]) -> FitSolution | None:
    """One rigid mass at the speeds without landings; None where these are all, or have no force."""
    here = _some_on_the_cam(aligned)
    start = _smooth(given), _begun(aligned, given)
    return search(continued(aligned, *start, here)) if here else None


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


def _some_on_the_cam(found: Candidate) -> list[int]:
    """The same; none where these are all, or have no force."""
    here = _on_the_cam(found)
    return here if len(here) < len(found.holds) and _forces(found, here) else []


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
    led to a wrong stem, so one is looked for without it too.
    """
    here = _on_the_cam(still)
    while _forces(still, here):
        found = search(continued(still, sought, start, here, zero_offset=False))
        if len(here) < len(still.holds):
            found = _anew(still, found, here)
        start, flying = found.values, found.landings
        if any(flying):
            here = [i for i, landings in zip(here, flying, strict=True) if not landings]
        elif len(here) > 1 and leaves_a_pattern(found):
            fastest = max(here, key=lambda i: still.holds[i].speed)
            here = [i for i in here if i != fastest]
        else:
            return found
    return None


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
    still = _still(aligned, rigid)
    one = one_mass(aligned, rigid) if still is None else _of_all(aligned, still)
    begin = _where_it_shows(one)
    progress.tell("two masses and a stem")
    return _two_masses(one, begin, likely_stem(begin)[0], given)


def elastic(one: FitSolution, given: dict[str, float], progress: Progress) -> FitSolution:
    """What vibrates: the force sensor, where that explains all, else the stem; or nothing.

    It is looked for at the speeds on the cam, if it shows there, as bounces of a rigid mass on what
    has a stem tell nothing.
    """
    if any(hold.rings for hold in one.holds):
        progress.tell("a resonance of the force sensor")
        return _ringing(one)
    if not leaves_a_pattern(one):
        return one
    still = _where_it_shows(one)
    stem, gain = likely_stem(still)
    if gain < CLEARLY_LIKELIER:
        return one
    best = one
    progress.tell("a resonance of the force sensor")
    sensor = _with_resonance(still, stem)
    if not leaves_a_pattern(sensor):
        sensor = sensor if still is one else _with_resonance(one, stem)
        if log_ratio(sensor, one) > CLEARLY_LIKELIER:
            best = sensor
            if not leaves_a_pattern(sensor):
                return sensor
    progress.tell("two masses and a stem")
    two = _two_masses(one, still, stem, given)
    return two if log_ratio(two, best) > CLEARLY_LIKELIER else best


def _where_it_shows(one: One) -> One | FitSolution:
    """One mass at the speeds on the cam alone, if what is left of the force has a pattern there."""
    calm = _calm(one)
    return one if calm is None or not leaves_a_pattern(calm) else calm


def _calm(one: Candidate) -> FitSolution | None:
    """One mass at the speeds on the cam alone; None where these are all, or have no force."""
    here = _some_on_the_cam(one)
    return search(continued(one, one.smooth, one.values, here, zero_offset=False)) if here else None


def _ringing(one: FitSolution) -> FitSolution:
    """One mass under a force sensor that shows pulls: no cam does, so no stem is sought.

    From the speeds on the cam, for a landing rings all that comes after it.
    """
    likelier = calm = _calm(one) or one
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

"""Which follower is sought: one rigid mass, a force sensor that vibrates, two masses and a stem.

Each begins where the one before it ended, and the likelier stays.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.measured.rig_fit.numbers import (
    BACKLASH,
    OF_TWO,
    ONE_MASS,
    RATIO,
    RESONANCE,
    TWO_MASSES,
    ZERO,
)
from cam_rig.measured.rig_fit.search import (
    Candidate,
    FitSolution,
    continued,
    contradict,
    landings_of,
    log_ratio,
    search,
    steady_holds_of,
    uncertainty,
)
from cam_rig.measured.rig_fit.start import (
    bounce_beside,
    leaves_a_pattern,
    likely_stem,
    tared,
    with_bounces,
    zero_in_flight,
)
from cam_rig.show.result import Progress
from cam_rig.units import TURN, FloatArray

One = TypeVar("One", bound=Candidate)

#: What vibrates is sought where the logarithm of its likelihood ratio is above this.
CLEARLY_LIKELIER = 30.0

#: A gauge's backlash is sought where it is beyond so many standard errors.
PLAY = 6.0

#: And beyond this part of the lift: less is rounding.
LEAST_PLAY = 1e-7

#: Restitutions from which lifts alone are searched.
BOUNCES_TRIED = (0.05, 0.25, 0.45, 0.65)


def one_mass(aligned: FitSolution, given: dict[str, float]) -> FitSolution:
    """One rigid mass; the restitution once there are landings to tell it."""
    if not any(hold.force.value.size for hold in aligned.likelihood.holds):
        return _of_lifts(aligned, given)
    still = _still(aligned, given)
    found = _everywhere(aligned, still, given)
    if _has_play(found):
        values, bounce = found.likelihood.values(found.x), found.bounce
        found = search(continued(found, found.likelihood.sought, values, play=True))
        found = replace(found, bounce=bounce)
    return still if still is not None and contradict(still, found) else found


def _smooth(given: dict[str, float]) -> tuple[str, ...]:
    """What is sought of a rigid mass on the cam."""
    return tuple(name for name in ONE_MASS if name not in given and name != "restitution")


def _begun(aligned: FitSolution, given: dict[str, float]) -> dict[str, float]:
    """Numbers to begin with."""
    return aligned.likelihood.values(aligned.x) | {"restitution": 0.0} | given


def _still(aligned: FitSolution, given: dict[str, float]) -> FitSolution | None:
    """One rigid mass at the speeds without landings, where a wrong restitution does no harm.

    None where these are all speeds, or have no force.
    """
    quiet = _on_the_cam(aligned)
    if len(quiet) == len(aligned.likelihood.holds) or not _forces(aligned, quiet):
        return None
    return search(continued(aligned, _smooth(given), _begun(aligned, given), only=quiet))


def _everywhere(
    aligned: FitSolution, still: FitSolution | None, given: dict[str, float]
) -> FitSolution:
    """One rigid mass at all speeds, from those without landings where there are any."""
    start = _of_all(aligned, still) if still is not None else None
    if start is None or not any(landings_of(start)):
        found = search(start or continued(aligned, _smooth(given), _begun(aligned, given)))
        if not any(landings_of(found)):
            return found
        start = found
    return with_bounces(tared(start), given)


def _of_all(one: Candidate, still: FitSolution) -> Candidate:
    """What was found at some speeds, at all of ``one``: a search may begin there."""
    like = still.likelihood
    start = continued(
        one, like.sought, like.values(still.x), resonance=like.resonance, tare=like.tare
    )
    return Candidate(start.likelihood, _with_phases_of(still, start))


def _on_the_cam(found: Candidate) -> list[int]:
    """The holds at which the follower stays on the cam.

    By the forces too: on a stem it leaves a cam with steps of acceleration at slower speeds than
    one rigid mass does.
    """
    still = [i for i, landings in enumerate(landings_of(found)) if not landings]
    return [i for i in still if found.likelihood.holds[i].presses] or still


def _forces(found: Candidate, holds: list[int]) -> bool:
    return any(found.likelihood.holds[i].force.value.size for i in holds)


def _of_lifts(aligned: FitSolution, given: dict[str, float]) -> FitSolution:
    """One rigid mass from lifts alone: flights and bounces are told together or not at all.

    So from several restitutions on, and the least that is missed stays.
    """
    smooth, values = _smooth(given), _begun(aligned, given)
    free = "restitution" not in given
    sought = (*smooth, "restitution") if free else smooth
    starts = [values | {"restitution": bounce} for bounce in BOUNCES_TRIED] if free else [values]
    found = [search(continued(aligned, sought, start)) for start in starts]
    steady = [one for one in found if len(steady_holds_of(one)) == len(one.likelihood.holds)]
    if not steady:
        raise ConfigError(
            "no follower comes near the lifts and moves alike from turn to turn at every speed; "
            "needed: a contact force too, or speeds at which it bounces less"
        )
    return min(steady, key=lambda one: one.likelihood.lift_noise)


def _with_phases_of(still: FitSolution, start: Candidate) -> FloatArray:
    """What ``start`` seeks, with the instruments of some holds.

    The phases of all holds are on a line through those of some, ψ = a + b ω t. One hold tells no
    line: then all phases are moved as its own is.
    """
    new, found = start.likelihood, start.x.copy()
    phases = np.unwrap(still.x[still.likelihood.instruments.phases])
    if phases.size > 1:
        design = [
            np.array([[1.0, h.speed * 0.5 * (h.hold.begin + h.hold.end)] for h in like.holds])
            for like in (still.likelihood, new)
        ]
        line = np.linalg.lstsq(design[0], phases, rcond=None)[0]
        found[new.instruments.phases] = design[1] @ line
    else:
        at = new.instruments.phases.start + new.holds.index(still.likelihood.holds[0])
        found[new.instruments.phases] += phases[0] - start.x[at]
    for name in new.instruments.single:
        at = new.instruments.at(name)
        assert at is not None
        found[at] = still.likelihood.single(still.x, name)
    return found


def _two_masses(
    one: Candidate, still: Candidate, stem: dict[str, float], given: dict[str, float]
) -> FitSolution:
    """Two masses, from a stem and the numbers of one mass ``still`` at some speeds of ``one``."""
    values = still.likelihood.values(still.x) | {"restitution": given.get("restitution", 0.0)}
    sought = tuple(name for name in TWO_MASSES if name not in given and name != "restitution")
    start = values | stem | given
    quiet = _quiet(still, sought, start)
    if quiet is None:
        found = search(continued(one, sought, start))
        if "restitution" not in given and any(landings_of(found)):
            found = with_bounces(found, given)
        return found
    return quiet if "restitution" in given else _beside_flights(one, quiet)


def _beside_flights(one: Candidate, quiet: FitSolution) -> FitSolution:
    """Numbers of the speeds on the cam, with what those that lift off say of the restitution."""
    like = quiet.likelihood
    if len(like.holds) == len(one.likelihood.holds):
        return quiet
    flying = _of_all(one, quiet)
    if not any(landings_of(flying)):
        return quiet
    rings = any(hold.rings for hold in flying.likelihood.holds)
    zero = None if rings else zero_in_flight(flying)
    return replace(quiet, bounce=bounce_beside(flying) if zero is None else None, zero=zero)


def _quiet(
    still: Candidate, sought: tuple[str, ...], start: dict[str, float]
) -> FitSolution | None:
    """Two masses at the speeds without landings; None where there is none with a force.

    Bounces on a stem depend on every number at once, and their likelihood has a valley for each: a
    curvature there tells nothing of the others. On the cam the motion is linear. The fastest speed
    is left out as long as what is left of the forces has a pattern.
    """
    here = _on_the_cam(still)
    while _forces(still, here):
        found = search(continued(still, sought, start, tare=False, only=here))
        start = found.likelihood.values(found.x)
        flying = landings_of(found)
        if any(flying):
            here = [i for i, landings in zip(here, flying, strict=True) if not landings]
        elif len(here) > 1 and leaves_a_pattern(found.likelihood, found.x):
            here.remove(max(here, key=lambda i: still.likelihood.holds[i].speed))
        else:
            return found
    return None


def _with_resonance(one: FitSolution, stem: dict[str, float]) -> FitSolution:
    """One mass under a force sensor that vibrates as the likeliest stem does."""
    values = one.likelihood.values(one.x)
    end = values["mass"] * (1.0 - stem["roller_share"])
    rate = math.sqrt((stem["stem_stiffness"] + values["spring_stiffness"]) / end)
    start = continued(one, one.likelihood.sought, values, resonance=True)
    new, x = start.likelihood, start.x
    frequency, ratio = new.instruments.at(RESONANCE), new.instruments.at(RATIO)
    assert frequency is not None
    assert ratio is not None
    x[frequency], x[ratio] = math.log(rate / TURN), 0.5 * stem["stem_damping"] / (end * rate)
    return replace(search(start), bounce=one.bounce)


def two_masses(aligned: FitSolution, given: dict[str, float], progress: Progress) -> FitSolution:
    """Two masses and a stem, asked for: of one mass only as much is searched as they begin from."""
    rigid = {name: value for name, value in given.items() if name not in OF_TWO}
    still = _still(aligned, rigid)
    one = one_mass(aligned, rigid) if still is None else _of_all(aligned, still)
    begin = _where_it_shows(one)
    progress.tell("two masses and a stem")
    return _two_masses(one, begin, likely_stem(begin.likelihood, begin.x)[0], given)


def elastic(one: FitSolution, given: dict[str, float], progress: Progress) -> FitSolution:
    """What vibrates: the force sensor, where that explains all, else the stem; or nothing.

    It is looked for at the speeds on the cam, if it shows there, as bounces of a rigid mass on what
    has a stem tell nothing.
    """
    if any(hold.rings for hold in one.likelihood.holds):
        progress.tell("a resonance of the force sensor")
        return _ringing(one)
    if not leaves_a_pattern(one.likelihood, one.x):
        return one
    still = _where_it_shows(one)
    stem, gain = likely_stem(still.likelihood, still.x)
    if gain < CLEARLY_LIKELIER:
        return one
    best = one
    progress.tell("a resonance of the force sensor")
    sensor = _with_resonance(still, stem)
    if not leaves_a_pattern(sensor.likelihood, sensor.x):
        sensor = sensor if still is one else _with_resonance(one, stem)
        if log_ratio(sensor, one) > CLEARLY_LIKELIER:
            best = sensor
            if not leaves_a_pattern(sensor.likelihood, sensor.x):
                return sensor
    progress.tell("two masses and a stem")
    two = _two_masses(one, still, stem, given)
    return two if log_ratio(two, best) > CLEARLY_LIKELIER else best


def _where_it_shows(one: One) -> One | FitSolution:
    """One mass at the speeds on the cam alone, if what is left of the force has a pattern there."""
    calm = _calm(one)
    return one if calm is None or not leaves_a_pattern(calm.likelihood, calm.x) else calm


def _calm(one: Candidate) -> FitSolution | None:
    """One mass at the speeds on the cam alone; None where these are all, or have no force."""
    here = _on_the_cam(one)
    if len(here) == len(one.likelihood.holds) or not _forces(one, here):
        return None
    sought = tuple(name for name in one.likelihood.sought if name != "restitution")
    return search(continued(one, sought, one.likelihood.values(one.x), tare=False, only=here))


def _ringing(one: FitSolution) -> FitSolution:
    """One mass under a force sensor that shows pulls: no cam does, so no stem is sought.

    From the speeds on the cam, for a landing rings all that comes after it.
    """
    calm = _calm(one) or one
    if not leaves_a_pattern(calm.likelihood, calm.x):
        return calm if calm is one else _beside_flights(one, calm)
    sensor = _with_resonance(calm, likely_stem(calm.likelihood, calm.x)[0])
    likelier = sensor if log_ratio(sensor, calm) > CLEARLY_LIKELIER else calm
    return likelier if calm is one else _beside_flights(one, likelier)


def _has_play(found: FitSolution) -> bool:
    """Whether what is left of the lift stands apart after rises and after falls."""
    likelihood = found.likelihood
    if likelihood.instruments.at(ZERO) is None:
        return False
    start = continued(found, likelihood.sought, likelihood.values(found.x), play=True)
    new, x = start.likelihood, start.x
    slopes, residuals = new.slopes(x), new.residuals(x)
    at = new.instruments.at(BACKLASH)
    assert at is not None
    step, *_ = np.linalg.lstsq(slopes, -residuals, rcond=1e-12)
    error = uncertainty(FitSolution(new, x, slopes, residuals + slopes @ step)).errors[at]
    return bool(abs(step[at]) > max(PLAY * error, LEAST_PLAY * likelihood.law.lift))

"""Which follower is sought: one rigid mass, a force sensor that vibrates, two masses and a stem.

Each begins where the one before it ended, and the likelier stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.studies.rig_fit.bounces import (
    bounce_beside,
    tared,
    with_bounces,
    zero_in_flight,
)
from cam_rig.studies.rig_fit.instruments import BACKLASH, RATIO, RESONANCE, ZERO
from cam_rig.studies.rig_fit.likelihood import Likelihood
from cam_rig.studies.rig_fit.numbers import ONE_MASS, TWO_MASSES
from cam_rig.studies.rig_fit.search import (
    FitSolution,
    continued,
    contradict,
    landings_of,
    log_ratio,
    search,
    steady_holds_of,
)
from cam_rig.studies.rig_fit.start import leaves_a_pattern, likely_stem
from cam_rig.studies.rig_fit.uncertainty import uncertainty
from cam_rig.units import TURN

#: What vibrates is sought where the logarithm of its likelihood ratio is above this.
CLEARLY_LIKELIER = 30.0
#: A gauge's backlash is sought where it is beyond so many standard errors.
PLAY = 6.0
#: And beyond this part of the lift: less is rounding.
LEAST_PLAY = 1e-7
#: Restitutions from which lifts alone are searched.
BOUNCES_TRIED = (0.05, 0.25, 0.45, 0.65)


def one_mass(
    aligned: FitSolution, given: dict[str, float], quiet_does: bool = False
) -> FitSolution:
    """One rigid mass; the restitution once there are landings to tell it.

    First at the speeds without landings, if there are any: there a wrong restitution does no harm.

    Parameters
    ----------
    quiet_does : of several such speeds search no others, as two masses are sought from there on
    """
    smooth = tuple(name for name in ONE_MASS if name not in given and name != "restitution")
    values = aligned.likelihood.values(aligned.x) | {"restitution": 0.0} | given
    if not any(hold.force.value.size for hold in aligned.likelihood.holds):
        return _of_lifts(aligned, smooth, values, given)
    quiet = _on_the_cam(aligned)
    still = None
    if len(quiet) < len(aligned.likelihood.holds) and _forces(aligned, quiet):
        still = search(*continued(aligned, smooth, values, only=quiet))
        new, x = continued(aligned, smooth, still.likelihood.values(still.x))
        found = FitSolution(new, _with_phases_of(still, new, x), aligned.slopes, aligned.residuals)
        if quiet_does:
            return found
    else:
        found = search(*continued(aligned, smooth, values))
    if any(landings_of(found.likelihood, found.x)):
        found = with_bounces(tared(found), given)
    if _has_play(found):
        values = found.likelihood.values(found.x)
        bounce = found.bounce
        found = search(*continued(found, found.likelihood.sought, values, play=True))
        found = replace(found, bounce=bounce)
    return still if still is not None and contradict(still, found) else found


def _on_the_cam(found: FitSolution) -> list[int]:
    """The holds at which the follower stays on the cam.

    By the forces too: on a stem it leaves a cam with steps of acceleration at slower speeds than
    one rigid mass does.
    """
    still = [i for i, landings in enumerate(landings_of(found.likelihood, found.x)) if not landings]
    return [i for i in still if found.likelihood.holds[i].presses] or still


def _forces(found: FitSolution, holds: list[int]) -> bool:
    return any(found.likelihood.holds[i].force.value.size for i in holds)


def _of_lifts(
    aligned: FitSolution,
    smooth: tuple[str, ...],
    values: dict[str, float],
    given: dict[str, float],
) -> FitSolution:
    """One rigid mass from lifts alone: flights and bounces are told together or not at all.

    So from several restitutions on, and the least that is missed stays.
    """
    free = "restitution" not in given
    sought = (*smooth, "restitution") if free else smooth
    starts = [values | {"restitution": bounce} for bounce in BOUNCES_TRIED] if free else [values]
    found = [search(*continued(aligned, sought, start)) for start in starts]
    steady = [one for one in found if len(steady_holds_of(one)) == len(one.likelihood.holds)]
    if not steady:
        raise ConfigError(
            "no follower comes near the lifts and moves alike from turn to turn at every speed; "
            "needed: a contact force too, or speeds at which it bounces less"
        )
    return min(steady, key=lambda one: one.likelihood.lift_noise)


def _with_phases_of(still: FitSolution, new: Likelihood, x: FloatArray) -> FloatArray:
    """``x`` with the instruments of some holds, and phases of all on their line ψ = a + b ω t.

    One hold tells no line: then all phases are moved as its own is.
    """
    found = x.copy()
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
        found[new.instruments.phases] += phases[0] - x[at]
    for name in new.instruments.single:
        at = new.instruments.at(name)
        assert at is not None
        found[at] = still.likelihood.single(still.x, name)
    return found


def _two_masses(
    one: FitSolution, still: FitSolution, stem: dict[str, float], given: dict[str, float]
) -> FitSolution:
    """Two masses, from a stem and the numbers of one mass ``still`` at some speeds of ``one``."""
    values = still.likelihood.values(still.x) | {"restitution": given.get("restitution", 0.0)}
    sought = tuple(name for name in TWO_MASSES if name not in given and name != "restitution")
    start = values | stem | given
    quiet = _quiet(still, sought, start)
    if quiet is None:
        found = search(*continued(one, sought, start))
        if "restitution" not in given and any(landings_of(found.likelihood, found.x)):
            found = with_bounces(found, given)
        return found
    return quiet if "restitution" in given else _beside_flights(one, quiet)


def _beside_flights(one: FitSolution, quiet: FitSolution) -> FitSolution:
    """Numbers of the speeds on the cam, with what those that lift off say of the restitution."""
    like = quiet.likelihood
    if len(like.holds) == len(one.likelihood.holds):
        return quiet
    values, resonance = like.values(quiet.x), like.resonance
    new, x = continued(one, like.sought, values, resonance=resonance, tare=False)
    flying = FitSolution(new, _with_phases_of(quiet, new, x), one.slopes, one.residuals)
    if not any(landings_of(new, flying.x)):
        return quiet
    rings = any(hold.rings for hold in new.holds)
    zero = None if rings else zero_in_flight(flying)
    return replace(quiet, bounce=bounce_beside(flying) if zero is None else None, zero=zero)


def _quiet(
    still: FitSolution, sought: tuple[str, ...], start: dict[str, float]
) -> FitSolution | None:
    """Two masses at the speeds without landings; None where there is none with a force.

    Bounces on a stem depend on every number at once, and their likelihood has a valley for each: a
    curvature there tells nothing of the others. On the cam the motion is linear. The fastest speed
    is left out as long as what is left of the forces has a pattern.
    """
    here = _on_the_cam(still)
    while _forces(still, here):
        found = search(*continued(still, sought, start, tare=False, only=here))
        start = found.likelihood.values(found.x)
        flying = landings_of(found.likelihood, found.x)
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
    new, x = continued(one, one.likelihood.sought, values, resonance=True)
    frequency, ratio = new.instruments.at(RESONANCE), new.instruments.at(RATIO)
    assert frequency is not None
    assert ratio is not None
    x[frequency], x[ratio] = math.log(rate / TURN), 0.5 * stem["stem_damping"] / (end * rate)
    return replace(search(new, x), bounce=one.bounce)


def elastic(
    one: FitSolution,
    given: dict[str, float],
    model: str | None,
    on_step: Callable[[str], None],
) -> FitSolution:
    """What vibrates: the force sensor, where that explains all, else the stem; or nothing.

    It is looked for at the speeds on the cam, if it shows there, as bounces of a rigid mass on what
    has a stem tell nothing.
    """
    if model is None and any(hold.rings for hold in one.likelihood.holds):
        on_step("a resonance of the force sensor")
        return _ringing(one)
    if model is None and not leaves_a_pattern(one.likelihood, one.x):
        return one
    still = _calm(one)
    still = still if leaves_a_pattern(still.likelihood, still.x) else one
    stem, gain = likely_stem(still.likelihood, still.x)
    if model is None and gain < CLEARLY_LIKELIER:
        return one
    best = one
    if model is None:
        on_step("a resonance of the force sensor")
        sensor = _with_resonance(still, stem)
        if not leaves_a_pattern(sensor.likelihood, sensor.x):
            sensor = sensor if still is one else _with_resonance(one, stem)
            if log_ratio(sensor, one) > CLEARLY_LIKELIER:
                best = sensor
                if not leaves_a_pattern(sensor.likelihood, sensor.x):
                    return sensor
    on_step("two masses and a stem")
    two = _two_masses(one, still, stem, given)
    if model == "two_mass" or log_ratio(two, best) > CLEARLY_LIKELIER:
        return two
    return best


def _calm(one: FitSolution) -> FitSolution:
    """One mass at the speeds on the cam alone; as it is where these are all, or have no force."""
    here = _on_the_cam(one)
    if len(here) == len(one.likelihood.holds) or not _forces(one, here):
        return one
    sought = tuple(name for name in one.likelihood.sought if name != "restitution")
    return search(*continued(one, sought, one.likelihood.values(one.x), tare=False, only=here))


def _ringing(one: FitSolution) -> FitSolution:
    """One mass under a force sensor that shows pulls: no cam does, so no stem is sought.

    From the speeds on the cam, for a landing rings all that comes after it.
    """
    calm = _calm(one)
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
    new, x = continued(found, likelihood.sought, likelihood.values(found.x), play=True)
    slopes, residuals = new.slopes(x), new.residuals(x)
    at = new.instruments.at(BACKLASH)
    assert at is not None
    step, *_ = np.linalg.lstsq(slopes, -residuals, rcond=1e-12)
    error = uncertainty(FitSolution(new, x, slopes, residuals + slopes @ step)).errors[at]
    return bool(abs(step[at]) > max(PLAY * error, LEAST_PLAY * likelihood.law.lift))

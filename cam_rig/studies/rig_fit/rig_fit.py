"""The numbers of a rig from a run that was measured on it."""

from __future__ import annotations

from collections.abc import Callable

from cam_rig.arrays import rms
from cam_rig.dynamics.parameters import si_or_none
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.simulation.measured_run import MeasuredRun
from cam_rig.studies.rig_fit.found import RigFit, found_of
from cam_rig.studies.rig_fit.likelihood import Likelihood
from cam_rig.studies.rig_fit.measured_turns import measured_holds
from cam_rig.studies.rig_fit.models import elastic, one_mass, two_masses
from cam_rig.studies.rig_fit.numbers import OF_TWO, ONE_MASS, require_in_model
from cam_rig.studies.rig_fit.profile import profiled
from cam_rig.studies.rig_fit.search import Candidate, FitSolution, search
from cam_rig.studies.rig_fit.start import rough_start

#: A lift that is further from the law's than this part of it, r.m.s., at the slowest speed is of
#: another cam.
FAR_OFF = 0.05
#: What is said where the search has no number to begin at.
FROM, OTHER = "the fit, which begins at it", "begin at another rig"


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
    model : one_mass, two_mass (two masses and a stem), or None for the likelier
    given : numbers that are known, by name, SI
    on_step : told what is being done

    Raises
    ------
    ConfigError : the cam nowhere turns steadily, nothing was measured, nothing fits, a number that
        is given is beyond its limits, or a stem is asked for that nothing can tell
    """
    given = dict(given or {})
    require_in_model(given, model)
    holds = measured_holds(run)
    rigid = {name: value for name, value in given.items() if name not in OF_TWO}
    values = {n: base.need(n, FROM, OTHER).si for n in ONE_MASS if n not in rigid} | rigid
    on_step("the encoder's zero")
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
    start.force_noise = (
        0.01 * max((h.force.value.max(initial=0.0) for h in holds), default=1.0) or 1.0
    )
    on_step("one rigid mass")
    aligned = search(Candidate(start, start.start(values, phase, zero)))
    if _is_of_another_cam(aligned):
        return found_of(law, run, aligned, given, tuple(scale), holds)
    if model == "two_mass":
        found = two_masses(aligned, given, on_step)
    else:
        found = one_mass(aligned, rigid | scale)
        if model is None and forces:
            found = elastic(found, given, on_step)
    on_step("standard errors")
    return found_of(law, run, profiled(found), given, tuple(scale), holds)


def _is_of_another_cam(aligned: FitSolution) -> bool:
    """Whether the lift at the slowest speed is far from the law's though the follower presses.

    A follower that has left the cam may be as far from it, so a force has to say that it has not.
    """
    like, x = aligned.likelihood, aligned.x
    slowest = min(range(len(like.holds)), key=lambda i: like.holds[i].speed)
    hold, predicted = like.holds[slowest], like.predicted(x, slowest)
    if predicted is None or not (hold.lift.value.size and hold.force.value.size and hold.presses):
        return False
    return rms(predicted.lift_left) > FAR_OFF * like.law.lift

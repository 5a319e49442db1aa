"""The numbers of a rig from a run that was measured on it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cam_rig.dynamics.parameters import si_or_none
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.measured.rig_fit.estimates import found_of
from cam_rig.measured.rig_fit.found import FoundNumber
from cam_rig.measured.rig_fit.models import elastic, one_mass, two_masses
from cam_rig.measured.rig_fit.numbers import OF_TWO, ONE_MASS, require_in_model
from cam_rig.measured.rig_fit.profile import profiled
from cam_rig.measured.rig_fit.residuals import Likelihood
from cam_rig.measured.rig_fit.result import RigFit
from cam_rig.measured.rig_fit.search import Candidate, FitSolution, search
from cam_rig.measured.rig_fit.start import rough_start
from cam_rig.measured.rig_fit.turns import measured_holds
from cam_rig.schema import RigConfig
from cam_rig.schema.load import assumed_numbers, quantity, to_yaml
from cam_rig.show.result import SILENT, Progress
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.units import rms

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
    progress: Progress = SILENT,
) -> RigFit:
    """Find a follower's numbers from its measured lift and contact force at steady speeds.

    ``base``: rig whose numbers the search takes for those that nothing tells; ``model``: one_mass,
    two_mass (two masses and a stem), or None for the likelier; ``given``: numbers that are known,
    by name, SI.
    """
    given = dict(given or {})
    require_in_model(given, model)
    holds = measured_holds(run)
    rigid = {name: value for name, value in given.items() if name not in OF_TWO}
    values = {n: base.need(n, FROM, OTHER).si for n in ONE_MASS if n not in rigid} | rigid
    progress.tell("the encoder's zero")
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
    progress.tell("one rigid mass")
    aligned = search(Candidate(start, start.start(values, phase, zero)))
    if _is_of_another_cam(aligned):
        return found_of(law, run, aligned, given, tuple(scale), holds)
    if model == "two_mass":
        found = two_masses(aligned, given, progress)
    else:
        found = one_mass(aligned, rigid | scale)
        if model is None and forces:
            found = elastic(found, given, progress)
    progress.tell("standard errors")
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


# A rig file of what was identified; what nothing tells is another rig's, and assumed.


def fitted_rig(
    name: str, numbers: Iterable[FoundNumber], base: RigConfig, source: str, residual: str
) -> tuple[str, tuple[str, ...]]:
    """The file's text, and what it assumes, a sentence each.

    ``base``: rig whose numbers stand where nothing else is known; ``source``, ``residual``: of what
    was identified, for the file.
    """
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

"""Identification of a follower from its measured lift and contact force at steady speeds."""

from __future__ import annotations

from cam_rig.dynamics.parameters import si_or_none
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.studies.fit_rig.parameters import ONE_MASS, TWO_MASS_ONLY, check_fixed
from cam_rig.studies.fit_rig.run.estimates import build_rig_fit
from cam_rig.studies.fit_rig.run.likelihood import Likelihood
from cam_rig.studies.fit_rig.run.models import fit_elastic, fit_one_mass, fit_two_masses
from cam_rig.studies.fit_rig.run.restitution_interval import profile_restitution
from cam_rig.studies.fit_rig.run.result import RigFit
from cam_rig.studies.fit_rig.run.search import Candidate, FitSolution, search
from cam_rig.studies.fit_rig.run.start import rough_start
from cam_rig.studies.fit_rig.run.turns import measured_segments
from cam_rig.units import rms

#: R.m.s. difference between the measured lift and the law at the slowest speed, as a fraction of
#: the total lift, above which the run is taken as that of a different cam.
MAX_LIFT_ERROR = 0.05


def fit_run(
    law: Law,
    run: MeasuredRun,
    base: RigConfig,
    model: str | None = None,
    fixed: dict[str, float] | None = None,
    progress: Progress = NULL_PROGRESS,
) -> RigFit:
    """Identify a follower from its measured lift and contact force at steady speeds.

    Parameters
    ----------
    law : Law
        Law of the cam.
    run : MeasuredRun
        Measured run.
    base : RigConfig
        Rig with the start values, and the values of parameters that are not identifiable.
    model : str, optional
        ``one_mass``, ``two_mass`` (two masses and a stem), or None for the likelier.
    fixed : dict of str to float, optional
        Known values in SI by rig-file key.
    progress : Progress, optional
        Receiver of the progress.

    Raises
    ------
    ConfigError
        If values are outside their limits, or the run has no steady speeds, or lacks the signals
        that the model needs.
    """
    fixed = dict(fixed or {})
    check_fixed(fixed, model)
    run, segments = measured_segments(run)
    rigid = {name: value for name, value in fixed.items() if name not in TWO_MASS_ONLY}
    purpose = "the start values of the fit", "use another --rig"
    # If the rig has no restitution, the search starts from 0. It affects landings only.
    optional = {"restitution": si_or_none(base.follower.restitution) or 0.0}
    values = {
        n: optional[n] if n in optional else base.need(n, *purpose).si
        for n in ONE_MASS
        if n not in rigid
    } | rigid
    progress.start(None, "reading")
    progress.describe("the encoder's zero")
    rough, phase, zero = rough_start(law, segments, values)
    values = rough | rigid
    forces = any(segment.force.value.size for segment in segments)
    if model == "two_mass" and not forces:
        raise ConfigError(
            f"{run.source}: --model two_mass requires a contact force, which the run does not "
            "contain; use --model one_mass"
        )
    scale = {} if forces or set(fixed) & set(ONE_MASS[:4]) else {"mass": values["mass"]}
    stem = fixed.get("stem_stiffness", si_or_none(base.follower.stem_stiffness))
    start = Likelihood(law, segments, (), values, stem)
    start.force_noise = (
        0.01 * max(segment.force.value.max(initial=0.0) for segment in segments) or 1.0
    )
    progress.describe("one rigid mass")
    aligned = search(Candidate(start, start.start(values, phase, zero)))
    if _is_of_another_cam(aligned):
        return build_rig_fit(run, aligned, fixed, tuple(scale), segments)
    if model == "two_mass":
        solution = fit_two_masses(aligned, fixed, progress)
    else:
        solution = fit_one_mass(aligned, rigid | scale)
        if model is None and forces:
            solution = fit_elastic(solution, fixed, progress)
    progress.describe("standard errors")
    return build_rig_fit(run, profile_restitution(solution), fixed, tuple(scale), segments)


def _is_of_another_cam(aligned: FitSolution) -> bool:
    """Return True if the measured lift shows that another cam was on the rig.

    The measured lift at the slowest speed then differs from the law. A follower that loses contact
    has a different lift too, so the result is True only if the contact force shows that contact was
    kept. ``aligned`` is the fit of the start values.
    """
    slowest = min(range(len(aligned.segments)), key=lambda i: aligned.segments[i].speed)
    segment, predicted = aligned.segments[slowest], aligned.predicted[slowest]
    if predicted is None or not (
        segment.lift.value.size and segment.force.value.size and segment.presses
    ):
        return False
    return rms(predicted.lift.residual) > MAX_LIFT_ERROR * aligned.likelihood.law.lift

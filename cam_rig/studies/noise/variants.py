"""Further parts of the noise study: another rig, and why the arc cam is quiet.

The other rig is identified from the jump speeds (Table 2 of the paper), so event angles, preload,
mass split and stem are not fitted to noise. Gain and corner frequency are refitted to the reference
cam. The arc cam is not in Table 2, so it is fitted to its noise curve twice: on that rig with a
rigid stem, which shows the effect of the preload, and on request with the complete two-mass
follower.

A factorial varies the reference cam in three factors: two lifts, with and without the high dwell,
and two rises. The second rise has an acceleration that jumps at a dwell, as in a cam of arcs. Rise
and fall keep their angles. Without the high dwell the low dwell is longer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import Bounds, OptimizeResult, differential_evolution

from cam_rig.acoustics import RadiationParameters
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import CamRigError
from cam_rig.laws.segments import NAMED_RISES, up_and_down
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.segments import Dwell, Rise
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.regression import cubic_projection
from cam_rig.simulation.simulate import Acoustics, simulate_steady_turns
from cam_rig.simulation.sound_constants import PublishedCam, fit_two_constants
from cam_rig.studies.noise.arc_cam import IMPOSSIBLE, MAX_FLANK, ArcShape, ShapeProblem
from cam_rig.studies.noise.methods import crossing
from cam_rig.studies.noise.roles import EVERY, NoiseSetup
from cam_rig.units import FloatArray

#: Bounds of the search for the shape of the arc cam: lift (m), angle of rise and fall together
#: (rad), and curvature of the flank (1/m).
SEARCH_BOUNDS = Bounds([0.002, 1.2, 1.0 / MAX_FLANK], [0.02, 3.5, 40.0])
#: Largest number of generations of the evolutionary search for the shape of the arc cam.
GENERATIONS = 12
#: Number of shapes per generation of the evolutionary search, as a multiple of the number of varied
#: numbers.
POPULATION = 7
#: Seed of the random generator of the evolutionary search.
SEED = 2


@dataclass(frozen=True)
class OneRig:
    """Noise of the cams with a follower that is identified from the jump speeds.

    Parameters
    ----------
    name : str
        Name of the rig.
    acoustics : Acoustics
        Acoustic constants, fitted to the reference cam.
    rms_db : dict
        R.m.s. difference in dB of the simulated levels to the published regression of each cam.
    shape : ArcShape, optional
        Geometry of the arc cam. None if it was not fitted.
    crossing_rpm : float, optional
        Speed in rpm at which the two cams that the paper names are equally loud. None if the arc
        cam was not fitted.
    """

    name: str
    acoustics: Acoustics
    rms_db: dict[str, float]
    shape: ArcShape | None
    crossing_rpm: float | None


def with_rigid_stem(study: NoiseSetup, rig: RigConfig) -> OneRig:
    """Return the noise of the cams with a rig's follower as one rigid mass.

    Mass, spring and preload are those of ``rig``. The shape of the arc cam is fitted.
    """
    follower = FollowerParameters.from_rig(rig)
    smooth = _smooth(study, "one_mass", follower)
    acoustics = fit_two_constants([smooth[study.roles.reference]], study.start)
    problem = study.shape_problem("one_mass", follower)
    # Initial lift of the fit: the lift-off speed is the same if lift and preload increase together.
    preload_ratio = rig.follower.preload.si / study.loaded.rig.follower.preload.si
    shape = problem.fit(study.shape.scaled(preload_ratio**0.5, 1.0), acoustics)
    arcs = problem.cam_of(shape)
    return _result(f"{rig.name}, rigid stem", study, acoustics, smooth, shape, arcs)


def with_elastic_stem(
    study: NoiseSetup, rig: RigConfig, arcs: bool = False, progress: Progress = NULL_PROGRESS
) -> OneRig:
    """Return the noise of the cams with the complete two-mass follower of a rig.

    If ``arcs`` is True, the shape of the arc cam (of tangent circular arcs) is fitted too, which
    takes minutes.
    """
    follower = TwoMassParameters.from_rig(rig)
    smooth = _smooth(study, "two_mass", follower)
    start = Acoustics(_landing_on_roller(study, follower))
    acoustics = fit_two_constants([smooth[study.roles.reference]], start)
    if not arcs:
        return _result(rig.name, study, acoustics, smooth)
    problem = study.shape_problem("two_mass", follower)
    shape = _search(problem, acoustics, progress)
    return _result(rig.name, study, acoustics, smooth, shape, problem.cam_of(shape))


def _smooth(study: NoiseSetup, model: str, follower: Any) -> dict[str, PublishedCam]:
    """Return the simulated turns of the two cams without arcs, with another follower.

    They are the reference and the predicted cam, at all speeds of the study. ``model`` is the
    dynamic model of the follower.
    """
    cams = (study.cams[cam] for cam in (study.roles.reference, study.roles.predicted))
    return {
        cam.cam: replace(
            cam,
            turns=simulate_steady_turns(
                study.loaded.laws[cam.cam], model, follower, cam.turns.speeds
            ),
        )
        for cam in cams
    }


def _landing_on_roller(study: NoiseSetup, follower: TwoMassParameters) -> RadiationParameters:
    """Return radiation parameters with the contact time of landings of the roller.

    The two-mass model contains the elasticity of the stem, so only that of the contact remains. The
    paper does not print it. It is assumed equal to the stem stiffness of the scene's rig (Table 1).
    """
    stiffness = study.loaded.follower.stem
    time = np.pi * np.sqrt(follower.roller_mass / stiffness)
    return replace(study.loaded.radiation, contact_time=float(time))


def _search(problem: ShapeProblem, acoustics: Acoustics, progress: Progress) -> ArcShape:
    """Return the shape of the arc cam with the smallest r.m.s. level difference.

    The search is evolutionary and uses no gradient, because the difference is not a smooth function
    of the shape with an elastic stem.
    """

    def cost(x: FloatArray) -> float:
        try:
            return problem.cam_of(ArcShape(*x.tolist())).rms(acoustics)
        except CamRigError:
            return IMPOSSIBLE

    def report(intermediate_result: OptimizeResult) -> None:
        progress.describe(f"one rig, best {intermediate_result.fun:.1f} dB")

    options: dict[str, Any] = {"popsize": POPULATION, "maxiter": GENERATIONS, "polish": False}
    solution = differential_evolution(cost, SEARCH_BOUNDS, seed=SEED, callback=report, **options)
    return ArcShape(*solution.x.tolist())


def _result(
    name: str,
    study: NoiseSetup,
    acoustics: Acoustics,
    smooth: dict[str, PublishedCam],
    shape: ArcShape | None = None,
    arcs: PublishedCam | None = None,
) -> OneRig:
    if arcs is None:
        rms_db = {name: cam.rms(acoustics) for name, cam in smooth.items()}
        return OneRig(name, acoustics, rms_db, None, None)
    thinned = {key: cam.every(EVERY) for key, cam in smooth.items()} | {arcs.cam: arcs}
    named = study.crossover
    first, second = (
        cubic_projection(arcs.rpm) @ acoustics.levels(thinned[cam].turns) for cam in named.between
    )
    crossed = crossing(arcs.rpm, first, second, named.rpm)
    rms_db = {key: cam.rms(acoustics) for key, cam in (smooth | {arcs.cam: arcs}).items()}
    return OneRig(name, acoustics, rms_db, shape, crossed)


# Factorial of three possible reasons why the arc cam is quiet: its lift, the missing high dwell,
# and its joints.

#: Name of a rise law whose acceleration jumps at a dwell, as it does at the joints between the arcs
#: of a cam of arcs.
WITH_JUMPS = "simple_harmonic"
#: Names of the factors of the factorial study, in their order. "Joints" means whether the
#: acceleration jumps at the joints between rise and dwell.
FACTORS = ("lift", "high dwell", "joints")


class Timing(NamedTuple):
    """Rise law, event, high dwell (rad) and lift (m) of a cam.

    Its rise and fall are equal. ``event`` is the angle of the rise, which is also that of the fall.
    """

    rise: str
    event: float
    high_dwell: float
    lift: float


@dataclass(frozen=True, eq=False)
class HighDwellStudy:
    """Result of the factorial study of lift, high dwell and jumps at joints.

    Parameters
    ----------
    levels_db : dict
        Sound levels in dB at the speeds of the study, by lift (m), high dwell (rad) and rise. The
        first of the eight cams is the reference.
    shares : mapping
        Fraction of the sum of squares of the mean levels for each factor and each interaction of
        factors. The keys are tuples of indices into `FACTORS`.
    """

    levels_db: dict[tuple[float, float, str], FloatArray]
    shares: Mapping[tuple[int, ...], float]

    def change_db(self, factor: str) -> FloatArray:
        """Return the change of the reference cam's levels (dB) if one factor changes.

        ``factor`` is one of `FACTORS`. The shape is (n,), for n speeds.
        """
        # The last factor varies fastest, so the cams 4, 2 and 1 differ from cam 0 in the first,
        # second and third factor.
        return list(self.levels_db.values())[4 >> FACTORS.index(factor)] - self.reference

    @property
    def reference(self) -> FloatArray:
        """Sound levels (dB) of the reference cam at the speeds of the study, shape (n,)."""
        return next(iter(self.levels_db.values()))


def timing_of(cam: CamConfig) -> Timing | None:
    """Return rise law, angles and lift of a cam with a high dwell between equal rises.

    The result is None for a cam of another kind.
    """
    rises = [segment for segment in cam.segments if isinstance(segment, Rise)]
    dwells = [segment for segment in cam.segments if isinstance(segment, Dwell)]
    shape = [isinstance(segment, Rise) for segment in cam.segments]
    if shape not in ([False, True, False, True, False], [False, True, False, True]):
        return None
    if len(rises) + len(dwells) < len(shape) or rises[0].law != rises[1].law:
        return None
    up, down = (rise.span.si for rise in rises)
    if abs(up - down) > 1e-9 or any(NAMED_RISES[rises[0].law].slopes):
        return None
    return Timing(rises[0].law, up, dwells[1].span.si, cam.lift.si)


def study_high_dwell(
    setup: NoiseSetup, acoustics: Acoustics, other_lift: float
) -> HighDwellStudy | None:
    """Compute the factorial of the reference cam: lift, high dwell and joints.

    ``other_lift`` (m) is the second lift, that of the arc cam. Returns None if the reference cam
    cannot be changed in all three factors. It must have a high dwell between two equal rises, a
    lift that differs from ``other_lift``, and an acceleration without jumps. ``setup`` contains the
    scene and the cams, and ``acoustics`` the acoustic constants.
    """
    timing = timing_of(setup.loaded.cams[setup.roles.reference])
    if timing is None:
        return None
    choices = ((timing.lift, other_lift), (timing.high_dwell, 0.0), (timing.rise, WITH_JUMPS))
    if any(first == second for first, second in choices):
        return None
    speeds = np.asarray(setup.cams[setup.roles.reference].turns.speeds)
    levels = {}
    for lift, dwell, rise in product(*choices):
        law = up_and_down(rise, timing.event, lift, dwell)
        turns = simulate_steady_turns(law, "one_mass", setup.loaded.follower, speeds)
        levels[lift, dwell, rise] = acoustics.levels(turns)
    means = np.array([level.mean() for level in levels.values()]).reshape(2, 2, 2)
    return HighDwellStudy(levels, two_levels(means))


def two_levels(values: FloatArray) -> dict[tuple[int, ...], float]:
    """Return the fraction of the sum of squares due to each factor and interaction.

    ``values`` are the results of a factorial study with two levels per factor, shape (2, …, 2) with
    one axis per factor. The keys are the interacting axes, such as ``(0,)`` or ``(0, 2)``. The
    fractions add up to one, or are all zero if the values are equal.
    """
    signs = np.array([-1.0, 1.0])
    squares = {}
    for count in range(1, values.ndim + 1):
        for axes in combinations(range(values.ndim), count):
            contrast = values
            for axis in axes:
                shape = [2 if i == axis else 1 for i in range(values.ndim)]
                contrast = contrast * signs.reshape(shape)
            squares[axes] = float(contrast.mean()) ** 2
    total = sum(squares.values()) or 1.0
    return {axes: square / total for axes, square in squares.items()}

"""One rig for all: the follower identified from the jump speeds, its noise on all three cams.

Event angles, preload, mass split and stem come from the jump speeds (Table 2); nothing of them is
fitted to noise. Gain and corner are fitted to the reference anew. The arc cam, which the jump
speeds know nothing of, is fitted to its own curve twice: on that rig with a rigid stem, which
shows what its preload does, and, when asked, on the whole two-mass follower.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from cam_rig.acoustics import RadiationParameters
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.errors import CamRigError
from cam_rig.paper.noise.arc_cam import IMPOSSIBLE, MAX_FLANK, ArcShape, ShapeProblem
from cam_rig.paper.noise.calibration import PublishedCam, two_constants
from cam_rig.paper.noise.methods import crossing
from cam_rig.paper.noise.roles import EVERY, NoiseSetup
from cam_rig.schema import RigConfig
from cam_rig.show.result import SILENT, Progress
from cam_rig.simulation.regression import cubic
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import FloatArray

#: Lift (m), event (rad) and curvature of the flank (1/m) that the search goes through.
SEARCHED = Bounds([0.002, 1.2, 1.0 / MAX_FLANK], [0.02, 3.5, 40.0])
#: Generations of the search, shapes a generation for each number, and its seed.
GENERATIONS, POPULATION, SEED = 12, 7, 2


@dataclass(frozen=True)
class OneRig:
    """The fit error on each cam's noise with a follower identified from the jump speeds.

    ``rms_db`` of the points to the published regressions; ``shape`` of the arc cam and
    ``crossing_rpm`` are None when it was left aside.
    """

    name: str
    acoustics: Acoustics
    rms_db: dict[str, float]
    shape: ArcShape | None
    crossing_rpm: float | None


def with_rigid_stem(study: NoiseSetup, rig: RigConfig) -> OneRig:
    """The rig's masses, spring and preload on a rigid stem."""
    follower = FollowerParameters.from_rig(rig)
    smooth = _smooth(study, "one_mass", follower)
    acoustics = two_constants([smooth[study.roles.reference]], study.start)
    problem = study.shape_problem("one_mass", follower)
    # Lift-off stays at its speed when lift and preload grow together.
    share = rig.follower.preload.si / study.loaded.rig.follower.preload.si
    shape = problem.fit(study.shape.scaled(share**0.5, 1.0), acoustics)
    arcs = problem.cam_of(shape)
    return _result(f"{rig.name}, rigid stem", study, acoustics, smooth, shape, arcs)


def with_elastic_stem(
    study: NoiseSetup, rig: RigConfig, arcs: bool = False, progress: Progress = SILENT
) -> OneRig:
    """The whole two-mass follower of the rig; ``arcs``: the arc cam's shape too, in minutes."""
    follower = TwoMassParameters.from_rig(rig)
    smooth = _smooth(study, "two_mass", follower)
    start = Acoustics(_landing_on_roller(study, follower))
    acoustics = two_constants([smooth[study.roles.reference]], start)
    if not arcs:
        return _result(rig.name, study, acoustics, smooth)
    problem = study.shape_problem("two_mass", follower)
    shape = _search(problem, acoustics, progress)
    return _result(rig.name, study, acoustics, smooth, shape, problem.cam_of(shape))


def _smooth(study: NoiseSetup, model: str, follower: Any) -> dict[str, PublishedCam]:
    """Reference and predicted cam on another follower, at all speeds."""
    cams = (study.cams[cam] for cam in (study.roles.reference, study.roles.predicted))
    return {
        one.cam: replace(
            one, turns=settled_turns(study.loaded.laws[one.cam], model, follower, one.turns.speeds)
        )
        for one in cams
    }


def _landing_on_roller(study: NoiseSetup, follower: TwoMassParameters) -> RadiationParameters:
    """The radiation with a landing's pulse as long as the roller's mass takes on the cam.

    The stem's give is in the model; what is left is the contact itself, for which the paper
    prints nothing, so it is taken as stiff as the rigid rig's stem (its Table 1).
    """
    stiffness = study.loaded.follower.stem
    time = np.pi * np.sqrt(follower.roller_mass / stiffness)
    return replace(study.loaded.radiation, contact_time=float(time))


def _search(problem: ShapeProblem, acoustics: Acoustics, progress: Progress) -> ArcShape:
    """The shape of least r.m.s. difference; an elastic stem gives no smooth gradient."""

    def cost(x: FloatArray) -> float:
        try:
            return problem.cam_of(ArcShape(*x.tolist())).rms(acoustics)
        except CamRigError:
            return IMPOSSIBLE

    found = differential_evolution(
        cost,
        SEARCHED,
        seed=SEED,
        popsize=POPULATION,
        maxiter=GENERATIONS,
        polish=False,
        callback=lambda intermediate_result: progress.tell(
            f"one rig, best {intermediate_result.fun:.1f} dB"
        ),
    )
    return ArcShape(*found.x.tolist())


def _result(
    name: str,
    study: NoiseSetup,
    acoustics: Acoustics,
    smooth: dict[str, PublishedCam],
    shape: ArcShape | None = None,
    arcs: PublishedCam | None = None,
) -> OneRig:
    if arcs is None:
        left = {cam: one.rms(acoustics) for cam, one in smooth.items()}
        return OneRig(name, acoustics, left, None, None)
    thinned = {cam: one.every(EVERY) for cam, one in smooth.items()} | {arcs.cam: arcs}
    named = study.crossover
    one, two = (cubic(arcs.rpm) @ acoustics.levels(thinned[cam].turns) for cam in named.between)
    crossed = crossing(arcs.rpm, one, two, named.rpm)
    left = {name: cam.rms(acoustics) for name, cam in (smooth | {arcs.cam: arcs}).items()}
    return OneRig(name, acoustics, left, shape, crossed)

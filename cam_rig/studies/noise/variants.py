"""The noise study on another rig, and on other cams: one rig for all; why the arc cam is quiet.

One rig for all: event angles, preload, mass split and stem come from the jump speeds (Table 2);
nothing of them is fitted to noise. Gain and corner are fitted to the reference anew. The arc cam,
which the jump speeds know nothing of, is fitted to its own curve twice: on that rig with a rigid
stem, which shows what its preload does, and, when asked, on the whole two-mass follower.

Why the arc cam is quiet is a factorial: the reference cam's rise and fall with two lifts, with and
without the high dwell, and with two rises: the reference's own, and one whose acceleration jumps
where it joins a dwell, as a cam of arcs has it. Rise and fall keep their angles; without the high
dwell the low one is longer.
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
from cam_rig.simulation.regression import cubic
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.simulation.sound_constants import PublishedCam, two_constants
from cam_rig.studies.noise.arc_cam import IMPOSSIBLE, MAX_FLANK, ArcShape, ShapeProblem
from cam_rig.studies.noise.methods import crossing
from cam_rig.studies.noise.roles import EVERY, NoiseSetup
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
    study: NoiseSetup, rig: RigConfig, arcs: bool = False, progress: Progress = NULL_PROGRESS
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

    def tell(intermediate_result: OptimizeResult) -> None:
        progress.describe(f"one rig, best {intermediate_result.fun:.1f} dB")

    options: dict[str, Any] = {"popsize": POPULATION, "maxiter": GENERATIONS, "polish": False}
    found = differential_evolution(cost, SEARCHED, seed=SEED, callback=tell, **options)
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


# Why the arc cam is quiet: its lift, its missing high dwell or its joints, as a factorial. The
# reference cam's rise and fall with two lifts, with and without the high dwell, and with two rises:
# its own, and one whose acceleration jumps where it joins a dwell, as a cam of arcs has it. Rise
# and fall keep their angles; without the high dwell the low one is longer.

#: The rise whose acceleration jumps at a dwell, as at the joints of arcs.
WITH_JUMPS = "simple_harmonic"
#: The factors in their order, in words.
FACTORS = ("lift", "high dwell", "joints")


class Timing(NamedTuple):
    """A cam that rises, dwells, falls by one named rise: its angles in rad, its lift in m."""

    rise: str
    event: float
    high_dwell: float
    lift: float


@dataclass(frozen=True, eq=False)
class HighDwellStudy:
    """Levels (dB) of the eight cams at the study's speeds, the first the reference itself.

    A cam is told by lift (m), high dwell (rad) and rise. ``shares`` are those of the sum of squares
    of the mean levels, by the factors that act together (indices into `FACTORS`).
    """

    levels_db: dict[tuple[float, float, str], FloatArray]
    shares: Mapping[tuple[int, ...], float]

    def change_db(self, factor: str) -> FloatArray:
        """What changing one of `FACTORS` alone does to the reference's levels, dB."""
        # The levels are listed with the last factor changing first: 4, 2 and 1 change one alone.
        return list(self.levels_db.values())[4 >> FACTORS.index(factor)] - self.reference

    @property
    def reference(self) -> FloatArray:
        """Levels (dB) of the reference cam."""
        return next(iter(self.levels_db.values()))


def timing_of(cam: CamConfig) -> Timing | None:
    """The timing of a cam that rises and falls by one named rise with a high dwell; else None."""
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
    """Run the eight cams; None where the reference cam cannot be changed in all three.

    It must have a high dwell between two equal rises, another lift than the arc cam's
    ``other_lift`` (m), and no jumps at its joints.
    """
    timing = timing_of(setup.loaded.cams[setup.roles.reference])
    if timing is None:
        return None
    choices = ((timing.lift, other_lift), (timing.high_dwell, 0.0), (timing.rise, WITH_JUMPS))
    if any(own == other for own, other in choices):
        return None
    speeds = np.asarray(setup.cams[setup.roles.reference].turns.speeds)
    levels = {}
    for lift, dwell, rise in product(*choices):
        law = up_and_down(rise, timing.event, lift, dwell)
        turns = settled_turns(law, "one_mass", setup.loaded.follower, speeds)
        levels[lift, dwell, rise] = acoustics.levels(turns)
    means = np.array([level.mean() for level in levels.values()]).reshape(2, 2, 2)
    return HighDwellStudy(levels, two_levels(means))


def two_levels(values: FloatArray) -> dict[tuple[int, ...], float]:
    """Shares of the sum of squares of k factors with two levels each, and of their interactions.

    Of ``values`` ``(2, …, 2)``, an axis a factor; by the axes that act together, ``(0,)`` or
    ``(0, 2)``. They add up to one, or are all zero where nothing varies.
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
    whole = sum(squares.values()) or 1.0
    return {axes: square / whole for axes, square in squares.items()}

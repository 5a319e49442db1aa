"""The whole noise study, part after part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cam_rig.dynamics import TwoMassParameters
from cam_rig.paper.noise.calibration import StructureFit, compare_structures
from cam_rig.paper.noise.high_dwell import HighDwellStudy, study_high_dwell
from cam_rig.paper.noise.methods import (
    LeftOut,
    Method,
    StudiedCurve,
    leave_one_out,
    with_substitution,
    with_two_constants,
)
from cam_rig.paper.noise.roles import NoiseSetup, StudyRoles
from cam_rig.paper.noise.shared_rig import OneRig, with_elastic_stem, with_rigid_stem
from cam_rig.schema import RigConfig
from cam_rig.simulation.scene import LoadedScene
from cam_rig.units import FloatArray

#: The parts of a study in order, for the progress bar.
PARTS = (
    "the cams' turns",
    "structures",
    "two constants",
    "by substitution",
    "leave one out",
    "one rig",
    "lift, high dwell and joints",
)


@dataclass(frozen=True, eq=False)
class NoiseStudy:
    """All that a noise study finds; `structures` by the cam that they were fitted to."""

    roles: StudyRoles
    rpm: FloatArray
    structures: dict[str, list[StructureFit]]
    methods: tuple[Method, ...]
    left_out: list[LeftOut]
    one_rig: tuple[OneRig, ...]
    high_dwell: HighDwellStudy | None = None

    @property
    def best(self) -> Method:
        """The way of calibrating that predicts best what it was not fitted to.

        The rule looks at curves of which no number was fitted, not at the crossing; of ways that
        predict alike, the first, which has the fewest fitted numbers.
        """
        return min(self.methods, key=lambda method: round(method.predicted_rms_db, 3))


def study_noise(
    loaded: LoadedScene,
    rig: RigConfig,
    arcs: bool = False,
    on_part: Callable[[str], None] = lambda _: None,
    on_best: Callable[[float], None] = lambda _: None,
) -> NoiseStudy:
    """Run every part of the study on a scene.

    Parameters
    ----------
    rig : the rig identified from the jump speeds, whose noise is compared too
    arcs : also fit the arc cam on that rig's two masses, which takes minutes
    on_part, on_best : told the part that begins, and how good (dB) that fit has become
    """
    on_part(PARTS[0])
    TwoMassParameters.from_rig(rig)  # refused now rather than at the end
    study = NoiseSetup.of(loaded)
    smooth = (study.roles.reference, study.roles.predicted)
    on_part(PARTS[1])
    structures = {cam: _structures(study, cam) for cam in smooth}
    on_part(PARTS[2])
    methods = [with_two_constants(study, refit) for refit in (False, True)]
    on_part(PARTS[3])
    methods.append(with_substitution(study))
    on_part(PARTS[4])
    left_out = leave_one_out(study)
    on_part(PARTS[5])
    rigs = (with_rigid_stem(study, rig), with_elastic_stem(study, rig, arcs, on_best))
    found = NoiseStudy(study.roles, study.rpm, structures, tuple(methods), left_out, rigs)
    on_part(PARTS[6])
    best = found.best
    quiet = study_high_dwell(study, best.acoustics, best.shape.lift)
    return replace(found, high_dwell=quiet)


def _structures(study: NoiseSetup, fitted: str) -> list[StructureFit]:
    loaded, roles = study.loaded, study.roles
    cams = (roles.reference, roles.predicted)
    return compare_structures(
        {cam: loaded.laws[cam] for cam in cams},
        loaded.follower,
        loaded.radiation,
        {cam: study.cams[cam].published for cam in cams},
        np.asarray(study.cams[fitted].turns.speeds),
        fitted,
    )


# What the paper claims of noise, tested on its own curves and on those of the study.

#: Levels in dB by cam, at the speeds of the study; and where something is true of them.
Levels = dict[str, FloatArray]

Truth = npt.NDArray[np.bool_]

#: Curves that a claim is tested on: its heading, and which of a studied curve it takes.
TESTED_ON: dict[str, Callable[[StudiedCurve], FloatArray]] = {
    "published curves": lambda curve: curve.published_db,
    "regressions": lambda curve: curve.regression_db,
    "points": lambda curve: curve.level_db,
}


@dataclass(frozen=True)
class NoiseClaim:
    """A claim of the paper on the levels of its cams, by what it was tested on.

    ``holds`` counts the speeds at which it holds, of ``cases``; ``fails_rpm`` are the lowest and
    highest speed at which it does not, None where it always holds.
    """

    words: str
    source: str
    holds: dict[str, int]
    cases: int
    fails_rpm: dict[str, tuple[float, float] | None]


def noise_claims(study: NoiseStudy, crossover_rpm: float) -> list[NoiseClaim]:
    """The paper's claims below and above the speed at which its two rivals are equally loud.

    Parameters
    ----------
    crossover_rpm : that speed, as the paper states it
    """
    roles, method, rpm = study.roles, study.best, study.rpm
    below, above = rpm < crossover_rpm, rpm > crossover_rpm
    at = f"{crossover_rpm:g} rpm"
    arcs, conventional, proposed = roles.arcs, roles.reference, roles.predicted

    def quietest(levels: Levels) -> Truth:
        return levels[arcs] <= np.minimum(levels[conventional], levels[proposed])

    def quieter_than(other: str) -> Callable[[Levels], Truth]:
        return lambda levels: levels[proposed] < levels[other]

    named = (
        (f"{arcs} is the quietest below {at}", "fig. 16", quietest, below),
        (f"{proposed} is quieter than {arcs} above {at}", "fig. 16", quieter_than(arcs), above),
        (
            f"{proposed} is quieter than {conventional} above {at}",
            "conclusions",
            quieter_than(conventional),
            above,
        ),
    )
    return [
        _tested(words, source, method, rpm, where, test) for words, source, test, where in named
    ]


def _tested(
    words: str,
    source: str,
    method: Method,
    rpm: FloatArray,
    where: Truth,
    test: Callable[[Levels], Truth],
) -> NoiseClaim:
    holds, fails = dict[str, int](), dict[str, tuple[float, float] | None]()
    for name, take in TESTED_ON.items():
        found = test({cam: take(curve) for cam, curve in method.curves.items()})[where]
        against = rpm[where][~found]
        holds[name] = int(found.sum())
        fails[name] = (float(against[0]), float(against[-1])) if against.size else None
    return NoiseClaim(words, source, holds, int(where.sum()), fails)

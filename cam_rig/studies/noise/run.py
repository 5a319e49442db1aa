"""The whole noise study, part after part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import TwoMassParameters
from cam_rig.schema import RigConfig
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.studies.noise.calibration_methods import Method, with_substitution, with_two_constants
from cam_rig.studies.noise.high_dwell import HighDwellStudy, study_high_dwell
from cam_rig.studies.noise.leave_one_out import LeftOut, leave_one_out
from cam_rig.studies.noise.setup import NoiseSetup, StudyRoles
from cam_rig.studies.noise.shared_rig import OneRig, with_elastic_stem, with_rigid_stem
from cam_rig.studies.noise.transfer_functions import StructureFit, compare_structures

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

    Raises
    ------
    ConfigError : a scene without the three `StudyRoles` or published levels, or a rig without
        two masses
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

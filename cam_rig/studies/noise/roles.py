"""The set-up of a noise study: the mechanics of each cam, run once, and the role of each.

The reference calibrates the acoustic constants; one is predicted, one has its geometry identified.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema.published import Crossover
from cam_rig.simulation.scene import LevelOrigin, LoadedScene
from cam_rig.simulation.simulate import Acoustics, Turns, settled_turns
from cam_rig.simulation.sound_constants import PublishedCam
from cam_rig.studies.noise.arc_cam import ArcShape, ShapeProblem
from cam_rig.units import FloatArray, to_rpm

#: A shape is fitted at each of these of the study's speeds, and then compared at all.
EVERY = 2
#: What gives the levels of a scene that is no noise study.
OTHERWISE = "for any other scene take cam-rig simulate or report"
#: Half of them still are more than a cubic has numbers.
MIN_SPEEDS = 9


@dataclass(frozen=True)
class StudyRoles:
    """Which cam plays which part in a scene."""

    reference: str
    predicted: str
    arcs: str

    @classmethod
    def of(cls, loaded: LoadedScene) -> StudyRoles:
        """The roles in a scene."""
        speeds = len(loaded.scene.program.speeds.numbers)
        if speeds < MIN_SPEEDS:
            raise ConfigError(
                f"{loaded.scene_file}: program.speeds has {speeds}; a noise study needs at least "
                f"{MIN_SPEEDS}; {OTHERWISE}"
            )
        roles = {loaded.fitted_origin(cam): cam for cam in loaded.scene.cams}
        if len(loaded.scene.cams) != 3 or len(roles) != 3 or loaded.scene.model != "one_mass":
            raise ConfigError(
                f"{loaded.scene_file}: cams are {', '.join(loaded.scene.cams)}, model "
                f"{loaded.scene.model}; a noise study needs model one_mass and three published "
                "cams: one that the rig is calibrated on, one identified, one predicted; "
                f"{OTHERWISE}"
            )
        parts = LevelOrigin.CALIBRATED, LevelOrigin.PREDICTED, LevelOrigin.IDENTIFIED
        return cls(*(roles[part] for part in parts))


@dataclass(frozen=True, eq=False)
class NoiseSetup:
    """What all parts of a noise study share: the scene, the roles, the mechanics of each cam."""

    loaded: LoadedScene
    roles: StudyRoles
    cams: dict[str, PublishedCam]
    start: Acoustics

    @classmethod
    def of(cls, loaded: LoadedScene) -> NoiseSetup:
        """Run the mechanics of a scene once."""
        roles = StudyRoles.of(loaded)
        speeds = np.array(loaded.scene.program.speeds.si_list)
        published = {cam: loaded.published_levels(cam, to_rpm(speeds)) for cam in loaded.scene.cams}

        def turn(law: Law) -> Turns:
            return settled_turns(law, "one_mass", loaded.follower, speeds)

        cams = {cam: PublishedCam(cam, turn(loaded.laws[cam]), published[cam]) for cam in published}
        return cls(loaded, roles, cams, Acoustics(loaded.radiation))

    @property
    def shape(self) -> ArcShape:
        """The arc cam's geometry as its file has it."""
        return ArcShape.of(self.loaded.cams[self.roles.arcs])

    @property
    def rpm(self) -> FloatArray:
        """The speeds in rpm."""
        return self.cams[self.roles.arcs].rpm

    @property
    def crossover(self) -> Crossover:
        """Which two cams the paper says are equally loud, and at which speed."""
        assert self.loaded.published is not None  # the study has its levels
        return self.loaded.published.crossover

    @cached_property
    def problem(self) -> ShapeProblem:
        """The arc cam's shape as it is fitted, at all speeds."""
        return self.shape_problem("one_mass", self.loaded.follower, 1)

    @cached_property
    def _thin(self) -> ShapeProblem:
        return self.shape_problem("one_mass", self.loaded.follower)

    def shape_problem(self, model: str, follower: Any, every: int = EVERY) -> ShapeProblem:
        """The arc cam's shape as it is fitted on a model's follower, at some of the speeds."""
        arcs = self.cams[self.roles.arcs].every(every)

        def turn(law: Law) -> Turns:
            return settled_turns(law, model, follower, arcs.turns.speeds)

        return ShapeProblem(self.loaded.cams[self.roles.arcs], arcs.published, turn)

    def fit_shape(self, acoustics: Acoustics) -> ArcShape:
        """Lift and event of the arc cam for these constants."""
        return self._thin.fit(self.shape, acoustics)

"""Set-up of a noise study: the role of each cam, and its simulated turns.

The acoustic constants are calibrated on the reference cam. The noise of the second cam is
predicted, and the geometry of the third, a cam of arcs, is identified.
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
from cam_rig.simulation.simulate import Acoustics, Turns, simulate_steady_turns
from cam_rig.simulation.sound_constants import PublishedCam
from cam_rig.studies.noise.arc_cam import ArcShape, ShapeProblem
from cam_rig.units import FloatArray, to_rpm

#: The shape of the arc cam (of tangent circular arcs) is fitted at every n-th speed only. The
#: result is compared at all speeds.
EVERY = 2
#: Advice at the end of the error message for a scene that does not fit a noise study.
OTHERWISE = "for any other scene take cam-rig simulate or report"
#: Smallest number of speeds of a noise study. Every second of them still gives more levels than the
#: four coefficients of a cubic.
MIN_SPEEDS = 9


@dataclass(frozen=True)
class StudyRoles:
    """Names of the three cams of a noise study, by their roles.

    The acoustic constants are calibrated on ``reference``. The noise of ``predicted`` is predicted.
    ``arcs`` is the cam of circular arcs, whose geometry is identified from its noise.
    """

    reference: str
    predicted: str
    arcs: str

    @classmethod
    def of(cls, loaded: LoadedScene) -> StudyRoles:
        """Return the roles of the cams of a scene.

        Raises
        ------
        ConfigError
            If the scene has too few speeds, or not one cam for each of the three roles.
        """
        speeds = len(loaded.scene.schedule.speeds.numbers)
        if speeds < MIN_SPEEDS:
            raise ConfigError(
                f"{loaded.scene_file}: schedule.speeds has {speeds}; a noise study needs at least "
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
    """Scene, roles and simulated turns of each cam of a noise study.

    ``start`` are the acoustic constants from which fits start.
    """

    loaded: LoadedScene
    roles: StudyRoles
    cams: dict[str, PublishedCam]
    start: Acoustics

    @classmethod
    def of(cls, loaded: LoadedScene) -> NoiseSetup:
        """Create the set-up of a noise study, and simulate the turns of all its cams."""
        roles = StudyRoles.of(loaded)
        speeds = np.array(loaded.scene.schedule.speeds.si_list)
        published = {cam: loaded.published_levels(cam, to_rpm(speeds)) for cam in loaded.scene.cams}

        def turn(law: Law) -> Turns:
            return simulate_steady_turns(law, "one_mass", loaded.follower, speeds)

        cams = {cam: PublishedCam(cam, turn(loaded.laws[cam]), published[cam]) for cam in published}
        return cls(loaded, roles, cams, Acoustics(loaded.radiation))

    @property
    def shape(self) -> ArcShape:
        """Geometry of the arc cam (of tangent circular arcs) as its cam file states it."""
        return ArcShape.of(self.loaded.cams[self.roles.arcs])

    @property
    def rpm(self) -> FloatArray:
        """Cam speeds of the study in rpm, shape (n,)."""
        return self.cams[self.roles.arcs].rpm

    @property
    def crossover(self) -> Crossover:
        """Two cams, and the speed of equal levels that the paper states for them."""
        assert self.loaded.published is not None  # scenes of a study have published levels
        return self.loaded.published.crossover

    @cached_property
    def problem(self) -> ShapeProblem:
        """Fit problem of the arc cam's shape to its published sound levels at all speeds.

        The follower is that of the scene's rig, as one rigid mass.
        """
        return self.shape_problem("one_mass", self.loaded.follower, 1)

    @cached_property
    def _problem_at_some_speeds(self) -> ShapeProblem:
        return self.shape_problem("one_mass", self.loaded.follower)

    def shape_problem(self, model: str, follower: Any, every: int = EVERY) -> ShapeProblem:
        """Return the fit problem of the arc cam's shape for a follower and dynamic model.

        Only every `every`-th speed is simulated, to save time.
        """
        arcs = self.cams[self.roles.arcs].every(every)

        def turn(law: Law) -> Turns:
            return simulate_steady_turns(law, model, follower, arcs.turns.speeds)

        return ShapeProblem(self.loaded.cams[self.roles.arcs], arcs.published, turn)

    def fit_shape(self, acoustics: Acoustics) -> ArcShape:
        """Fit lift and event angle of the arc cam to its published levels.

        The event angle is that of rise and fall together. ``acoustics`` are the acoustic constants,
        which stay fixed. Only every `EVERY`-th speed is used.
        """
        return self._problem_at_some_speeds.fit(self.shape, acoustics)

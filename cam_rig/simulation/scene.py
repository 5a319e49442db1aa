"""Scene together with the files that it names: cams, rig and published curves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import lru_cache
from pathlib import Path

import numpy as np

from cam_rig.acoustics import RadiationParameters
from cam_rig.arguments import check_arguments
from cam_rig.dynamics import MODELS, FollowerParameters
from cam_rig.dynamics.kinetostatic import force_extremes
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.cam import law_of, require_sprung
from cam_rig.schema import (
    CamConfig,
    Library,
    PublishedNoise,
    RigConfig,
    SceneConfig,
    load_published,
)
from cam_rig.schema import load_cam as read_cam
from cam_rig.schema import load_rig as read_rig
from cam_rig.schema import load_scene as read_scene
from cam_rig.schema.load import config_root, has_shipped_motion, resolve_path
from cam_rig.schema.quantity import Quantity
from cam_rig.units import FloatArray, to_rpm


def list_cams() -> list[str]:
    """Return the names of the shipped cams, for `load_cam`, in alphabetical order.

    Examples
    --------
    >>> import cam_rig
    >>> cam_rig.list_cams()[:3]
    ['arcs_centres', 'arcs_convex', 'arcs_straight']
    """
    return sorted(file.stem for file in (config_root() / "cams").glob("*.yaml"))


def list_rigs() -> list[str]:
    """Return the names of the shipped rigs, for `load_rig`, in alphabetical order.

    Examples
    --------
    >>> import cam_rig
    >>> cam_rig.list_rigs()
    ['paper_flywheel', 'paper_table2', 'tm21', 'tm21_bouncing']
    """
    return sorted(file.stem for file in (config_root() / "rigs").glob("*.yaml"))


@check_arguments
def load_cam(cam: str | Path) -> CamConfig:
    """Load a cam: its law as segments of the turn, and its follower.

    Parameters
    ----------
    cam : str or Path
        Name in ``config/cams`` such as ``"poly345"``, or path of a YAML file.

    Returns
    -------
    CamConfig
        Cam with the numbers of the file, each with its unit and its origin.

    Raises
    ------
    ConfigError
        If the file is missing or wrong. The message contains file, key, value and allowed values.

    Examples
    --------
    >>> import cam_rig
    >>> cam = cam_rig.load_cam("poly345")
    >>> cam.lift.si, cam.lift.origin  # m
    (0.05, 'given')
    """
    return read_cam(resolve_path("cams", cam))


@check_arguments
def load_rig(rig: str | Path) -> RigConfig:
    """Load a rig: the numbers of the follower, the shaft and the sound.

    Parameters
    ----------
    rig : str or Path
        Name in ``config/rigs`` such as ``"paper_table2"`` or ``"tm21"``, or path of a YAML file.

    Returns
    -------
    RigConfig
        Rig with the numbers of the file, each with its unit and its origin.

    Raises
    ------
    ConfigError
        If the file is missing or wrong. The message contains file, key, value and allowed values.

    Examples
    --------
    >>> import cam_rig
    >>> rig = cam_rig.load_rig("paper_table2")
    >>> rig.follower.preload.si  # N
    30.6
    >>> stiffer = rig.with_follower(spring_stiffness=6000.0, preload=40.0)  # N/m, N
    >>> stiffer.follower.spring_stiffness.si
    6000.0
    """
    return read_rig(resolve_path("rigs", rig))


@check_arguments
def load_scene(scene: str | Path) -> LoadedScene:
    """Load a scene, an experiment with cams on a rig at several speeds.

    Parameters
    ----------
    scene : str or Path
        Name in ``config/scenes`` such as ``"quick"``, or path of a YAML file. Cams and rigs that it
        names are searched for next to its folder first, then in ``config``.

    Returns
    -------
    LoadedScene
        Scene, rig, and cams with their laws.

    Raises
    ------
    ConfigError
        If a file is missing or wrong. The message contains the file and the error.
    LawError
        If the law of a cam cannot be built.

    Examples
    --------
    >>> import cam_rig
    >>> scene = cam_rig.load_scene("quick")
    >>> list(scene.laws), scene.rig.name, scene.scene.model
    (['tm21', 'bezier15'], 'tm21', 'one_mass')
    """
    return open_scene(resolve_path("scenes", scene))


#: Name of the shipped rig whose acoustic constants were fitted to published levels.
SHIPPED_RIG = "tm21"
#: Model of the follower with which the constants of `SHIPPED_RIG` were fitted.
SHIPPED_MODEL = "one_mass"


class LevelOrigin(StrEnum):
    """Origin of the sound level of a cam: to what the level was fitted."""

    CALIBRATED = "calibrated"  #: the rig's constants were fitted to the level of this cam
    IDENTIFIED = "identified"  #: the numbers of the cam were fitted to its level
    PREDICTED = "predicted"  #: no number of rig or cam was fitted to the level of this cam
    RELATIVE = "relative"  #: the rig was not calibrated: only differences of levels are meaningful


#: Note printed under sound levels of a rig whose acoustic constants are not calibrated.
RELATIVE_NOTE = (
    "Relative: the rig's acoustic constants were not fitted with this follower and model, so only "
    "differences between levels mean something."
)
#: Text in the source of a fitted constant that precedes the model and the follower with which it
#: was fitted.
FITTED_WITH = "; fitted with "
#: SI units of the follower's numbers by their keys in a rig file. Numbers without an entry are
#: ratios.
SI_UNITS = {
    "mass": "kg",
    "spring_stiffness": "N/m",
    "stem_stiffness": "N/m",
    "damping": "N*s/m",
    "stem_damping": "N*s/m",
    "preload": "N",
}
#: Relative difference below which two numbers are equal. It allows for the rounding of a conversion
#: of units.
VALUE_RTOL = 1e-9


def is_calibrated(rig: RigConfig, model: str) -> bool:
    """Return True if a rig's acoustic constants are valid for a model.

    They must have been fitted to sound levels. The constants of the shipped rig are valid for its
    follower and for `SHIPPED_MODEL` only. Other constants are valid for the model and the follower
    that the source of the gain names, or for all if it names none.
    """
    radiation, shipped = rig.radiation, _shipped_rig()
    if (
        radiation is None
        or not radiation.gain.origin == radiation.corner_frequency.origin == "identified"
    ):
        return False
    if not has_shipped_constants(rig):
        stated = radiation.gain.source.partition(FITTED_WITH)[2]
        return stated in ("", describe_fit_model(rig, model))
    follower = shipped.follower
    return model == SHIPPED_MODEL and all(
        _equal(n, getattr(follower, key)) for key, n in rig.follower
    )


def calibration_cam(rig: RigConfig, model: str) -> str:
    """Return the name of the cam to whose levels a rig was calibrated.

    It is empty if the rig is not calibrated for this model.
    """
    return (rig.calibrated_on or "measured levels") if is_calibrated(rig, model) else ""


def describe_fit_model(rig: RigConfig, model: str) -> str:
    """Return the dynamic model and the follower's numbers (SI) as text.

    The text is stored as the source of acoustic constants that are fitted with this model and
    follower.
    """
    numbers = ((key, number) for key, number in rig.follower if number)
    texts = (f"{key} {number.si:.9g} {SI_UNITS.get(key, '')}".strip() for key, number in numbers)
    return ", ".join((model, *texts))


def has_shipped_constants(rig: RigConfig) -> bool:
    """Return True if a rig's gain and corner frequency equal those of the shipped rig."""
    radiation, shipped = rig.radiation, _shipped_rig().radiation
    if radiation is None or shipped is None:
        return False
    return _equal(radiation.gain, shipped.gain) and _equal(
        radiation.corner_frequency, shipped.corner_frequency
    )


def _equal(first: Quantity | None, second: Quantity | None) -> bool:
    """Return True if two numbers are equal in SI units, or both are missing."""
    if first is None or second is None:
        return first is second
    return math.isclose(first.si, second.si, rel_tol=VALUE_RTOL)


@lru_cache(maxsize=1)
def _shipped_rig() -> RigConfig:
    return read_rig(config_root() / "rigs" / f"{SHIPPED_RIG}.yaml")


@dataclass(frozen=True, eq=False)
class LoadedScene:
    """Scene with its cams, their laws and its rig, all validated.

    A scene is an experiment: cams on a rig at several speeds. The paths of the files are empty for
    a scene that was created from arguments.
    """

    scene: SceneConfig
    rig: RigConfig
    cams: dict[str, CamConfig]  #: by name, in the order of the scene
    laws: dict[str, Law]  #: by the name of the cam
    published: PublishedNoise | None = None
    scene_file: Path = Path()
    rig_file: Path = Path()
    cam_files: dict[str, Path] = field(default_factory=dict)
    published_file: Path | None = None

    def __repr__(self) -> str:
        """Return the cams, the rig, the model and some of the speeds as text."""
        speeds = ", ".join(f"{rpm:g}" for rpm in spread_speeds(speeds_of(self.scene), FORCE_SPEEDS))
        experiment = f"{', '.join(self.laws)} on {self.rig.name}, {self.scene.model}"
        return f"LoadedScene({self.scene.name}: {experiment}, {speeds} rpm)"

    @property
    def titles(self) -> dict[str, str]:
        """Titles of the mounted cams by the name of the cam."""
        return {name: cam.title for name, cam in self.cams.items()}

    @property
    def follower(self) -> FollowerParameters:
        """Parameters of the follower of the rig."""
        return FollowerParameters.from_rig(self.rig)

    @property
    def radiation(self) -> RadiationParameters:
        """Acoustic constants of the rig for the model of the scene."""
        return RadiationParameters.from_rig(self.rig, lands=MODELS[self.scene.model].lifts_off)

    @property
    def missing_for_sound(self) -> tuple[str, ...]:
        """Keys of the numbers that a sound level requires and the rig does not have."""
        return self.rig.missing_for_sound(MODELS[self.scene.model].lifts_off)

    @property
    def no_sound_note(self) -> str:
        """Sentence on why no sound level can be computed, empty if it can."""
        keys = " and ".join(self.missing_for_sound)
        return f"sound level left out: rig {self.rig.name} has no {keys}" if keys else ""

    def require_numbers(self) -> None:
        """Raise `ConfigError` if the rig lacks a number for the model or the sound."""
        _ = MODELS[self.scene.model].parameters(self.rig), self.radiation

    @property
    def files(self) -> dict[Path, str]:
        """Paths of all files of the scene, and the folder of ``config`` for each.

        The scene file is first.
        """
        points = [
            path.parent / name
            for cam, path in self.cam_files.items()
            for name in self.cams[cam].files
        ]
        cams = dict.fromkeys((*self.cam_files.values(), *points), "cams")
        published = {} if self.published_file is None else {self.published_file: "published"}
        return {self.scene_file: "scenes", self.rig_file: "rigs", **cams, **published}

    def mount(
        self, name: str, again: bool = False, require: Callable[[Law], object] = lambda _: None
    ) -> None:
        """Add a cam that an operator mounts during the run.

        It is read from the library of the scene's cams.

        Parameters
        ----------
        name : str
            Name of the cam.
        again : bool
            True to read the file of a cam that is already in the scene again.
        require : callable
            Function of the law that raises an error if it is not acceptable.
        """
        if name in self.cams and not again:
            return
        path = Library.for_scene(self.scene_file).path("cams", name)
        cam = read_cam(path)
        require_sprung(path, cam)
        law = law_of(path, cam)
        require(law)
        self.laws[name], self.cams[name], self.cam_files[name] = law, cam, path

    def law_of(self, cam: str) -> Law:
        """Return the law of a cam of the scene.

        Raises
        ------
        ConfigError
            If the scene does not have the cam.
        """
        if cam not in self.laws:
            raise ConfigError(
                f"{self.scene_file}: has no cam {cam!r}; allowed: {', '.join(self.laws)}"
            )
        return self.laws[cam]

    @property
    def calibrated(self) -> bool:
        """True if computed sound levels are absolute, False if only differences are valid."""
        return is_calibrated(self.rig, self.scene.model)

    def level_origin(self, cam: str) -> LevelOrigin:
        """Return how the sound level of a cam on this rig was obtained.

        See `LevelOrigin`. The result is RELATIVE if the rig's acoustic constants are not
        calibrated.
        """
        if not self.calibrated:
            return LevelOrigin.RELATIVE
        origin, shipped = self.fitted_origin(cam), has_shipped_constants(self.rig)
        if origin is LevelOrigin.CALIBRATED and shipped and not has_shipped_motion(self.cams[cam]):
            return LevelOrigin.PREDICTED  # another cam with the same name, not the fitted one
        return origin

    def fitted_origin(self, cam: str) -> LevelOrigin:
        """Return how the constants behind a cam's sound level were obtained.

        The result is CALIBRATED if the acoustic constants of the rig were fitted to levels of this
        cam, IDENTIFIED if the numbers of the cam were fitted to its published levels, and PREDICTED
        otherwise. It follows from the rig file and the cam file.
        """
        if cam == self.rig.calibrated_on:
            return LevelOrigin.CALIBRATED
        source = self.cams[cam].identified_from
        is_known = self.published is None or source == self.published.name
        return LevelOrigin.IDENTIFIED if source and is_known else LevelOrigin.PREDICTED

    def published_levels(self, cam: str, rpm: FloatArray) -> FloatArray:
        """Return the published sound levels (dB) of a cam at speeds in rpm, shape `(n,)`.

        Raises
        ------
        ConfigError
            If no regression of the cam is published, or a speed is outside of its range.
        """
        if self.published is None or cam not in self.published.regression_db:
            raise ConfigError(
                f"{self.scene_file}: no published noise of {cam!r} to fit to; allowed: a scene "
                "that names a publication with that cam"
            )
        low, high = self.published.range_rpm
        if rpm.min() < low - 1e-6 or rpm.max() > high + 1e-6:
            raise ConfigError(
                f"{self.scene_file}: speeds are {rpm.min():g} to {rpm.max():g} rpm; allowed for a "
                f"fit: the published {low:g} to {high:g} rpm"
            )
        return self.published.level(cam, rpm)

    def with_one_cam(self, cam: str, law: Law) -> LoadedScene:
        """Return the scene with a single cam, whose law is replaced by `law`."""
        scene = self.scene.model_copy(update={"cams": [cam]})
        return replace(self, scene=scene, laws={cam: law})


def open_scene(scene_path: Path) -> LoadedScene:
    """Read a scene file and every file that it names, and validate them.

    Raises
    ------
    ConfigError
        If a file is missing or wrong, or the rig does not support the follower of a cam.
    LawError
        If the law of a cam cannot be built.
    """
    scene = read_scene(scene_path)
    library = Library.for_scene(scene_path)
    files = {name: library.path("cams", name) for name in scene.cams}
    rig_file = library.path("rigs", scene.rig)
    cams = {name: read_cam(path) for name, path in files.items()}
    for name, cam in cams.items():
        if cam.name != name:
            raise ConfigError(
                f"{files[name]}: name is {cam.name!r}; allowed: the file's name, {name!r}"
            )
        require_sprung(files[name], cam)
    rig, laws = read_rig(rig_file), {name: law_of(files[name], cam) for name, cam in cams.items()}
    printed = None if scene.published is None else library.path("published", scene.published)
    published = None if printed is None else load_published(printed)
    return LoadedScene(scene, rig, cams, laws, published, scene_path, rig_file, files, printed)


#: Length of the arrow that displays the maximum contact force, as a fraction of the follower's
#: largest distance from the cam axis.
FORCE_ARROW_RATIO = 0.5


def max_contact_force(loaded: LoadedScene, cam: str, speed: float) -> float:
    """Return the largest contact force (N) of a turn at a cam speed (rad/s).

    The follower is on the cam throughout.
    """
    return force_extremes(loaded.laws[cam], loaded.follower, speed)[1]


#: Largest number of cam speeds in the tables of vibration in a report.
VIBRATION_SPEEDS = 4
#: Largest number of cam speeds in a figure of the contact force over the turn.
FORCE_SPEEDS = 5
#: Largest number of cam speeds in the report's figure of orders (multiples of the rotational
#: frequency).
ORDER_SPEEDS = 13


def speeds_of(scene: SceneConfig) -> list[float]:
    """Return the different cam speeds (rpm) of a scene in rising order."""
    return sorted({round(to_rpm(speed), 9) for speed in scene.schedule.speeds.si_list})


def spread_speeds(speeds: list[float], max_count: int) -> list[float]:
    """Return up to `max_count` evenly spread speeds, including the first and the last.

    Fewer speeds are returned unchanged.
    """
    if len(speeds) <= max_count:
        return speeds
    indices = np.linspace(0, len(speeds) - 1, max_count).round().astype(int)
    return [speeds[i] for i in indices.tolist()]

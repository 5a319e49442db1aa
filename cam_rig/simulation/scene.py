"""A scene with everything it names: the mounted cams, the rig, the published curves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import lru_cache
from pathlib import Path

import numpy as np

from cam_rig import laws
from cam_rig.acoustics import RadiationParameters
from cam_rig.arguments import checked
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
    load,
    load_published,
)
from cam_rig.schema import load_cam as read_cam
from cam_rig.schema import load_rig as read_rig
from cam_rig.schema import load_scene as read_scene
from cam_rig.schema.load import config_root, named_path, same_as_shipped
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.rig import SI_UNITS
from cam_rig.units import FloatArray, to_rpm


@checked
def load_cam(cam: str | Path) -> CamConfig:
    """A cam: its law as segments around the turn, and its follower.

    Parameters
    ----------
    cam : a name in ``config/cams`` (``"poly345"``), or the path of a YAML file

    Raises
    ------
    ConfigError : one line that names file, key, value and what is allowed

    Examples
    --------
    >>> import cam_rig
    >>> cam = cam_rig.load_cam("poly345")
    >>> cam.lift.si, cam.lift.origin  # m
    (0.05, 'given')
    """
    return load.load_cam(named_path("cams", cam))


build_law = checked(laws.build_law)


@checked
def load_rig(rig: str | Path) -> RigConfig:
    """A rig: the follower's masses, springs and dampers, its shaft, and how it sounds.

    Parameters
    ----------
    rig : a name in ``config/rigs`` (``"paper_table2"``, ``"tm21"``), or the path of a YAML file

    Raises
    ------
    ConfigError : one line that names file, key, value and what is allowed

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
    return load.load_rig(named_path("rigs", rig))


@checked
def load_scene(scene: str | Path) -> LoadedScene:
    """A scene (an experiment: cams on a rig, and speeds) with every file that it names.

    Parameters
    ----------
    scene : a name in ``config/scenes`` (``"quick"``), or the path of a YAML file; what it names is
        looked up beside its folder first, then in ``config``

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it

    Examples
    --------
    >>> import cam_rig
    >>> scene = cam_rig.load_scene("quick")
    >>> list(scene.laws), scene.rig.name, scene.scene.model
    (['tm21', 'bezier15'], 'tm21', 'one_mass')
    """
    return open_scene(named_path("scenes", scene))


#: The shipped rig that was calibrated, and the model of the follower it was calibrated with.
SHIPPED, MODEL = "tm21", "one_mass"


class LevelOrigin(StrEnum):
    """Origin of the sound level of a cam."""

    CALIBRATED = "calibrated"  #: the rig's constants were fitted to the level of this cam
    IDENTIFIED = "identified"  #: the numbers of the cam were fitted to its level
    PREDICTED = "predicted"  #: nothing was fitted to it
    RELATIVE = "relative"  #: the rig was not calibrated: only differences of levels are meaningful


RELATIVE_NOTE = (
    "Relative: the rig's acoustic constants were not fitted with this follower and model, so only "
    "differences between levels mean something."
)
#: What follows in the source of a calibration: the follower and model it holds for.
FITTED_WITH = "; fitted with "
#: Two numbers that differ by less, relative, are the same in other units.
SAME = 1e-9


def is_calibrated(rig: RigConfig, model: str) -> bool:
    """Whether acoustic constants are identified, with the rig's own follower and this model."""
    own, shipped = rig.radiation, _shipped()
    if own is None or not own.gain.origin == own.corner.origin == "identified":
        return False
    if not has_shipped_constants(rig):  # fitted anew
        said = own.gain.source.partition(FITTED_WITH)[2]
        return said in ("", fitted_with(rig, model))
    follower = shipped.follower
    return model == MODEL and all(_same(one, getattr(follower, key)) for key, one in rig.follower)


def calibrated_on(rig: RigConfig, model: str) -> str:
    """The cam that a rig's sound was fitted to with this model; empty where levels are relative."""
    return (rig.calibrated_on or "measured levels") if is_calibrated(rig, model) else ""


def fitted_with(rig: RigConfig, model: str) -> str:
    """Model and follower in SI units, as ``cam-rig fit sound`` writes them into the source."""
    given = ((key, number) for key, number in rig.follower if number)
    said = (f"{key} {number.si:.9g} {SI_UNITS.get(key, '')}".strip() for key, number in given)
    return ", ".join((model, *said))


def has_shipped_constants(rig: RigConfig) -> bool:
    """Whether gain and cut-off are those that the shipped rig was calibrated to."""
    own, shipped = rig.radiation, _shipped().radiation
    if own is None or shipped is None:
        return False
    return _same(own.gain, shipped.gain) and _same(own.corner, shipped.corner)


def _same(one: Quantity | None, other: Quantity | None) -> bool:
    """Whether two numbers are one, whatever their units and origins; none is like none."""
    if one is None or other is None:
        return one is other
    return math.isclose(one.si, other.si, rel_tol=SAME)


@lru_cache(maxsize=1)
def _shipped() -> RigConfig:
    return read_rig(config_root() / "rigs" / f"{SHIPPED}.yaml")


@dataclass(frozen=True, eq=False)
class LoadedScene:
    """Everything a run needs, checked before anything starts; without files where it has none."""

    scene: SceneConfig
    rig: RigConfig
    cams: dict[str, CamConfig]
    laws: dict[str, Law]
    published: PublishedNoise | None = None
    scene_file: Path = Path()
    rig_file: Path = Path()
    cam_files: dict[str, Path] = field(default_factory=dict)
    published_file: Path | None = None

    def __repr__(self) -> str:
        """Cams, rig and model, without their numbers."""
        speeds = ", ".join(f"{rpm:g}" for rpm in spread(speeds_of(self.scene), FORCE_SPEEDS))
        what = f"{', '.join(self.laws)} on {self.rig.name}, {self.scene.model}"
        return f"LoadedScene({self.scene.name}: {what}, {speeds} rpm)"

    @property
    def titles(self) -> dict[str, str]:
        """What the mounted cams are called."""
        return {name: cam.title for name, cam in self.cams.items()}

    @property
    def follower(self) -> FollowerParameters:
        """The follower's numbers."""
        return FollowerParameters.from_rig(self.rig)

    @property
    def radiation(self) -> RadiationParameters:
        """The acoustic constants."""
        return RadiationParameters.from_rig(self.rig, lands=MODELS[self.scene.model].lifts_off)

    @property
    def missing_for_sound(self) -> tuple[str, ...]:
        """Keys of the rig that a sound level needs and the file leaves out."""
        return self.rig.missing_for_sound(MODELS[self.scene.model].lifts_off)

    @property
    def no_sound_note(self) -> str:
        """Return a sentence on the sound level that is left out, empty if there is one."""
        keys = " and ".join(self.missing_for_sound)
        return f"sound level left out: rig {self.rig.name} has no {keys}" if keys else ""

    def require_numbers(self) -> None:
        """Refuse a rig that lacks a number of the scene's model or of its sound."""
        _ = MODELS[self.scene.model].parameters(self.rig), self.radiation

    @property
    def files(self) -> list[Path]:
        """Every file of the scene, the scene's own first."""
        published = [] if self.published_file is None else [self.published_file]
        points = [
            path.parent / name
            for cam, path in self.cam_files.items()
            for name in self.cams[cam].files
        ]
        return [self.scene_file, self.rig_file, *self.cam_files.values(), *points, *published]

    def mount(
        self, name: str, again: bool = False, require: Callable[[Law], object] = lambda _: None
    ) -> None:
        """Add a cam, mounted by an operator, from the library of the scene's cams.

        One that is there is read only ``again`` on demand; ``require`` may refuse its law.
        """
        if name in self.cams and not again:
            return
        path = Library.beside(self.scene_file).path("cams", name)
        cam = read_cam(path)
        require_sprung(path, cam)
        law = law_of(path, cam)
        require(law)
        self.laws[name], self.cams[name], self.cam_files[name] = law, cam, path

    def law_of(self, cam: str) -> Law:
        """The law of a cam of the scene."""
        if cam not in self.laws:
            raise ConfigError(
                f"{self.scene_file}: has no cam {cam!r}; allowed: {', '.join(self.laws)}"
            )
        return self.laws[cam]

    @property
    def calibrated(self) -> bool:
        """Whether the levels of the scene are more than relative to each other."""
        return is_calibrated(self.rig, self.scene.model)

    def level_origin(self, cam: str) -> LevelOrigin:
        """Return the origin of the level of a cam on this rig."""
        if not self.calibrated:
            return LevelOrigin.RELATIVE
        origin, shipped = self.fitted_origin(cam), has_shipped_constants(self.rig)
        if origin is LevelOrigin.CALIBRATED and shipped and not same_as_shipped(self.cams[cam]):
            return LevelOrigin.PREDICTED  # another cam of that name: nothing was fitted to it
        return origin

    def fitted_origin(self, cam: str) -> LevelOrigin:
        """Return the origin of a cam's level by the sources in the files of rig and cam."""
        if cam == self.rig.calibrated_on:
            return LevelOrigin.CALIBRATED
        source = self.cams[cam].identified_from
        is_known = self.published is None or source == self.published.name
        return LevelOrigin.IDENTIFIED if source and is_known else LevelOrigin.PREDICTED

    def published_levels(self, cam: str, rpm: FloatArray) -> FloatArray:
        """Published levels (dB) of a cam at speeds in rpm, to fit something to."""
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

    def only(self, cam: str, law: Law) -> LoadedScene:
        """The same scene with one cam alone, and another law for it."""
        scene = self.scene.model_copy(update={"cams": [cam]})
        return replace(self, scene=scene, laws={cam: law})


def open_scene(scene_path: Path) -> LoadedScene:
    """Read a scene and every file it names."""
    scene = read_scene(scene_path)
    library = Library.beside(scene_path)
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


#: The arrow of the greatest contact force, as a share of the follower's reach.
ARROW = 0.5


def max_contact_force(loaded: LoadedScene, cam: str, speed: float) -> float:
    """Maximum contact force (N) of a follower that stays in contact at a speed (rad/s)."""
    return force_extremes(loaded.laws[cam], loaded.follower, speed)[1]


#: Speeds at most of the vibration tables, of the force over the turn, and of the orders.
VIBRATION_SPEEDS, FORCE_SPEEDS, ORDER_SPEEDS = 4, 5, 13


def speeds_of(scene: SceneConfig) -> list[float]:
    """The scene's speeds (rpm), each once, rising."""
    return sorted({round(to_rpm(speed), 9) for speed in scene.program.speeds.si_list})


def spread(speeds: list[float], most: int) -> list[float]:
    """So many of the speeds at most, the first and the last among them."""
    if len(speeds) <= most:
        return speeds
    return [speeds[i] for i in np.linspace(0, len(speeds) - 1, most).round().astype(int).tolist()]

"""A scene with everything it names: the mounted cams, the rig, the published curves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from cam_rig.acoustics import RadiationParameters
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import MODELS, FollowerParameters
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import (
    CamConfig,
    Library,
    PublishedNoise,
    RigConfig,
    SceneConfig,
    load_cam,
    load_published,
    load_rig,
    load_scene,
)
from cam_rig.schema.shipped import same_as_shipped
from cam_rig.simulation.calibrated import RELATIVE, has_shipped_constants, is_calibrated
from cam_rig.simulation.cam_files import law_of, require_sprung


@dataclass(frozen=True, eq=False)
class LoadedScene:
    """Everything a run needs, checked before anything starts."""

    scene: SceneConfig
    rig: RigConfig
    cams: dict[str, CamConfig]
    laws: dict[str, Law]
    published: PublishedNoise | None
    scene_file: Path
    rig_file: Path
    cam_files: dict[str, Path]
    published_file: Path | None

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

    def require_numbers(self) -> None:
        """Refuse a rig that lacks a number of the scene's model or of its sound.

        Raises
        ------
        ConfigError : with the first of them
        """
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

    def mount(self, name: str) -> None:
        """Add a cam, mounted by an operator, from the library of the scene's cams.

        Raises
        ------
        ConfigError, LawError : no cam has that name, or the rig cannot turn it
        """
        if name in self.cams:
            return
        path = Library.beside(self.scene_file).path("cams", name)
        cam = load_cam(path)
        require_sprung(path, cam)
        self.laws[name], self.cams[name], self.cam_files[name] = law_of(path, cam), cam, path

    def law_of(self, cam: str) -> Law:
        """The law of a cam of the scene.

        Raises
        ------
        ConfigError : the scene has no such cam
        """
        if cam not in self.laws:
            raise ConfigError(
                f"{self.scene_file}: has no cam {cam!r}; allowed: {', '.join(self.laws)}"
            )
        return self.laws[cam]

    @property
    def calibrated(self) -> bool:
        """Whether the levels of the scene are more than relative to each other."""
        return is_calibrated(self.rig, self.scene.model)

    def role(self, cam: str) -> str:
        """What a level of this cam is worth: relative, or its `part` on a calibrated rig."""
        if not self.calibrated:
            return RELATIVE
        part, shipped = self.part(cam), has_shipped_constants(self.rig)
        if part == "calibrated" and shipped and not same_as_shipped(self.cams[cam]):
            return "predicted"  # another cam of that name: nothing was fitted to it
        return part

    def part(self, cam: str) -> str:
        """What the files fit to this cam: calibrated (the rig), identified (the cam), predicted."""
        if cam == self.rig.calibrated_on:
            return "calibrated"
        source = self.cams[cam].identified_from
        known = self.published is None or source == self.published.name
        return "identified" if source and known else "predicted"

    def published_levels(self, cam: str, rpm: FloatArray) -> FloatArray:
        """Published levels (dB) of a cam at speeds in rpm, to fit something to.

        Raises
        ------
        ConfigError : nothing is published for the cam, or not at all these speeds
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

    def only(self, cam: str, law: Law) -> LoadedScene:
        """The same scene with one cam alone, and another law for it."""
        scene = self.scene.model_copy(update={"cams": [cam]})
        return replace(self, scene=scene, laws={cam: law})


def open_scene(scene_path: Path) -> LoadedScene:
    """Read a scene and every file it names.

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it
    """
    scene = load_scene(scene_path)
    library = Library.beside(scene_path)
    cam_paths = [library.path("cams", name) for name in scene.cams]
    rig_path = library.path("rigs", scene.rig)
    cams = [load_cam(path) for path in cam_paths]
    for path, name, cam in zip(cam_paths, scene.cams, cams, strict=True):
        if cam.name != name:
            raise ConfigError(f"{path}: name is {cam.name!r}; allowed: the file's name, {name!r}")
        require_sprung(path, cam)
    published_path = None
    if scene.published is not None:
        published_path = library.path("published", scene.published)
    return LoadedScene(
        scene=scene,
        rig=load_rig(rig_path),
        cams={cam.name: cam for cam in cams},
        laws={cam.name: law_of(path, cam) for path, cam in zip(cam_paths, cams, strict=True)},
        published=None if published_path is None else load_published(published_path),
        scene_file=scene_path,
        rig_file=rig_path,
        cam_files=dict(zip(scene.cams, cam_paths, strict=True)),
        published_file=published_path,
    )

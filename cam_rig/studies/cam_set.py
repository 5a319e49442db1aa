"""Cams to compare on one rig: read and checked before anything runs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import CamConfig, RigConfig, load_cam, load_rig
from cam_rig.simulation.cam_files import law_of, require_sprung


@dataclass(frozen=True)
class CamSet:
    """Cams by name in order, their laws, and the rig they turn on."""

    cams: dict[str, CamConfig]
    laws: dict[str, Law]
    rig: RigConfig

    @property
    def titles(self) -> dict[str, str]:
        """What each cam is called."""
        return {name: cam.title for name, cam in self.cams.items()}


def open_cam_set(cam_paths: Iterable[Path], rig_path: Path) -> CamSet:
    """Read cam files and a rig file.

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it
    """
    rig = load_rig(rig_path)
    cams: dict[str, CamConfig] = {}
    laws = {}
    for path in cam_paths:
        cam = load_cam(path)
        if cam.name in cams:
            raise ConfigError(f"{path}: cam {cam.name!r} is named twice; allowed: each once")
        require_sprung(path, cam)
        cams[cam.name], laws[cam.name] = cam, law_of(path, cam)
    return CamSet(cams, laws, rig)

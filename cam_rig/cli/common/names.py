"""Files that a command names: by path, or by the word that a shipped one goes by."""

from __future__ import annotations

from pathlib import Path

from cam_rig.schema.load import config_root

DEFAULT_SCENE = "tm21_sweep"


def scene_path(scene: str) -> Path:
    """A scene by its path, or by its name in ``config/scenes``."""
    return _named("scenes", scene)


def cam_path(cam: str) -> Path:
    """A cam by its path, or by its name in ``config/cams``."""
    return _named("cams", cam)


def rig_path(rig: str) -> Path:
    """A rig by its path, or by its name in ``config/rigs``."""
    return _named("rigs", rig)


def study_path(study: str) -> Path:
    """A factorial study by its path, or by its name in ``config/factorials``."""
    return _named("factorials", study)


def _named(folder: str, name: str) -> Path:
    """A path is taken as it is; a word without a folder and a suffix is a shipped file's name."""
    path = Path(name)
    if path.name != name or path.suffix in (".yaml", ".yml") or is_file(path):
        return path
    return config_root() / folder / f"{name}.yaml"


def is_file(path: Path) -> bool:
    """Whether there is a file at a path; a name that no file can have is none."""
    try:
        return path.is_file()
    except OSError:
        return False


def tables_path() -> Path:
    """The paper's tables as data."""
    return config_root() / "published" / "tables" / "paper.yaml"

"""Files that a command names: by path, or by the word that a shipped one goes by."""

from __future__ import annotations

from pathlib import Path

from cam_rig.schema.load import config_root, named_path

DEFAULT_SCENE = "tm21_sweep"


def scene_path(scene: str) -> Path:
    """A scene by its path, or by its name in ``config/scenes``."""
    return named_path("scenes", scene)


def cam_path(cam: str) -> Path:
    """A cam by its path, or by its name in ``config/cams``."""
    return named_path("cams", cam)


def rig_path(rig: str) -> Path:
    """A rig by its path, or by its name in ``config/rigs``."""
    return named_path("rigs", rig)


def study_path(study: str) -> Path:
    """A factorial study by its path, or by its name in ``config/factorials``."""
    return named_path("factorials", study)


def tables_path() -> Path:
    """The paper's tables as data."""
    return config_root() / "published" / "tables" / "paper.yaml"


def readings_path() -> Path:
    """The readings of the paper's Table 2."""
    return config_root() / "published" / "readings" / "table2.yaml"

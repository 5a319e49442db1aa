"""Files that a command names: by path, or by the word that a shipped one goes by."""

from __future__ import annotations

from pathlib import Path

DEFAULT_SCENE = "tm21_sweep"


def scene_path(scene: str) -> Path:
    """A scene by its path, or by its name in ``config/scenes``."""
    from cam_rig.schema.load import named_path

    return named_path("scenes", scene)


def cam_path(cam: str) -> Path:
    """A cam by its path, or by its name in ``config/cams``."""
    from cam_rig.schema.load import named_path

    return named_path("cams", cam)


def rig_path(rig: str) -> Path:
    """A rig by its path, or by its name in ``config/rigs``."""
    from cam_rig.schema.load import named_path

    return named_path("rigs", rig)


def rig_beside(rig: str, scene: Path) -> Path:
    """A rig by its path, or by its name beside a scene, then in ``config/rigs``."""
    from cam_rig.schema.load import Library, named_path

    path = named_path("rigs", rig)
    return path if path == Path(rig) else Library.beside(scene).path("rigs", rig)


def is_scene(source: str) -> bool:
    """Whether a file, or a shipped name, is that of a scene and not of a cam."""
    from cam_rig.schema.load import read_yaml

    path = scene_path(source)
    if not path.is_file():
        return False
    data = read_yaml(path)
    return isinstance(data, dict) and "program" in data


def study_path(study: str) -> Path:
    """A factorial study by its path, or by its name in ``config/factorials``."""
    from cam_rig.schema.load import named_path

    return named_path("factorials", study)


def campaign_path(study: str) -> Path:
    """A campaign's study by its path, or by its name in ``config/campaigns``."""
    from cam_rig.schema.load import named_path

    return named_path("campaigns", study)


def tables_path() -> Path:
    """The paper's tables as data."""
    from cam_rig.schema.load import config_root

    return config_root() / "published" / "tables" / "paper.yaml"


def readings_path() -> Path:
    """The readings of the paper's Table 2."""
    from cam_rig.schema.load import config_root

    return config_root() / "published" / "readings" / "table2.yaml"

"""One scene for all nodes: each says which it has, and the drive refuses another."""

from __future__ import annotations

import zlib
from pathlib import Path

from cam_rig.errors import ConfigError
from cam_rig.files import read_bytes
from cam_rig.schema.load import MAX_BYTES


def scene_mark(scene: str) -> str:
    """A scene's file name and a checksum of what it holds; empty where there is no such file."""
    try:
        data = read_bytes(Path(scene), MAX_BYTES)
    except (OSError, ConfigError):  # no scene is given, or its file is gone since it was read
        return ""
    return f"{Path(scene).stem}#{zlib.crc32(data):08x}"


def require_one_scene(node: str, mark: str, scene: str) -> None:
    """Refuse a node that was started with another scene than the drive.

    Raises
    ------
    ConfigError : names both
    """
    own = scene_mark(scene)
    if not (mark and own) or mark == own:
        return
    theirs, ours = mark.partition("#")[0], own.partition("#")[0]
    other = "another file of that name" if theirs == ours else theirs
    raise ConfigError(
        f"scene: is {ours}, and {node} has {other}; allowed: one scene for all nodes, given to "
        f"each (-p scene:={ours})"
    )

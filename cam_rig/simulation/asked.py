"""What a study is asked for: cams, named or of a scene, the rig they turn on, speeds."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from cam_rig.errors import ConfigError
from cam_rig.schema.load import cam_path, one_scene, rig_beside, rig_path, scene_path, tables_path
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.laws.cam import CamSet
    from cam_rig.simulation.scene import LoadedScene

#: Rigs that are named, at most.
MOST_NAMED = 5
#: The rig of cams that are named without one.
RIG = "paper_table2"
#: Speeds at most: minutes.
MAX_SPEEDS = 1000


def asked_cams(names: list[str] | None, rig: str | None) -> CamSet:
    """Cams on a rig by file or name (None: Table 2 on `RIG`, or beside them), or a scene's."""
    from cam_rig.laws.cam import CamSet, open_cam_set
    from cam_rig.schema import load_tables

    if (scene := one_scene(names)) is not None:
        loaded = asked_scene(scene, rig)
        return CamSet(loaded.cams, loaded.laws, loaded.rig)
    cams = names or list(load_tables(tables_path()).table_2_jump)
    file = rig_path(rig) if rig else _rig_beside([cam_path(cam) for cam in cams])
    return open_cam_set(map(cam_path, cams), file)


def _rig_beside(cams: list[Path]) -> Path:
    """The only rig beside cams of one's own, else `RIG`; which one it is, and why, is said."""
    from cam_rig.schema.load import config_root

    own = [cam for cam in cams if not cam.resolve().is_relative_to(config_root().resolve())]
    if not own:
        return rig_path(RIG)
    folders = sorted({cam.parent.parent / "rigs" for cam in own})
    found = [file for folder in folders for file in sorted(folder.glob("*.yaml"))]
    if len(found) == 1:
        say(f"rig {found[0]}, the only one beside the cam; --rig takes another")
        return found[0]
    there = ", ".join(map(str, found[:MOST_NAMED])) or "no rig"
    say(f"rig {RIG}, the paper's: beside the cam there is {there}; --rig takes another")
    return rig_path(RIG)


def asked_scene(scene: str, rig: str | None) -> LoadedScene:
    """A scene by file or name, on its rig, or another by file, or name beside it or in config."""
    from cam_rig.schema import load_rig
    from cam_rig.simulation.scene import open_scene

    path = scene_path(scene)
    loaded = open_scene(path)
    if rig is None:
        return loaded
    file = rig_beside(rig, path)
    return replace(loaded, rig=load_rig(file), rig_file=file)


def scene_speeds(scene: str, most: int) -> list[float]:
    """So many of a scene's speeds (rpm) at most, the slowest and the fastest among them."""
    from cam_rig.schema import load_scene
    from cam_rig.simulation.scene import speeds_of, spread

    return spread(speeds_of(load_scene(scene_path(scene))), most)


def speeds_asked(text: str) -> list[float]:
    """Speeds in rpm of "300", "200,300" or "200:400:10", the last one included."""
    try:
        if ":" in text:
            low, high, step = map(float, text.split(":"))
            count = math.floor((high - low) / step + 1e-9) + 1
            found = [low + i * step for i in range(min(count, MAX_SPEEDS + 1))]
        else:
            found = sorted({float(word) for word in text.split(",")})
    except (ValueError, ZeroDivisionError, OverflowError):
        found = []
    if not (found and 0.0 < min(found) <= max(found) <= 1e5 and len(found) <= MAX_SPEEDS):
        raise ConfigError(
            f"--rpm {text}: allowed: 300, or 200,300, or 200:400:10 (from:to:step), each above 0 "
            f"and at most 1e5, {MAX_SPEEDS} speeds at most"
        )
    return found

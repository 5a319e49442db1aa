"""The cams that a study is asked for, and the rig they turn on: named, or those of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cam_rig.cli.common.names import (
    cam_path,
    is_scene,
    rig_beside,
    rig_path,
    scene_path,
    tables_path,
)

if TYPE_CHECKING:
    from cam_rig.studies.cam_set import CamSet

#: The rig of cams that are named without one.
RIG = "paper_table2"


def asked_cams(names: list[str] | None, rig: str | None) -> CamSet:
    """Cams by file or name on a rig, or one scene's cams on its rig.

    Parameters
    ----------
    names : of cams, or of one scene; None for the cams of Table 2
    rig : file or name; None for the scene's, or `RIG`

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it
    """
    from cam_rig.schema import load_rig, load_tables
    from cam_rig.simulation.loaded_scene import open_scene
    from cam_rig.studies.cam_set import CamSet, open_cam_set

    if names and len(names) == 1 and is_scene(names[0]):
        path = scene_path(names[0])
        loaded = open_scene(path)
        named = loaded.rig if rig is None else load_rig(rig_beside(rig, path))
        return CamSet(loaded.cams, loaded.laws, named)
    cams = names or list(load_tables(tables_path()).table_2_jump)
    return open_cam_set(map(cam_path, cams), rig_path(rig or RIG))

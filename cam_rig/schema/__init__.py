"""Reading of YAML files and tables of numbers, their checks, and conversion to SI."""

from cam_rig.schema.cam import CamConfig
from cam_rig.schema.load import (
    Library,
    load_cam,
    load_published,
    load_rig,
    load_scene,
    load_tables,
)
from cam_rig.schema.published import PublishedNoise, PublishedTables
from cam_rig.schema.rig import RigConfig
from cam_rig.schema.scene import SceneConfig

__all__ = [
    "CamConfig", "Library", "PublishedNoise", "PublishedTables", "RigConfig", "SceneConfig",
    "load_cam", "load_published", "load_rig",
    "load_scene", "load_tables",
]  # fmt: skip

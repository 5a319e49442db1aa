"""The configuration: what a person may write in YAML, checked once, in SI afterwards."""

from cam_rig.schema.cam import CamConfig
from cam_rig.schema.load import Library, load_cam, load_published, load_rig, load_scene
from cam_rig.schema.published import PublishedNoise
from cam_rig.schema.rig import RigConfig
from cam_rig.schema.scene import SceneConfig

__all__ = [
    "CamConfig",
    "Library",
    "PublishedNoise",
    "RigConfig",
    "SceneConfig",
    "load_cam",
    "load_published",
    "load_rig",
    "load_scene",
]

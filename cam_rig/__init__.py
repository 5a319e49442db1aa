"""A virtual cam test rig: cam laws, follower dynamics with loss of contact, and noise.

All units are SI; angles are in rad, and a speed in rpm says so in its name.

>>> import cam_rig
>>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
>>> rig = cam_rig.load_rig("paper_table2")
>>> motion = cam_rig.simulate(law, rig, model="two_mass", rpm=450, turns=3)
>>> motion.force.shape == motion.time.shape
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cam_rig.api.campaign import campaign
    from cam_rig.api.contour import contour
    from cam_rig.api.design import design
    from cam_rig.api.files import build_law, load_cam, load_rig, load_scene
    from cam_rig.api.jump import jump_speed
    from cam_rig.api.largest_waviness import largest_waviness
    from cam_rig.api.motion import simulate
    from cam_rig.api.real_run import compare_run
    from cam_rig.api.scene_run import read_bag, run_scene
    from cam_rig.api.sound import sound_level
    from cam_rig.errors import CamRigError
    from cam_rig.laws import Law

    __version__: str

#: Where each name is defined. It is imported when it is first asked for.
_HOMES = {
    "CamRigError": "cam_rig.errors",
    "Law": "cam_rig.laws",
    "build_law": "cam_rig.api.files",
    "campaign": "cam_rig.api.campaign",
    "compare_run": "cam_rig.api.real_run",
    "contour": "cam_rig.api.contour",
    "design": "cam_rig.api.design",
    "jump_speed": "cam_rig.api.jump",
    "largest_waviness": "cam_rig.api.largest_waviness",
    "load_cam": "cam_rig.api.files",
    "load_rig": "cam_rig.api.files",
    "load_scene": "cam_rig.api.files",
    "read_bag": "cam_rig.api.scene_run",
    "run_scene": "cam_rig.api.scene_run",
    "simulate": "cam_rig.api.motion",
    "sound_level": "cam_rig.api.sound",
}

__all__ = [
    "CamRigError",
    "Law",
    "__version__",
    "build_law",
    "campaign",
    "compare_run",
    "contour",
    "design",
    "jump_speed",
    "largest_waviness",
    "load_cam",
    "load_rig",
    "load_scene",
    "read_bag",
    "run_scene",
    "simulate",
    "sound_level",
]


def __getattr__(name: str) -> Any:
    """A public name, from the module that defines it; the version from the installed package."""
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("cam_rig")
    elif name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)

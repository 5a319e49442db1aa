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
    from cam_rig.bag.reader import read_bag
    from cam_rig.bounce.study import bounce_map
    from cam_rig.campaigns.largest_waviness import largest_waviness
    from cam_rig.campaigns.run import campaign
    from cam_rig.dynamics.jump.rigs import jump_speed
    from cam_rig.errors import CamRigError
    from cam_rig.law_design.design import design
    from cam_rig.laws import Law
    from cam_rig.measured.real_run.run import compare_run
    from cam_rig.profile.contour import contour
    from cam_rig.simulation.motion import simulate
    from cam_rig.simulation.scene import build_law, load_cam, load_rig, load_scene
    from cam_rig.simulation.scene_run import run_scene
    from cam_rig.simulation.sound import sound_level

    __version__: str

#: Where each name is defined. It is imported when it is first asked for.
_HOMES = {
    "CamRigError": "cam_rig.errors",
    "Law": "cam_rig.laws",
    "bounce_map": "cam_rig.bounce.study",
    "build_law": "cam_rig.simulation.scene",
    "campaign": "cam_rig.campaigns.run",
    "compare_run": "cam_rig.measured.real_run.run",
    "contour": "cam_rig.profile.contour",
    "design": "cam_rig.law_design.design",
    "jump_speed": "cam_rig.dynamics.jump.rigs",
    "largest_waviness": "cam_rig.campaigns.largest_waviness",
    "load_cam": "cam_rig.simulation.scene",
    "load_rig": "cam_rig.simulation.scene",
    "load_scene": "cam_rig.simulation.scene",
    "read_bag": "cam_rig.bag.reader",
    "run_scene": "cam_rig.simulation.scene_run",
    "simulate": "cam_rig.simulation.motion",
    "sound_level": "cam_rig.simulation.sound",
}
__all__ = [
    "CamRigError",
    "Law",
    "__version__",
    "bounce_map",
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

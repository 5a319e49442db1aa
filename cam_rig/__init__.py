"""A virtual cam test rig: cam laws, follower dynamics with loss of contact, and noise.

======================================================  ===========================================
subject                                                 functions and classes
======================================================  ===========================================
cam, rig or scene from a file                           load_cam, load_rig, load_scene
names of the shipped cams and rigs                      list_cams, list_rigs
user-defined cam or rig, and its file                   Cam(...), Rig(...), .replace(), .save()
motion law s(θ) and its derivatives                     build_law, Law, plot_law
peaks and joints of laws                                law_summary, list_laws
contour of a cam, and its checks                        contour, check_contours
motion, lift-offs and landings at one speed             simulate
the same at many speeds, with sound levels              sweep, run_scene (scene file)
speed at which contact is lost                          jump_speed, jump_speeds (with the paper's)
bounces of the follower above that speed                bounce_map
residual vibration, orders, contact pressure            vibration, order_spectrum, contact_stress
sound level of a motion                                 sound_level
noise study of the paper                                noise_study
linear model for scipy.signal                           Rig.state_space, Rig.frequency_response
optimised law, with a proven bound                      design
cam for a motion controller, and back                   electronic, read_electronic
many rigs with varied numbers                           campaign
cam from gauge readings, rig from a measured run        fit_cam, fit_rig
acoustic constants of a rig from measured levels        fit_sound
recorded run, and its comparison with the model         read_bag, compare
======================================================  ===========================================

Results have the methods ``.tables()``, ``.to_pandas()``, ``.to_json()``, ``.plot()`` and
``.summary()``. All units are SI. Angles are in rad, and speeds in rpm have rpm in their names. The
functions raise a `CamRigError`, which is also a ``ValueError`` or a ``TypeError`` if an argument is
invalid.

Examples
--------
>>> import cam_rig
>>> motion = cam_rig.simulate("poly345", "paper_table2", model="two_mass", rpm=450, turns=3)
>>> motion.force.shape == motion.time.shape
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cam_rig.errors import CamRigError
    from cam_rig.laws import Law
    from cam_rig.schema import CamConfig as Cam
    from cam_rig.schema import RigConfig as Rig
    from cam_rig.simulation.inputs import build_law
    from cam_rig.simulation.scene import list_cams, list_rigs, load_cam, load_rig, load_scene
    from cam_rig.studies.bounce.study import bounce_map
    from cam_rig.studies.campaign.study import campaign
    from cam_rig.studies.compare.study import compare
    from cam_rig.studies.contact.study import contact_stress
    from cam_rig.studies.design.study import design
    from cam_rig.studies.electronic.study import electronic, read_electronic
    from cam_rig.studies.fit_cam.study import fit_cam
    from cam_rig.studies.fit_rig.study import fit_rig
    from cam_rig.studies.fit_sound.study import fit_sound
    from cam_rig.studies.jump.jump_speed import jump_speed
    from cam_rig.studies.jump.study import jump_speeds
    from cam_rig.studies.laws.figures import plot_law
    from cam_rig.studies.laws.rises import list_laws
    from cam_rig.studies.laws.study import law_summary
    from cam_rig.studies.noise.study import noise_study
    from cam_rig.studies.orders.study import order_spectrum
    from cam_rig.studies.profile.contour import contour
    from cam_rig.studies.profile.study import check_contours
    from cam_rig.studies.simulate.motion import simulate
    from cam_rig.studies.simulate.recorded import read_bag
    from cam_rig.studies.simulate.sound import sound_level
    from cam_rig.studies.simulate.study import run_scene, sweep
    from cam_rig.studies.vibration.study import vibration

    __version__: str

#: Module of each public name, with the name in the module if it differs. It is imported on demand.
_HOMES = {
    "Cam": "cam_rig.schema:CamConfig",
    "CamRigError": "cam_rig.errors",
    "Law": "cam_rig.laws",
    "Rig": "cam_rig.schema:RigConfig",
    "bounce_map": "cam_rig.studies.bounce.study",
    "build_law": "cam_rig.simulation.inputs",
    "campaign": "cam_rig.studies.campaign.study",
    "check_contours": "cam_rig.studies.profile.study",
    "compare": "cam_rig.studies.compare.study",
    "contact_stress": "cam_rig.studies.contact.study",
    "contour": "cam_rig.studies.profile.contour",
    "design": "cam_rig.studies.design.study",
    "electronic": "cam_rig.studies.electronic.study",
    "fit_cam": "cam_rig.studies.fit_cam.study",
    "fit_rig": "cam_rig.studies.fit_rig.study",
    "fit_sound": "cam_rig.studies.fit_sound.study",
    "jump_speeds": "cam_rig.studies.jump.study",
    "jump_speed": "cam_rig.studies.jump.jump_speed",
    "law_summary": "cam_rig.studies.laws.study",
    "list_cams": "cam_rig.simulation.scene",
    "list_laws": "cam_rig.studies.laws.rises",
    "list_rigs": "cam_rig.simulation.scene",
    "load_cam": "cam_rig.simulation.scene",
    "load_rig": "cam_rig.simulation.scene",
    "load_scene": "cam_rig.simulation.scene",
    "noise_study": "cam_rig.studies.noise.study",
    "order_spectrum": "cam_rig.studies.orders.study",
    "plot_law": "cam_rig.studies.laws.figures",
    "read_bag": "cam_rig.studies.simulate.recorded",
    "read_electronic": "cam_rig.studies.electronic.study",
    "run_scene": "cam_rig.studies.simulate.study",
    "simulate": "cam_rig.studies.simulate.motion",
    "sound_level": "cam_rig.studies.simulate.sound",
    "sweep": "cam_rig.studies.simulate.study",
    "vibration": "cam_rig.studies.vibration.study",
}
__all__ = [
    "Cam", "CamRigError", "Law", "Rig", "__version__", "bounce_map", "build_law", "campaign",
    "check_contours", "compare", "contact_stress", "contour", "design", "electronic", "fit_cam",
    "fit_rig", "fit_sound", "jump_speed", "jump_speeds", "law_summary", "list_cams", "list_laws",
    "list_rigs", "load_cam", "load_rig", "load_scene", "noise_study", "order_spectrum",
    "plot_law", "read_bag", "read_electronic", "run_scene", "simulate", "sound_level", "sweep",
    "vibration",
]  # fmt: skip


if not TYPE_CHECKING:  # without this function a type checker reports unknown names

    def __getattr__(name: str) -> object:
        """Return a public name from its module, or the version of the installed package."""
        if name == "__version__":
            from importlib.metadata import version

            value: object = version("cam_rig")
        elif name in _HOMES:
            from cam_rig.extras import friendly_import_errors

            module, _, name_in_module = _HOMES[name].partition(":")
            with friendly_import_errors():
                value = getattr(import_module(module), name_in_module or name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """Return the public names, for completion in an interactive session."""
    return sorted(__all__)

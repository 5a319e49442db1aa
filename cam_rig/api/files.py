"""Cams, rigs and scenes from files: the shipped ones by their names, one's own by their paths."""

from __future__ import annotations

from pathlib import Path

from cam_rig import laws
from cam_rig.api.arguments import checked
from cam_rig.schema import CamConfig, RigConfig, load
from cam_rig.schema.load import named_path
from cam_rig.simulation.loaded_scene import LoadedScene, open_scene


@checked
def load_cam(cam: str | Path) -> CamConfig:
    """A cam: its law as segments around the turn, and its follower.

    Parameters
    ----------
    cam : a name in ``config/cams`` (``"poly345"``), or the path of a YAML file

    Raises
    ------
    ConfigError : one line that names file, key, value and what is allowed

    Examples
    --------
    >>> import cam_rig
    >>> cam = cam_rig.load_cam("poly345")
    >>> cam.lift.si, cam.lift.origin  # m
    (0.05, 'given')
    """
    return load.load_cam(named_path("cams", cam))


build_law = checked(laws.build_law)


@checked
def load_rig(rig: str | Path) -> RigConfig:
    """A rig: the follower's masses, springs and dampers, its shaft, and how it sounds.

    Parameters
    ----------
    rig : a name in ``config/rigs`` (``"paper_table2"``, ``"tm21"``), or the path of a YAML file

    Raises
    ------
    ConfigError : one line that names file, key, value and what is allowed

    Examples
    --------
    >>> import cam_rig
    >>> rig = cam_rig.load_rig("paper_table2")
    >>> rig.follower.preload.si  # N
    30.6
    >>> stiffer = rig.with_follower(spring_stiffness=6000.0, preload=40.0)  # N/m, N
    >>> stiffer.follower.spring_stiffness.si
    6000.0
    """
    return load.load_rig(named_path("rigs", rig))


@checked
def load_scene(scene: str | Path) -> LoadedScene:
    """A scene (an experiment: cams on a rig, and speeds) with every file that it names.

    Parameters
    ----------
    scene : a name in ``config/scenes`` (``"quick"``), or the path of a YAML file; what it names is
        looked up beside its folder first, then in ``config``

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it

    Examples
    --------
    >>> import cam_rig
    >>> scene = cam_rig.load_scene("quick")
    >>> list(scene.laws), scene.rig.name, scene.scene.model
    (['tm21', 'bezier15'], 'tm21', 'one_mass')
    """
    return open_scene(named_path("scenes", scene))

"""A sweep over speeds without a scene's file: any cams, a rig, a model, some speeds."""

from __future__ import annotations

from pathlib import Path

from cam_rig.arguments import checked
from cam_rig.show.result import SILENT, Progress
from cam_rig.simulation.asked import Cams, Rig, Speeds, asked_cams, asked_speeds
from cam_rig.simulation.motion import scene_of
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.scene_run import SceneRun, run_scene
from cam_rig.simulation.schedule import tick_count


@checked
def sweep(
    cams: Cams,
    rig: Rig,
    *,
    rpm: Speeds,
    model: str = "one_mass",
    turns: float = 4.0,
    settle_turns: float = 2.0,
    sample_rate: int = 48_000,
    ramp: float | None = None,
    progress: Progress = SILENT,
) -> SceneRun:
    """Run cams through some speeds, one after another: forces, lift-offs, landings and levels.

    What `run_scene` gives of a scene's file. A rig without ``radiation`` has no sound, and
    `simulate` takes it at one speed.

    Parameters
    ----------
    cams : a name, a path or a cam, or several; None: the paper's Table 2
    rig : a name, a path or a rig, with radiation; None: the only one beside the cams
    rpm : one or more, in the order in which they are run, rpm
    model : as `simulate` takes it
    turns : at each speed
    settle_turns : of these before anything is measured
    sample_rate : Hz
    ramp : s, in which each speed is reached evenly; None is at once
    progress : told how far it is

    Raises
    ------
    ConfigError : an argument is out of range, or the rig lacks a number that the model needs
    DynamicsError : a law that the model cannot take

    Examples
    --------
    >>> import cam_rig
    >>> run = cam_rig.sweep("poly345", "tm21", rpm=[300, 450])
    >>> [(row.rpm, round(row.lift_offs), round(row.level_db, 1)) for row in run.by_speed]
    [(300.0, 0, 83.7), (450.0, 1, 92.5)]
    """
    found = asked_cams(cams, rig)
    names, speeds = list(found.cams), asked_speeds(rpm)
    held = turns, settle_turns, sample_rate, ramp
    scene = scene_of("sweep", names, found.rig, model, speeds, *held)
    loaded = LoadedScene(
        scene,
        found.rig,
        found.cams,
        found.laws,
        scene_file=Path(f"{scene.name}.yaml"),
        rig_file=Path(f"{found.rig.name}.yaml"),
        cam_files={name: Path(f"{name}.yaml") for name in found.cams},
    )
    progress.begin(tick_count(scene), "sweep")
    return run_scene(loaded, on_tick=progress.advance)

"""Reading of a recorded run (a ROS 2 bag) together with its scene."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from pathlib import Path

from cam_rig.arguments import check_arguments
from cam_rig.bag.reader import (
    decoded,
    pressure_of,
    read_counts,
    read_ticks,
    scene_of,
    shortcomings,
)
from cam_rig.errors import BagError
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of
from cam_rig.schema.load import resolve_path
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import MeasuredTick
from cam_rig.studies.simulate.study import SceneRun


def read_recording(bag: Path, scene: Path | None = None) -> SceneRun:
    """Read a recorded run with its scene.

    `scene` is the file of the scene that was run, for a bag without an attached scene.

    Raises
    ------
    BagError
        If the bag is missing or not closed, or contains cams that the scene does not have.
    """
    loaded = scene_of(bag, scene)
    states: list[CamState] = []
    pressures: dict[int, float] = {}
    both = {topics.CAM_STATE: cam_state_of, topics.PRESSURE: pressure_of}
    for topic, value in decoded(bag, both):
        if topic is topics.CAM_STATE:
            states.append(value)
        else:
            pressures.update([value])
    if unknown := {state.cam for state in states} - set(loaded.laws):
        raise BagError(
            f"{bag}: the cams must be those of scene {loaded.scene.name} "
            f"({', '.join(loaded.laws)}), got {', '.join(sorted(unknown))}; use the scene of the "
            "run"
        )
    rate = int(loaded.scene.sample_rate.si)
    ticks = tuple(
        MeasuredTick.between(start, end, pressures[end.time_ns], rate)
        for start, end in pairwise(states)
        if end.time_ns in pressures and start.turns_until(end)
    )
    notes = shortcomings(bag, loaded, len(ticks))
    return SceneRun(loaded, ticks, bag, partial(read_ticks, bag), read_counts(bag), notes=notes)


@check_arguments
def read_bag(bag: str | Path, scene: str | Path | None = None) -> SceneRun:
    """Read a recorded run, with the scene that is attached to it.

    The command is ``cam-rig analyze``.

    Parameters
    ----------
    bag : str or Path
        Folder of a bag that ``cam-rig run`` or ``ros2 bag record`` has written.
    scene : str or Path, optional
        Scene that was run, for a bag without an attached scene (of ``ros2 bag record``).

    Returns
    -------
    SceneRun
        Recorded run with its scene.

    Raises
    ------
    BagError
        If the bag is missing, was not closed, or contains another kind of run.
    MissingLibraryError
        If the extra ``bags`` is not installed.

    Examples
    --------
    >>> import cam_rig
    >>> recording = cam_rig.read_bag("bags/golden")
    >>> recording.complete, list(recording.loaded.laws)
    (True, ['tm21', 'bezier15'])
    """
    return read_recording(Path(bag), None if scene is None else resolve_path("scenes", scene))

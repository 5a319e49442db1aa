"""Function that finds the jump speeds of cams and compares them with the paper's Table 2."""

from __future__ import annotations

from cam_rig.arguments import check_arguments
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.errors import ConfigError
from cam_rig.schema import load_tables
from cam_rig.schema.load import tables_path
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.inputs import Cams, Rig, resolve_cams
from cam_rig.studies.jump.comparison import JumpResult, find_jumps, references


@check_arguments
def jump_speeds(
    cams: Cams = None,
    rig: Rig = None,
    *,
    from_rest: float | None = None,
    steady: bool = False,
    ramp: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> JumpResult:
    """Find the jump speed of cams to 0.01 rpm, compared with the paper's Table 2.

    The jump speed is the lowest speed at which the follower loses contact. `jump_speed` finds the
    jump speed of one law on one or many rigs. The command is ``cam-rig jump``.

    Parameters
    ----------
    cams : str, Path, Cam or sequence
        Cams as names, paths or results of `load_cam`, or one scene (default: the cams of the
        paper's Table 2).
    rig : str, Path or Rig
        Rig (default: that of the scene, or the only rig next to the cams, else
        ``paper_table2``).
    from_rest : float
        Duration in s of runs from rest at constant speed, to 60 s (default: 1.7 s, as in the
        paper).
    steady : bool
        True for the jump speed in steady state.
    ramp : float
        Slope in rpm/s of a ramp from rest, 1 to 1e5 rpm/s, along which the jump speed is found.
    progress : Progress
        Receiver of the progress.

    Returns
    -------
    JumpResult
        Jump speed, cam angle and time of the first lift-off of each cam.

    Raises
    ------
    ConfigError
        A cam, rig or scene is unknown, more than one kind of run is requested, or a duration or
        ramp is out of range.
    DynamicsError
        A cam keeps contact at every speed.

    Examples
    --------
    >>> import cam_rig
    >>> cam_rig.jump_speeds(["poly345"], steady=True).to_pandas().rpm.round(1).tolist()
    [414.5]
    """
    if sum((steady, ramp is not None, from_rest is not None)) > 1:
        raise ConfigError("steady, ramp and from rest cannot be combined; use one of them")
    published, cam_set = load_tables(tables_path()), resolve_cams(cams, rig)
    duration = None if steady else REST_DURATION_S if from_rest is None else from_rest
    return find_jumps(cam_set, references(cam_set, published), duration, ramp, progress)

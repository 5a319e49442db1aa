"""Jump speeds of cams next to the paper's Table 2."""

from __future__ import annotations

from cam_rig.arguments import checked
from cam_rig.dynamics.jump.two_masses import FROM_REST
from cam_rig.errors import ConfigError
from cam_rig.schema import load_tables
from cam_rig.schema.load import tables_path
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.asked import Cams, Rig, asked_cams
from cam_rig.studies.jump.comparison import JumpResult, find_jumps, references


@checked
def jump(
    cams: Cams = None,
    rig: Rig = None,
    *,
    from_rest: float | None = None,
    steady: bool = False,
    ramp: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> JumpResult:
    """The jump speed of cams to 0.01 rpm, beside the paper's Table 2.

    `jump_speed` is that of one law on a rig of one's own, or on many.

    The command is ``cam-rig jump``.

    Parameters
    ----------
    cams : a name, a path or a cam, or several; or one scene. None: the paper's Table 2
    rig : a name, a path or a rig; None: the scene's, or the only one beside the cams, else
        ``paper_table2``
    from_rest : s, length of runs from rest at one speed; None: 1.7 s, as the paper
    steady : in steady state instead
    ramp : rpm/s, along a ramp from rest instead
    progress : told how far it is

    Raises
    ------
    ConfigError : an unknown cam, rig or scene; more than one kind of run, or a wrong one
    DynamicsError : a cam that never jumps

    Examples
    --------
    >>> import cam_rig
    >>> cam_rig.jump(["poly345"], steady=True).to_pandas().rpm.round(1).tolist()
    [414.5]
    """
    if sum((steady, ramp is not None, from_rest is not None)) > 1:
        raise ConfigError("steady, ramp and from rest are three kinds of run; allowed: one of them")
    published, cam_set = load_tables(tables_path()), asked_cams(cams, rig)
    duration = None if steady else FROM_REST if from_rest is None else from_rest
    return find_jumps(cam_set, references(cam_set, published), duration, ramp, progress)

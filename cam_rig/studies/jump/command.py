"""Command ``cam-rig jump``: speeds at which cams lose contact with the follower."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.show.command import CamsOrScene, RigOfScene, command
from cam_rig.show.result import Progress, Result


@command("json", "csv", "plot")
def jump(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    from_rest: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Duration of each run from rest, to 60 s (default: 1.7)."
        ),
    ] = None,
    steady: Annotated[bool, typer.Option("--steady", help="Find it in steady state.")] = False,
    ramp: Annotated[
        float | None, typer.Option(metavar="RPM/S", help="Find it along a ramp, 1 to 1e5.")
    ] = None,
    *,
    plot: Path | None,
    progress: Progress,
) -> Result:
    """Find the jump speed of cams to 0.01 rpm, compared with the paper's Table 2.

    The follower has two masses if the rig contains their split, else one rigid mass. A run starts
    from rest at cam angle 0, is in steady state, or follows a ramp. Angle and time are those of the
    first lift-off.

    In Python: cam_rig.jump_speeds(cams, rig, from_rest, steady, ramp)

    Examples
    --------
    cam-rig jump --plot out/jump.png

    cam-rig jump poly345 bezier15 --steady --json -

    cam-rig jump quick --rig tm21 --ramp 350
    """
    from cam_rig.studies.jump import study

    if plot is not None and ramp is not None:
        raise ConfigError(
            "--plot cannot be combined with --ramp: it shows the minimum force at constant speeds"
        )
    return study.jump_speeds(
        cams, rig, from_rest=from_rest, steady=steady, ramp=ramp, progress=progress
    )

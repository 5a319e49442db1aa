"""The command ``cam-rig jump``."""

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
            metavar="SECONDS", help="Length of the run from rest, at one speed: 1.7, to 60 s."
        ),
    ] = None,
    steady: Annotated[bool, typer.Option("--steady", help="In steady state instead.")] = False,
    ramp: Annotated[
        float | None, typer.Option(metavar="RPM/S", help="Along a ramp instead, 1 to 1e5.")
    ] = None,
    *,
    plot: Path | None,
    progress: Progress,
) -> Result:
    """Find the jump speed of cams to 0.01 rpm, beside the paper's Table 2.

    The follower is two masses where the rig says how they split, else one rigid mass: from rest at
    cam angle 0, in steady state, or along a ramp. Angle and time are of the first lift-off.

    In Python: cam_rig.jump(cams, rig, from_rest, steady, ramp)

    Examples
    --------
    cam-rig jump --plot out/jump.png

    cam-rig jump poly345 bezier15 --steady --json -

    cam-rig jump quick --rig tm21 --ramp 350
    """
    from cam_rig.studies.jump import study

    if plot is not None and ramp is not None:
        raise ConfigError(
            "--plot shows the least force of speeds that are held, and --ramp holds none; "
            "allowed: one of them"
        )
    return study.jump(cams, rig, from_rest=from_rest, steady=steady, ramp=ramp, progress=progress)

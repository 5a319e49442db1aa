"""Command ``cam-rig fit sound``: acoustic constants of a rig from levels of one cam."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.show.command import Scene, command
from cam_rig.show.result import Result
from cam_rig.show.terminal import say

Levels = Annotated[Path, typer.Argument(help="Table with one row per speed: columns rpm and dB.")]
Cam = Annotated[
    str | None,
    typer.Option(help="Measured cam of the scene (default: calibrated_on of the rig)."),
]


@command("json", "csv")
def fit_sound(
    levels: Levels,
    scene: Scene,
    cam: Cam = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the result only.")] = False,
) -> Result:
    """Fit gain and cut-off of a rig's radiation to measured levels of one cam.

    The numbers are ``radiation.gain`` and ``radiation.corner_frequency`` of the scene's rig file,
    and the cam is its ``calibrated_on``. They are fitted by least squares in dB, and written into
    the rig file with the fit error and the follower. With another follower levels are relative.
    The levels of all other cams are then predictions.

    In Python: cam_rig.fit_sound(levels, scene, cam)

    Examples
    --------
    cam-rig fit sound meter.csv tm21_sweep --dry-run

    cam-rig fit sound meter.csv mine/scenes/bench.yaml --cam mycam --json -
    """
    from cam_rig.studies.fit_sound import study

    result = study.fit_sound(levels, scene, cam=cam)
    if not dry_run:
        say(f"written to {result.write()}")
    return result

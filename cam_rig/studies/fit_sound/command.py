"""cam-rig fit sound: the acoustic constants of a rig from measured levels of one cam."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.show.command import Scene, command
from cam_rig.show.result import Result
from cam_rig.show.terminal import say

Levels = Annotated[Path, typer.Argument(help="Table with a row per speed: columns rpm and dB.")]
Cam = Annotated[
    str | None,
    typer.Option(help="Cam of the scene that was measured; by default the rig's calibrated_on."),
]


@command("json", "csv")
def fit_sound(
    levels: Levels,
    scene: Scene,
    cam: Cam = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show, write nothing.")] = False,
) -> Result:
    """Fit gain and cut-off of a rig's radiation to measured sound pressure levels of one cam.

    They are ``radiation.gain`` and ``corner`` of the scene's rig file, the cam is its
    ``calibrated_on``. Two numbers are fitted, by least squares in dB, and written into the rig file
    with the fit error and the follower they hold for: with another one levels are relative. Every
    other cam's level is then a prediction.

    In Python: cam_rig.fit_sound(levels, scene, cam)

    Examples
    --------
    cam-rig fit sound meter.csv tm21_sweep --dry-run

    cam-rig fit sound meter.csv mine/scenes/bench.yaml --cam mycam --json -
    """
    from cam_rig.studies.fit_sound import study

    found = study.fit_sound(levels, scene, cam=cam)
    if not dry_run:
        say(f"written to {found.write()}")
    return found

"""Command ``cam-rig noise``, which compares simulated with published noise."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import DEFAULT_SCENE, Scene, command
from cam_rig.show.result import Progress, Result


@command("json", "csv", "plot")
def noise(
    scene: Scene = DEFAULT_SCENE,
    rig: Annotated[
        str, typer.Option(help="Rig identified from jump speeds, file or name.")
    ] = "paper_table2",
    one_rig: Annotated[
        bool,
        typer.Option("--one-rig", help="Fit the arc cam on that rig too (takes minutes)."),
    ] = False,
    *,
    progress: Progress,
) -> Result:
    """Calibrate noise on one cam, predict another, and identify the third.

    The study contains the transfer functions between force and sound, and three methods of
    calibration, with 95 % bands and the speed at which two cams are equally loud. Further parts
    leave out each cam in turn, and use the rig identified from jump speeds. It takes about ten
    seconds.

    In Python: cam_rig.noise_study(scene, rig, one_rig)

    Examples
    --------
    cam-rig noise --plot out/noise_study.png

    cam-rig noise --json - | jq '.methods[] | {calibration, named_crossing}'
    """
    from cam_rig.studies.noise import study

    return study.noise_study(scene, rig, one_rig, progress=progress)

"""Command ``cam-rig vibration``: vibration of cams in steady state."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import CamsOrScene, RigOfScene, command
from cam_rig.show.result import Progress, Result


@command("json", "csv", "plot")
def vibration(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    rpm: Annotated[list[float] | None, typer.Option(help="Speed, can be repeated.")] = None,
    sweep: Annotated[
        str | None, typer.Option(help="Speeds of the residual amplitude: 200:400:1 (from:to:step).")
    ] = None,
    *,
    progress: Progress,
) -> Result:
    """Measure residual vibration, peak acceleration and twist of the shaft.

    The models are eq. 5 and eq. 10 of the paper in steady state. The residual amplitude is that of
    the free vibration excited by the joints of a law. It is measured in the low dwell, or within
    31.25° of the lowest lift without a low dwell. † marks cams whose jump speed is below
    the speed. The model keeps their follower in contact, and the paper's claims are tested without
    this speed. The plot shows the last speed. The default is up to four speeds of a scene, or 200,
    250, 300 and 350 rpm, which are below every jump speed of the paper's laws.

    With --sweep a table has the smallest and the largest residual amplitude of each cam over the
    speed. The plot shows the amplitude over the speed, dotted above the jump speed of the cam.

    In Python: cam_rig.vibration(cams, rig, rpm, sweep)

    Examples
    --------
    cam-rig vibration --plot out/vibration.png

    cam-rig vibration poly345 poly4567 --rig tm21 --rpm 300 --json -

    cam-rig vibration quick --rig paper_table2

    cam-rig vibration poly4567 polydyne_300 shaped_300 --sweep 200:400:1 --plot out/tuned.png
    """
    from cam_rig.simulation.inputs import parse_speeds
    from cam_rig.studies.vibration import study

    speeds = None if sweep is None else parse_speeds(sweep, "--sweep")
    return study.vibration(cams, rig, rpm or None, speeds, progress=progress)

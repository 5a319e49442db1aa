"""The command ``cam-rig vibration``."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import CamsOrScene, RigOfScene, command
from cam_rig.show.result import Progress, Result


@command("json", "csv", "plot")
def vibration(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    rpm: Annotated[list[float] | None, typer.Option(help="Speed; may be given often.")] = None,
    *,
    progress: Progress,
) -> Result:
    """Measure residual vibration in the low dwell, peak acceleration, and twist of the shaft.

    Eq. 5 and eq. 10 of the paper, in steady state. The residual amplitude is of the free vibration
    that a law's joints excite; a law without a low dwell is read within 31.25° of its lowest lift.
    † marks cams whose follower loses contact below a speed: the model holds it on, and the paper's
    claims are tested without that speed. The plot shows the last speed. By default up to four
    speeds of a scene; 200, 250, 300 and 350 rpm, below every jump speed of the paper's laws.

    In Python: cam_rig.vibration(cams, rig, rpm)

    Examples
    --------
    cam-rig vibration --plot out/vibration.png

    cam-rig vibration poly345 poly4567 --rig tm21 --rpm 300 --json -

    cam-rig vibration quick --rig paper_table2
    """
    from cam_rig.studies.vibration import study

    return study.vibration(cams, rig, rpm or None, progress=progress)

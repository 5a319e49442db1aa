"""Command cam-rig least-preload: lowest preload for a rigid follower in contact."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import CamsOrScene, RigOfScene, command
from cam_rig.show.result import Progress, Result


@command("json", "csv", "plot")
def least_preload(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    rpm: Annotated[list[float] | None, typer.Option(help="Speed; may be given often.")] = None,
    *,
    progress: Progress,
) -> Result:
    """Find the least preload that keeps one rigid mass on its cam, speed by speed.

    In Python: cam_rig.least_preload(cams, rig, rpm)

    Examples
    --------
    cam-rig least-preload poly345 bezier15 --rpm 450 --rpm 500
    """
    from . import study

    return study.least_preload(cams, rig, rpm or study.DEFAULT_RPM, progress=progress)

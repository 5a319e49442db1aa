"""cam-rig least-preload: the preload that keeps a rigid follower on its cam."""

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

    Examples
    --------
    cam-rig least-preload poly345 bezier15 --rpm 450 --rpm 500
    """
    from cam_rig.simulation.asked import asked_cams

    from .study import least_preloads

    return least_preloads(asked_cams(cams, rig), rpm or [300.0, 400.0, 500.0], progress)

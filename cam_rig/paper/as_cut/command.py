"""cam-rig as-cut: a cam whose contour was drawn for a point, driven with a roller."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import DEFAULT_SCENE, RigOfCam, SceneOption, TableCams, command
from cam_rig.show.result import Progress, Result

Millimetres = Annotated[
    float | None, typer.Option(help="Radius in mm, instead of the cam's own.", show_default=False)
]


@command("json", "csv", "plot")
def as_cut(
    cams: TableCams = None,
    rig: RigOfCam = None,
    scene: SceneOption = DEFAULT_SCENE,
    base: Millimetres = None,
    roller: Millimetres = None,
    *,
    progress: Progress,
) -> Result:
    """Drive a roller on the contour of a point, as fig. 12 of the paper draws it.

    The paper plots R_b + s over the angle: the contour of a point follower. A roller on it touches
    beside its guide and stands above s. Its lift, jump speed and noise beside those of s itself.
    The scene gives the follower, sound and speeds of the noise. The plot shows the first cam.

    In Python: cam_rig.as_cut(cams, rig, scene, base, roller)

    Examples
    --------
    cam-rig as-cut

    cam-rig as-cut bezier15 --base 80 --roller 20 --plot out/as_cut.png
    """
    from cam_rig.paper.as_cut import study

    base_m, roller_m = (None if mm is None else 1e-3 * mm for mm in (base, roller))
    return study.as_cut(cams, rig, scene, base=base_m, roller=roller_m, progress=progress)

"""Command ``cam-rig urdf``: the rig as URDF for robot_state_publisher and RViz."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.show.command import DEFAULT_SCENE, Scene, command
from cam_rig.show.terminal import say


@command()
def urdf(
    scene: Scene = DEFAULT_SCENE,
    cam: Annotated[
        str | None,
        typer.Option(help="Mounted cam, a name in config/cams (default: the first of the scene)."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="URDF file (default: stdout).")
    ] = None,
) -> None:
    """Print the rig of a scene as URDF: base, guide, motor, microphone, cam and follower.

    Lengths are in m, axes follow REP 103: x points forward along the shaft, z up. Every link has a
    mass, and the same bodies for display and collision. The mounted cam is approximated by a prism.
    The topic /cam/markers has its exact contour.

    Examples
    --------
    cam-rig urdf quick

    cam-rig urdf tm21_sweep --cam poly345 --out out/rig.urdf
    """
    from cam_rig.files import atomic_write, check_writable
    from cam_rig.messages.frames import Robot
    from cam_rig.messages.urdf import urdf as text_of
    from cam_rig.simulation.scene import load_scene

    if out is not None:
        check_writable(out)
    loaded = load_scene(scene)
    if cam is not None:
        loaded.mount(cam)
    text = text_of(Robot.of(loaded, cam))
    if out is None:
        print(text, end="")
        return
    with atomic_write(out) as part:
        part.write_text(text, encoding="utf-8")
    say(f"URDF: {out}")

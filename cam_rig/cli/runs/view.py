"""cam-rig view: a recorded run in the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.cli.common.console import console, progress_bar, user_errors
from cam_rig.cli.common.names import scene_path
from cam_rig.cli.common.options import SceneOfBag
from cam_rig.viewer.options import Layout, ViewOptions


def view(
    bag: Annotated[
        Path | None, typer.Argument(help="Bag to show; by default the newest in bags/.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.rrd", help="Write a file, open no viewer.")
    ] = None,
    web: Annotated[
        bool, typer.Option("--web", help="Serve it to a browser on this machine, open no window.")
    ] = False,
    layout: Annotated[
        Layout,
        typer.Option(help="For a run, for cams side by side at one speed, or for a report."),
    ] = Layout.RUN,
    rpm: Annotated[
        float | None,
        typer.Option(help="Speed at which cams are compared; by default the highest."),
    ] = None,
    scene: SceneOfBag = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file.")] = False,
    all_samples: Annotated[
        bool,
        typer.Option(
            "--all-samples",
            help="Keep every sample of a long run, not the minimum and maximum of every few.",
        ),
    ] = False,
) -> None:
    """Show a recorded run: the cam turning, its follower, lift, contact force and sound.

    The viewer stays open until its window is closed, or until Ctrl-C. Nothing leaves this machine.

    Examples
    --------
    cam-rig view

    cam-rig view bags/golden --web

    cam-rig view --layout compare --rpm 350

    cam-rig view bags/tm21_sweep_2026-01-31_12-00-00 --save out/sweep.rrd
    """
    with user_errors():
        from cam_rig.errors import ConfigError

        if save is not None and web:
            raise ConfigError("--save and --web: a file is written or a page served; name one")
        if save is None and force:
            raise ConfigError("--force: overwrites the file of --save, and none is named")
        view_options = ViewOptions(layout, rpm, all_samples)
        _view(bag, scene_path(scene) if scene else None, save, web, view_options, force)


def _view(
    bag: Path | None,
    scene: Path | None,
    save: Path | None,
    web: bool,
    view_options: ViewOptions,
    force: bool,
) -> None:
    from cam_rig.cli.runs.analyze import newest_bag
    from cam_rig.files import temporary_folder
    from cam_rig.viewer.server.process import require_display, show

    if save is not None:
        convert(bag or newest_bag(), scene, save, view_options, force)
        return
    if not web:
        require_display()
    found = bag or newest_bag()
    with temporary_folder() as folder:
        path = folder / f"{found.resolve().name}.rrd"
        begin = convert(found, scene, path, view_options, force=False)
        if web:
            _serve(path, begin)
        else:
            show(path)


def convert(
    bag: Path, scene: Path | None, path: Path, view_options: ViewOptions, force: bool
) -> float:
    """Write a bag as a Rerun recording, with its own scene unless another is named.

    Gives the rig time (s) from which it is played.
    """
    from cam_rig.bag.reader import read_counts
    from cam_rig.messages.topics import FOLLOWER_SAMPLES
    from cam_rig.simulation.loaded_scene import open_scene
    from cam_rig.viewer.recording import save_recording

    loaded = open_scene(scene) if scene else None
    with progress_bar() as bar:
        task = bar.add_task(bag.name, total=read_counts(bag).get(FOLLOWER_SAMPLES.name, 0))
        begin = save_recording(
            bag,
            path,
            view_options,
            loaded=loaded,
            overwrite=force,
            on_tick=lambda: bar.advance(task),
        )
    console.print(f"{path}: {path.stat().st_size / 1e6:.1f} MB", soft_wrap=True)
    return begin


def _serve(path: Path, begin: float) -> None:
    from cam_rig.cli.common.screen import stay_until_interrupted
    from cam_rig.viewer.server.web import serve_file

    with serve_file(path, begin) as address:
        print(address, flush=True)
        stay_until_interrupted()

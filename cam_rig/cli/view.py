"""cam-rig view: a recorded run as a moving picture in Rerun."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.cli.console import console, progress_bar, user_errors


def view(
    bag: Annotated[
        Path | None, typer.Argument(help="Bag to show; by default the newest in bags/.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.rrd", help="Write a file, open no viewer.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file.")] = False,
    all_samples: Annotated[
        bool,
        typer.Option(
            "--all-samples",
            help="Keep every sample of a long run, not the least and greatest of each few.",
        ),
    ] = False,
) -> None:
    """Show a recorded run: the cam turning, its follower, lift, contact force and sound level.

    The viewer stays open until its window is closed, or until Ctrl-C.

    Examples
    --------
    cam-rig view

    cam-rig view bags/tm21_sweep_2026-01-31_12-00-00 --save out/sweep.rrd
    """
    with user_errors():
        from cam_rig.cli.analyze import newest_bag

        if save is not None:
            convert(bag or newest_bag(), save, force, all_samples)
            return
        try:
            _show(bag or newest_bag(), all_samples)
        except KeyboardInterrupt:
            raise typer.Exit(130) from None


def convert(bag: Path, path: Path, force: bool, all_samples: bool) -> None:
    """Write the picture of a bag to a file."""
    from cam_rig.bag.reader import read_counts
    from cam_rig.bag.topics import FOLLOWER_SAMPLES
    from cam_rig.view.recording import save_recording

    with progress_bar() as bar:
        task = bar.add_task(bag.name, total=read_counts(bag).get(FOLLOWER_SAMPLES.name, 0))
        save_recording(
            bag,
            path,
            all_samples=all_samples,
            overwrite=force,
            on_tick=lambda: bar.advance(task),
        )
    console.print(f"{path}: {path.stat().st_size / 1e6:.1f} MB", soft_wrap=True)


def _show(bag: Path, all_samples: bool) -> None:
    from tempfile import TemporaryDirectory

    from cam_rig.view.viewer import require_display, show

    require_display()
    with TemporaryDirectory(prefix="cam_rig_") as folder:
        path = Path(folder) / f"{bag.name}.rrd"
        convert(bag, path, force=False, all_samples=all_samples)
        show(path)

"""cam-rig pictures: the pictures of the documents, from a recorded run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.cli.common.console import console, progress_bar, user_errors
from cam_rig.cli.common.outputs import writing


def pictures(
    bag: Annotated[
        Path | None, typer.Argument(help="Bag to draw; by default the newest in bags/.")
    ] = None,
    to: Annotated[Path, typer.Option(help="Folder to write into.")] = Path("docs"),
) -> None:
    """Draw a run for the documents: an animation, cams side by side, noise against rpm.

    Files of the same names are replaced. Notes beside them say what they were drawn from. Where
    Chromium is installed, the Rerun viewer is photographed in it too.

    Examples
    --------
    cam-rig pictures

    cam-rig pictures bags/mine --to out
    """
    with user_errors():
        from cam_rig.cli.runs.analyze import newest_bag

        _draw(bag or newest_bag(), to)


def _draw(bag: Path, to: Path) -> None:
    from cam_rig.bag.reader import read_counts, read_recording
    from cam_rig.errors import CamRigError
    from cam_rig.files import temporary_folder
    from cam_rig.messages.topics import FOLLOWER_SAMPLES
    from cam_rig.plots import noise as noise_plot
    from cam_rig.simulation.levels import compare, step_levels
    from cam_rig.viewer.album import read_album
    from cam_rig.viewer.pictures import VIEWER, draw_pictures, photograph_run

    with progress_bar() as bar:
        task = bar.add_task(bag.name, total=read_counts(bag).get(FOLLOWER_SAMPLES.name, 0))
        album = read_album(bag, lambda: bar.advance(task))
    loaded = album.loaded
    levels = step_levels(read_recording(bag).ticks, loaded.scene.program.settle_turns.si)
    result = compare(levels, {cam: loaded.role(cam) for cam in levels}, loaded.published)
    with temporary_folder() as folder:
        drawn = draw_pictures(album, lambda path: noise_plot.draw(result, loaded, path), folder)
        try:
            drawn += photograph_run(bag, loaded, folder)
        except CamRigError as error:
            console.print(f"{to / VIEWER}: left as it is ({error})", soft_wrap=True)
        for path in drawn:
            with writing(to / path.name) as part:
                part.write_bytes(path.read_bytes())
            console.print(f"{to / path.name}: {path.stat().st_size / 1e3:.0f} kB", soft_wrap=True)

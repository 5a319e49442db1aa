"""Pictures of the documents from a recorded run: `make pictures`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.bag.command import newest_bag
from cam_rig.bag.reader import read_counts
from cam_rig.errors import CamRigError
from cam_rig.files import atomic_write, temporary_folder
from cam_rig.messages.topics import FOLLOWER_SAMPLES
from cam_rig.show.command import make_progress_bar, user_errors
from cam_rig.show.figure import write
from cam_rig.show.terminal import console
from cam_rig.simulation.regression import NoiseResult, compare
from cam_rig.simulation.simulate import step_levels
from cam_rig.studies.simulate import figures as noise
from cam_rig.studies.simulate.recorded import read_recording
from tools.docs import bench_picture, course_pictures, panel_picture
from tools.docs.bench_picture import photograph_bench
from tools.docs.panel_picture import photograph_lab, photograph_panel, photograph_static
from tools.docs.pictures import draw_pictures
from tools.docs.screenshot import SHORT_BAG, TABS, photograph_tab, photograph_viewer
from tools.docs.turn_archive import TurnArchive, read_turns

#: File of the screenshot of the viewer.
VIEWER = "viewer.png"
#: File of the screenshot of the bench.
BENCH = bench_picture.PICTURE.name


def pictures(
    bag: Annotated[
        Path | None, typer.Argument(help="Bag to draw; by default the newest in bags/.")
    ] = None,
    to: Annotated[Path, typer.Option(help="Folder to write into.")] = Path("docs"),
) -> None:
    """Draw a run for the documents: animation, cams side by side, noise against rpm.

    Files of the same names are replaced. If Chromium is installed, the Rerun viewer and
    the pages of the panel are photographed too. Pictures of the lessons go to docs/course.

    Examples
    --------
    python -m tools.docs.main

    python -m tools.docs.main bags/mine --to out
    """
    with user_errors():
        _draw(bag or newest_bag(), to)
        course_pictures.draw_all()


def _draw(bag: Path, to: Path) -> None:
    archive, result = _read(bag)
    with temporary_folder() as folder:
        paths = draw_pictures(
            archive, lambda path: write(noise.noise_figure(result, archive.loaded), path), folder
        )
        screenshots: dict[str, Callable[[Path], None]] = {
            VIEWER: partial(photograph_viewer, bag),
            **{name: partial(photograph_tab, SHORT_BAG, *tab) for name, tab in TABS.items()},
            panel_picture.BOARD.name: photograph_panel,
            panel_picture.STATIC.name: photograph_static,
            BENCH: photograph_bench,
            panel_picture.LAB.name: photograph_lab,
        }
        for name, photograph in screenshots.items():
            try:
                photograph(folder / name)
                paths.append(folder / name)
            except CamRigError as error:
                console.print(f"{to / name}: not replaced ({error})", soft_wrap=True)
        for path in paths:
            with atomic_write(to / path.name) as part:
                part.write_bytes(path.read_bytes())
            console.print(f"{to / path.name}: {path.stat().st_size / 1e3:.0f} kB", soft_wrap=True)


def _read(bag: Path) -> tuple[TurnArchive, NoiseResult]:
    """Return the last turns of a bag, and its sound levels against speed."""
    with make_progress_bar() as bar:
        task = bar.add_task(bag.name, total=read_counts(bag).get(FOLLOWER_SAMPLES.name, 0))
        archive = read_turns(bag, lambda: bar.advance(task))
    loaded = archive.loaded
    levels = step_levels(read_recording(bag).ticks, loaded.scene.schedule.transient_turns.si)
    roles = {cam: loaded.level_origin(cam) for cam in levels}
    return archive, compare(levels, roles, loaded.published)


if __name__ == "__main__":
    typer.run(pictures)

"""Command ``cam-rig view``: display of a recorded run in the Rerun viewer."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from cam_rig.errors import ConfigError, printable
from cam_rig.show.command import LOG_PERIOD_S, SceneOfBag, command, make_progress_bar
from cam_rig.show.terminal import console, say
from cam_rig.viewer import Layout, ViewOptions

if TYPE_CHECKING:
    from cam_rig.viewer.page import PageTime


# Display of a live run: in a window, in a browser, or none.


@dataclass(frozen=True)
class Screen:
    """Display of a live run.

    Parameters
    ----------
    address : str, optional
        Address or folder to which the recording is sent. None if the run is not displayed.
    stay : callable
        Function that waits until the user closes the display.
    page : PageTime, optional
        Rig time that the browser displays. None without a browser.
    """

    address: str | None = None
    stay: Callable[[], None] = lambda: None
    page: PageTime | None = None


@contextmanager
def delay_report(
    page: PageTime | None, clock: Callable[[], float] = time.monotonic
) -> Iterator[Callable[[float, str], str]]:
    """Yield a function that appends the delay of the browser page to a status text.

    The delay is the wall-clock time by which the page is behind the run. The arguments of the
    function are the rig time (s) that the drive has reached, and the status text. It returns the
    text unchanged if `page` is None. The longest delay is printed when the context ends.
    """
    printed = clock()

    def with_delay(rig_time: float, status: str) -> str:
        nonlocal printed
        if page is None:
            return status
        page.record_drive(rig_time)
        delay, now = page.behind(), clock()
        status += "" if delay is None else f", viewer {delay:.1f} s behind"
        if not console.is_terminal and delay is not None and now - printed >= LOG_PERIOD_S:
            printed = now
            console.print(escape(status))
        return status

    try:
        yield with_delay
    finally:
        if page is not None and page.longest is not None:
            console.print(f"viewer at most {page.longest:.1f} s behind")


@contextmanager
def open_screen(view: bool, web: bool, wait_for_client: bool = False) -> Iterator[Screen]:
    """Open the requested display of a live run: a browser page or a window.

    `web` requests the page and `view` the window. If both are requested, only the page is opened.
    If `wait_for_client` is True, the context starts when a browser has opened the page. Raises
    ConfigError if it is True and no display is requested.
    """
    if wait_for_client and not (view or web):
        raise ConfigError("--wait-for-client requires a viewer; add --web or --view")
    if web:
        from cam_rig.viewer.rerun_page import serve

        with serve() as pages:
            print(pages.address, flush=True)
            console.print("open this address in a browser, now or after the run")
            if wait_for_client:
                pages.page.until_open()
            yield Screen(str(pages.folder), stay_until_interrupted, pages.page)
    elif view:
        from cam_rig.viewer.process import require_display, wait, window

        require_display()
        with window() as (process, address):
            yield Screen(address, lambda: wait(process))
    else:
        yield Screen()


def stay_until_interrupted() -> None:
    """Block until Ctrl-C, which ends the server."""
    console.print("Ctrl-C ends the viewer")
    Event().wait()


@command()
def view(
    bag: Annotated[
        Path | None, typer.Argument(help="Bag to show (default: the newest in bags/).")
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(metavar="FILE.rrd", help="Write a file instead of opening a viewer."),
    ] = None,
    web: Annotated[
        bool,
        typer.Option("--web", help="Serve the run to a browser on this machine."),
    ] = False,
    layout: Annotated[
        Layout, typer.Option(help="Whole run, cams side by side at one speed, or report.")
    ] = Layout.RUN,
    rpm: Annotated[
        float | None, typer.Option(help="Speed at which cams are compared (default: the highest).")
    ] = None,
    scene: SceneOfBag = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file.")] = False,
    no_decimation: Annotated[
        bool,
        typer.Option(
            "--no-decimation",
            help="Keep every sample of a long run, not only minimum and maximum of each bucket.",
        ),
    ] = False,
) -> None:
    """Show a recorded run: moving cam and follower, lift, contact force and sound.

    The viewer stays open until its window is closed, or until Ctrl-C. No data leave this machine.

    Examples
    --------
    cam-rig view

    cam-rig view bags/golden --web

    cam-rig view --layout compare --rpm 350

    cam-rig view bags/tm21_sweep_2026-01-31_12-00-00 --save out/sweep.rrd
    """
    from cam_rig.bag.command import newest_bag
    from cam_rig.schema.load import scene_path

    if save is not None and web:
        raise ConfigError("--save cannot be combined with --web")
    if save is None and force:
        raise ConfigError("--force requires --save")
    options = ViewOptions(layout, rpm, not no_decimation)
    scene_file = scene_path(scene) if scene else None
    if save is not None:
        convert(bag or newest_bag(), scene_file, save, options, force)
    else:
        _show(bag, scene_file, options, web)


def _show(bag: Path | None, scene: Path | None, options: ViewOptions, web: bool) -> None:
    from cam_rig.bag.command import newest_bag
    from cam_rig.files import temporary_folder
    from cam_rig.viewer.process import require_display, show

    if not web:
        require_display()
    path_of_bag = bag or newest_bag()
    with temporary_folder() as folder:
        path = folder / f"{path_of_bag.resolve().name}.rrd"
        begin = convert(path_of_bag, scene, path, options, force=False)
        if not web:
            return show(path)
        from cam_rig.viewer.rerun_page import serve_file

        with serve_file(path, begin) as address:
            print(address, flush=True)
            stay_until_interrupted()


def convert(
    bag: Path, scene: Path | None, path: Path, view_options: ViewOptions, force: bool
) -> float:
    """Write a bag as a Rerun recording, with a progress bar.

    `scene` is a file that replaces the scene attached to the bag, or None. `force` is True to
    overwrite `path`. Returns the rig time (s) at which playback starts.
    """
    from cam_rig.bag.reader import read_counts, scene_of, shortcomings
    from cam_rig.messages.topics import FOLLOWER_SAMPLES
    from cam_rig.viewer.recording import save_recording

    loaded = scene_of(bag, scene)
    ticks = read_counts(bag).get(FOLLOWER_SAMPLES.name, 0)
    say(*shortcomings(bag, loaded, ticks))
    with make_progress_bar() as bar:
        task = bar.add_task(printable(bag.name), total=ticks)
        begin = save_recording(
            bag,
            path,
            view_options,
            loaded=loaded,
            overwrite=force,
            on_tick=lambda: bar.advance(task),
        )
    say(f"{path}: {path.stat().st_size / 1e6:.1f} MB")
    return begin

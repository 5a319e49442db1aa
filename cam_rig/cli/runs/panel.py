"""cam-rig panel: the drawing board and the bench in a browser."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from cam_rig.cli.common.console import console, user_errors
from cam_rig.cli.common.names import cam_path, rig_path
from cam_rig.cli.common.options import Rig
from cam_rig.errors import CamRigError


def panel(
    cam: Annotated[str, typer.Argument(help="Cam file, or a name in config/cams.")] = "poly345",
    rig: Rig = "paper_table2",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port on this machine; 0 takes a free one.")
    ] = 0,
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Where cam files and bags go.")
    ] = Path("out"),
    lang: Annotated[
        str | None, typer.Option(help="Language of the pages, en or es; the browser's by default.")
    ] = None,
    no_rerun: Annotated[
        bool, typer.Option("--no-rerun", help="The bench without Rerun's picture of the rig.")
    ] = False,
    open_browser: Annotated[bool, typer.Option("--open", help="Open the browser.")] = False,
) -> None:
    """Turn the rig by hand in a browser, and draw the laws of its cams.

    Prints an address on this machine and serves it until Ctrl-C. On the drawing board the
    ordinates of a law are handles on its curve; s to s''', contact force, spectrum and jump speeds
    follow. The bench runs the nodes: knob, level meter, sound, readings, the rig in Rerun. The
    address has a token: no other page, user or machine gets anything.

    Examples
    --------
    cam-rig panel --open

    cam-rig panel bezier15 --rig tm21 --out cams
    """
    with user_errors(), _ended_alike():
        from cam_rig.extras import require
        from cam_rig.panel.board.board import Board
        from cam_rig.schema import load_cam, load_rig

        for library in ("starlette", "uvicorn", "websockets"):
            require(library)
        from cam_rig.panel.bench.pages import BenchPages
        from cam_rig.panel.bench.runner import BenchRunner
        from cam_rig.panel.board.pages import BoardPages
        from cam_rig.panel.server import serve
        from cam_rig.runner.user_folder import user_folder

        first, own = load_cam(cam_path(cam)), load_rig(rig_path(rig))
        with TemporaryDirectory(prefix="cam_rig-panel-", dir=user_folder()) as folder:
            runner = BenchRunner(own, Path(folder), out, not no_rerun)
            board = Board(first, own, out, rig)
            pages = BoardPages(board), BenchPages(runner, first, board)
            with serve(*pages, port=port, language=lang) as served:
                print(served.address, flush=True)
                console.print("Ctrl-C ends the panel")
                if open_browser:
                    import webbrowser

                    webbrowser.open(served.address)
                runner.run(served.alive)
        raise CamRigError("the panel's server ended")


@contextmanager
def _ended_alike() -> Iterator[None]:
    """Any signal to end unwinds as Ctrl-C does, so that no process stays."""
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = [signal.signal(number, signal.default_int_handler) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)

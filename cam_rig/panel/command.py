"""Command ``cam-rig panel``: drawing board and bench in a browser."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.errors import CamRigError, ConfigError
from cam_rig.show.command import RigOfCam, command
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.panel.lab.command import ClassRoom


#: Name of the default cam of board and bench.
DEFAULT_CAM = "poly345"
#: Default folder for cam files, bags and sheets.
DEFAULT_OUT = Path("out")
#: Largest length of the path of a Unix socket, bytes, see unix(7).
MAX_SOCKET_PATH_BYTES = 107

#: HTML page that redirects a browser to an address.
REDIRECT = """<!doctype html>
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}">
<title>cam_rig</title>
<a href="{address}">cam-rig panel</a>
"""

OneCam = Annotated[str, typer.Argument(help="Cam file, or a name in config/cams.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port on this machine (0: a free one).")]
Out = Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for cam files, bags and sheets.")]
Lang = Annotated[
    str | None, typer.Option(help="Language of the pages, en or es (default: the browser's).")
]
NoRerun = Annotated[bool, typer.Option("--no-rerun", help="Disable recording in Rerun.")]
Export = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Folder for a static drawing board, without a server."),
]
Open = Annotated[bool, typer.Option("--open", help="Open the browser.")]


@command()
def panel(
    cam: OneCam = DEFAULT_CAM,
    rig: RigOfCam = None,
    port: Port = 0,
    out: Out = DEFAULT_OUT,
    lang: Lang = None,
    no_rerun: NoRerun = False,
    open_browser: Open = False,
    export: Export = None,
) -> None:
    """Turn the rig by hand in a browser, and draw the laws of its cams.

    The command prints an address on this machine and serves it until Ctrl-C. On the drawing board
    the ordinates of a law are handles on its curve. The curves s to s''', force, torque, spectrum
    and the jump speeds follow each change. Other cams and rigs are chosen on the page. The bench
    runs the nodes, with a speed knob, the moving rig, a level meter, sound and readings. The
    address contains a token. Without it no page, user or machine has access to the pages or to
    Rerun's. ROS programs on this machine can reach the nodes of the bench, as those of every run.
    `cam-rig lab` serves lab sheets.

    With --export the command writes a static drawing board instead and ends. It is one HTML file
    that a browser opens without a server.

    Examples
    --------
    cam-rig panel --open

    cam-rig panel bezier15 --rig tm21 --out cams

    cam-rig panel --export out/board
    """
    if export is not None:
        served_only = {
            "--port": port,
            "--no-rerun": no_rerun,
            "--open": open_browser,
            "--out": out != DEFAULT_OUT,
        }
        for name in (name for name, value in served_only.items() if value):
            raise ConfigError(f"--export cannot be combined with {name}")
        write_static_board(cam, rig, export, lang)
        return
    serve_panel([cam], rig, port, out, not no_rerun, open_browser, None, lang)


def _require_libraries() -> None:
    from cam_rig.extras import require

    for library in ("starlette", "uvicorn", "websockets"):
        require(library)


def write_static_board(cam: str, rig: str | None, folder: Path, language: str | None) -> None:
    """Write the static drawing board into a folder, and print its path and its size."""
    _require_libraries()
    from cam_rig.panel.board.board import Board
    from cam_rig.panel.export.page import export_board
    from cam_rig.schema.load import cam_path
    from cam_rig.simulation.inputs import default_rig, resolve_cam, resolve_rig

    rig_config = resolve_rig(rig or str(default_rig([cam_path(cam)])), cam)
    path = export_board(folder, Board(resolve_cam(cam), rig_config, folder), language)
    print(path)
    say(f"{path.stat().st_size / 1e3:.0f} kB; a browser opens it without a server")


def serve_panel(
    cams: list[str],
    rig: str | None,
    port: int,
    out: Path,
    rerun: bool,
    open_browser: bool,
    room: ClassRoom | None,
    lang: str | None,
) -> None:
    """Serve board, bench and the lab sheets of a class until Ctrl-C.

    With an address of the network, only the lab sheets are served.
    """
    from cam_rig.files import temporary_folder
    from cam_rig.panel.board.board import Board
    from cam_rig.schema.load import cam_path
    from cam_rig.simulation.inputs import default_rig, resolve_cam, resolve_rig

    _require_libraries()
    from cam_rig.live.sockets import LOOPBACK
    from cam_rig.panel.bench.pages import BenchPages
    from cam_rig.panel.bench.runner import BenchRunner
    from cam_rig.panel.board.pages import BoardPages
    from cam_rig.panel.server import PanelPages, serve
    from cam_rig.runner.resources import user_folder

    cam_configs = [resolve_cam(cam) for cam in cams]
    chosen = rig or str(default_rig([cam_path(cam) for cam in cams]))
    rig_config = resolve_rig(chosen, *cams)
    first = cam_configs[0]
    with temporary_folder("cam_rig-panel-", user_folder()) as folder:
        runner = BenchRunner(rig_config, folder, out, rerun)
        if (size := len(os.fsencode(runner.socket))) > MAX_SOCKET_PATH_BYTES:
            raise ConfigError(
                f"{runner.socket}: socket path of {size} bytes; allowed: {MAX_SOCKET_PATH_BYTES}; "
                "remedy: a shorter XDG_RUNTIME_DIR or TMPDIR"
            )
        board = Board(first, rig_config, out, rig or rig_config.name)
        sheets = room.pages(cam_configs, rig_config, out) if room else {}
        host = room.host if room else None
        pages: list[PanelPages] = [*sheets.values()]
        if host is None:  # board and bench are served only to this machine
            pages += [BoardPages(board), BenchPages(runner, first, board)]
        home = next(iter(sheets), "/")
        with serve(*pages, port=port, language=lang, home=home, host=host or LOOPBACK) as served:
            if len(sheets) > 1:
                for path in sheets:
                    group = path.rpartition("/")[2]
                    print(f"{group}: {served.access.address(path)}", flush=True)
            else:
                print(served.address, flush=True)
            say("Ctrl-C ends the panel")
            if open_browser:
                _open_browser(served.address, folder)
            runner.run(served.alive)
    raise CamRigError("the server of the panel has ended")


def _open_browser(address: str, folder: Path) -> None:
    """Open the browser with a file that only this user can read.

    The file hides the token, because every user can read the arguments of a process.
    """
    import webbrowser

    page = folder / "panel.html"
    page.touch(mode=0o600)
    page.write_text(REDIRECT.format(address=address), encoding="utf-8")
    webbrowser.open(page.as_uri())

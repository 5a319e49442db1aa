"""Command ``cam-rig panel``: drawing board, bench and lab sheets in a browser."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple, TypeVar

import typer

from cam_rig.errors import CamRigError, ConfigError
from cam_rig.show.command import RigOfCam, command
from cam_rig.show.result import Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.panel.lab.marking import MarksResult
    from cam_rig.panel.lab.pages import LabPages
    from cam_rig.schema import CamConfig, RigConfig


File = TypeVar("File", "CamConfig", "RigConfig")

# The marks of lab sheets: cam-rig panel --grade.


def mark_sheets(
    sheets: list[Path], cams: list[str], rig: str | None, tolerance: float | None
) -> MarksResult:
    """Return the marks of lab sheets.

    Parameters
    ----------
    sheets : list of Path
        Files of the sheets.
    cams : list of str
        Cam files or names. By default, shipped cams of the names on the sheets are used.
    rig : str or None
        Rig file or name. By default, a shipped rig of the name on each sheet is used.
    tolerance : float or None
        Tolerance of the answers in %, or None for that of each lab.

    Returns
    -------
    MarksResult
        The marks of all sheets.

    Raises
    ------
    ConfigError
        If no sheet is given, if a file is not a lab sheet, or if cam or rig has another name.
    """
    from cam_rig.panel.lab.marking import MarksResult, mark_sheet
    from cam_rig.schema import load_cam, load_rig
    from cam_rig.schema.load import cam_path, rig_path

    if not sheets:
        raise ConfigError("--grade requires a sheet: a .csv file of cam-rig panel --lab")
    custom_cams = [load_cam(cam_path(cam)) for cam in cams]

    def cam_of(name: str) -> CamConfig:
        default = custom_cams[0] if custom_cams else None
        custom = next((cam for cam in custom_cams if cam.name == name), default)
        return _load_named("cam", name, lambda: custom or load_cam(cam_path(name)))

    def rig_of(name: str) -> RigConfig:
        return _load_named("rig", name, lambda: load_rig(rig_path(rig or name)))

    return MarksResult(tuple(mark_sheet(path, tolerance, cam_of, rig_of) for path in sheets))


def _load_named(kind: str, name: str, load: Callable[[], File]) -> File:
    """Load a cam or rig and check that it has the name on the sheet.

    The name on a sheet must not be a path.
    """
    from cam_rig.files import shorten
    from cam_rig.schema.load import NAME

    if not NAME.fullmatch(name):
        raise ConfigError(f"{kind} is {shorten(name)}; allowed: a name of a {kind} file")
    if (config := load()).name != name:
        remedy = "use --rig FILE" if kind == "rig" else "name the cam's file"
        raise ConfigError(f"the sheet names {kind} {name!r}, not {config.name!r}; {remedy}")
    return config


#: Name of the default cam of board and bench.
DEFAULT_CAM = "poly345"
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

Names = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="CAM|SHEETS",
        help=f"Cam file, or a name in config/cams, by default {DEFAULT_CAM}; two for --lab noise; "
        "with --grade also lab sheets, which end in .csv.",
    ),
]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port on this machine (0: a free one).")]
Out = Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for cam files, bags and sheets.")]
Lang = Annotated[
    str | None, typer.Option(help="Language of the pages, en or es (default: the browser's).")
]
NoRerun = Annotated[bool, typer.Option("--no-rerun", help="Disable recording in Rerun.")]
Open = Annotated[bool, typer.Option("--open", help="Open the browser.")]
LabName = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="A lab sheet for a student: jump, vibration or noise."),
]
Seeds = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="With --lab: hide the rig's numbers. Repeat it for a class with one page per seed.",
    ),
]
Host = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="With --lab: serve only the lab, on this address of the network.",
    ),
]
ToMark = Annotated[bool, typer.Option("--grade", help="Mark lab sheets instead of serving pages.")]
Tolerance = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        min=0.0,
        max=100.0,
        help="With --grade: tolerance of an answer (default: that of the lab, 1, or 2 for noise).",
    ),
]


@command("json", "csv", "plot")
def panel(
    names: Names = None,
    rig: RigOfCam = None,
    port: Port = 0,
    out: Out = Path("out"),
    lang: Lang = None,
    no_rerun: NoRerun = False,
    open_browser: Open = False,
    lab: LabName = None,
    seed: Seeds = None,
    host: Host = None,
    mark: ToMark = False,
    tolerance: Tolerance = None,
    *,
    json: str | None,
    csv: Path | None,
    plot: Path | None,
) -> Result | None:
    """Turn the rig by hand in a browser, and draw the laws of its cams.

    The command prints an address on this machine and serves it until Ctrl-C. On the drawing board
    the ordinates of a law are handles on its curve. The curves s to s''', the contact force, the
    spectrum and the jump speeds follow each change. The bench runs the nodes, with a speed knob,
    the moving rig, a level meter, sound and readings. The address contains a token. Without it no
    page, user or machine has access to the pages or to Rerun's. ROS programs on this machine can
    reach the nodes of the bench, as those of every run.

    A lab sheet saves a student's readings and answers as CSV. Its question is the jump speed of
    springs, masses and preloads, the natural frequency of the stem, or the speed at which two cams
    are equally loud. A seed replaces the rig by one with hidden numbers. The marks are the
    differences between the answers and the true values.

    Examples
    --------
    cam-rig panel --open

    cam-rig panel bezier15 --rig tm21 --out cams

    cam-rig panel --lab jump --rig tm21 --seed group-3 --out sheets

    cam-rig panel --lab vibration --seed group-1 --seed group-2 --host 192.168.1.20 --out sheets

    cam-rig panel poly345 arcs_convex --lab noise --rig tm21

    cam-rig panel --grade sheets/lab_jump_group-3.csv --json -

    cam-rig panel --grade sheets/one.csv sheets/two.csv --plot class.png
    """
    sheets = [name for name in names or [] if mark and name.endswith(".csv")]
    cams = [name for name in names or [] if name not in sheets]
    has_mark_options = any(value is not None for value in (tolerance, json, csv, plot))
    _require_compatible(cams, lab, seed or host, mark, open_browser, has_mark_options)
    if mark:
        return mark_sheets([*map(Path, sheets)], cams, rig, tolerance)
    room = ClassRoom(lab, tuple(seed or ()), host) if lab else None
    _serve(cams or [DEFAULT_CAM], rig, port, out, not no_rerun, open_browser, room, lang)
    return None


class ClassRoom(NamedTuple):
    """Class of students: its lab, the seeds of its groups, and the server's address."""

    lab: str
    seeds: tuple[str, ...]
    host: str | None

    def pages(self, cams: list[CamConfig], rig: RigConfig, out: Path) -> dict[str, LabPages]:
        """Return the lab pages by URL path, one entry per group of students.

        Each group has one seed, and its path is `LAB`/seed. With fewer than two seeds, the only
        path is `LAB`. Raises ConfigError if a seed is repeated.
        """
        from cam_rig.panel.lab.labs import lab_sheet
        from cam_rig.panel.lab.pages import LAB, LabPages

        if len(self.seeds) < 2:
            sheet = lab_sheet(self.lab, cams, rig, next(iter(self.seeds), None))
            return {LAB: LabPages(sheet, out)}
        pages: dict[str, LabPages] = {}
        for seed in self.seeds:
            if (path := f"{LAB}/{seed}") in pages:
                raise ConfigError(f"--seed: {seed} is repeated; allowed: one seed per group")
            pages[path] = LabPages(lab_sheet(self.lab, cams, rig, seed), out, path, resumes=True)
        return pages


def _require_compatible(
    cams: list[str],
    lab: str | None,
    lab_options: list[str] | str | None,
    mark: bool,
    open_browser: bool,
    has_mark_options: bool,
) -> None:
    if len(cams) > 1 and not (mark or lab):  # a lab checks the number of its cams itself
        raise ConfigError(f"cam: is {' '.join(cams)}; allowed: one cam")
    if lab_options and lab is None:
        raise ConfigError("--seed and --host require --lab")
    if mark and (lab is not None or open_browser):
        raise ConfigError("--grade cannot be combined with --lab, --seed or --open")
    if has_mark_options and not mark:
        raise ConfigError("--tolerance, --json, --csv and --plot require --grade")


def _serve(
    cams: list[str],
    rig: str | None,
    port: int,
    out: Path,
    rerun: bool,
    open_browser: bool,
    room: ClassRoom | None,
    lang: str | None,
) -> None:
    from cam_rig.dynamics.events.backend import expect_many
    from cam_rig.extras import require
    from cam_rig.files import temporary_folder
    from cam_rig.panel.board.board import Board
    from cam_rig.schema.load import cam_path
    from cam_rig.simulation.inputs import default_rig, resolve_cam, resolve_rig

    for library in ("starlette", "uvicorn", "websockets"):
        require(library)
    from cam_rig.live.sockets import LOOPBACK
    from cam_rig.panel.bench.pages import BenchPages
    from cam_rig.panel.bench.runner import BenchRunner
    from cam_rig.panel.board.pages import BoardPages
    from cam_rig.panel.server import PanelPages, serve
    from cam_rig.runner.resources import user_folder

    expect_many()
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

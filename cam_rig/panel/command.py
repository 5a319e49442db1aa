"""cam-rig panel: drawing board, bench and lab sheet in a browser."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple, TypeVar

import typer

from cam_rig.errors import CamRigError, ConfigError
from cam_rig.show.command import command
from cam_rig.show.result import Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.panel.lab.marking import MarksResult
    from cam_rig.panel.lab.pages import LabPages
    from cam_rig.schema import CamConfig, RigConfig


File = TypeVar("File", "CamConfig", "RigConfig")

# cam-rig panel --mark: the marks of lab sheets.


def mark_sheets(
    sheets: list[Path], cams: list[str], rig: str | None, tolerance: float | None
) -> MarksResult:
    """Mark lab sheets of cams and a rig, by default shipped ones of the names on the sheets."""
    from cam_rig.panel.lab.marking import MarksResult, mark_sheet
    from cam_rig.schema import load_cam, load_rig
    from cam_rig.schema.load import cam_path, rig_path

    if not sheets:
        raise ConfigError("--mark: no sheet is named; allowed: .csv files of cam-rig panel --lab")
    own = [load_cam(cam_path(cam)) for cam in cams]

    def cam_of(name: str) -> CamConfig:
        named = next((cam for cam in own if cam.name == name), own[0] if own else None)
        return _of_name("cam", name, lambda: named or load_cam(cam_path(name)))

    def rig_of(name: str) -> RigConfig:
        return _of_name("rig", name, lambda: load_rig(rig_path(rig or name)))

    return MarksResult(tuple(mark_sheet(path, tolerance, cam_of, rig_of) for path in sheets))


def _of_name(kind: str, name: str, load: Callable[[], File]) -> File:
    """What is loaded, if it has the name that a sheet says, which is no path to somewhere."""
    from cam_rig.files import shown
    from cam_rig.schema.load import NAME

    if not NAME.fullmatch(name):
        raise ConfigError(f"{kind} is {shown(name)}; allowed: a name as {kind} files have it")
    if (found := load()).name != name:
        option = "--rig FILE" if kind == "rig" else "the cam's file"
        words = f"is of {kind} {name!r}, marked with {found.name!r}"
        raise ConfigError(f"{words}; allowed: the same, so name {option}")
    return found


#: What is drawn and turned if nothing else is named.
CAM, RIG = "poly345", "paper_table2"

#: Bytes of a Unix socket's path, at most (unix(7)).
LONGEST = 107

#: A page that leads to an address.
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
        help=f"Cam file, or a name in config/cams, by default {CAM}; two for --lab noise; with "
        "--mark lab sheets, files that end in .csv.",
    ),
]
RigOfPanel = Annotated[
    str | None, typer.Option(help=f"Rig file, or a name in config/rigs; by default {RIG}.")
]
Port = Annotated[
    int, typer.Option(min=0, max=65535, help="Port on this machine; 0 takes a free one.")
]
Out = Annotated[Path, typer.Option(metavar="FOLDER", help="Where cam files, bags and sheets go.")]
Lang = Annotated[
    str | None, typer.Option(help="Language of the pages, en or es; the browser's by default.")
]
NoRerun = Annotated[bool, typer.Option("--no-rerun", help="The bench without Record in Rerun.")]
Open = Annotated[bool, typer.Option("--open", help="Open the browser.")]
LabName = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="A lab sheet for a student: jump, vibration or noise."),
]
Seeds = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="With --lab: measure a rig of hidden numbers; several are a class, a page each.",
    ),
]
Host = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="With --lab: serve the lab alone, on this address, to the machines that reach it.",
    ),
]
ToMark = Annotated[bool, typer.Option("--mark", help="Mark lab sheets instead.")]
Tolerance = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        min=0.0,
        max=100.0,
        help="With --mark: what an answer may be off; by default the lab's, 1, of noise 2.",
    ),
]


@command("json", "csv", "plot")
def panel(
    names: Names = None,
    rig: RigOfPanel = None,
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

    Prints an address on this machine and serves it until Ctrl-C. On the drawing board the
    ordinates of a law are handles on its curve; s to s''', contact force, spectrum and jump speeds
    follow. The bench runs the nodes: knob, the rig as it moves, level meter, sound, readings. The
    address has a token: without it no page, user or machine gets anything of the pages, Rerun's
    among them. The bench's nodes are open to ROS on this machine, as those of every run.

    A lab sheet keeps a student's readings and answers as CSV. It asks for jump speeds of springs,
    masses and preloads, the natural frequency of the stem, or the speed at which two cams are
    equally loud. A seed hides another rig behind it; the marks say how far an answer is off.

    Examples
    --------
    cam-rig panel --open

    cam-rig panel bezier15 --rig tm21 --out cams

    cam-rig panel --lab jump --rig tm21 --seed group-3 --out sheets

    cam-rig panel --lab vibration --seed group-1 --seed group-2 --host 192.168.1.20 --out sheets

    cam-rig panel poly345 arcs_convex --lab noise --rig tm21

    cam-rig panel --mark sheets/lab_jump_group-3.csv --json -

    cam-rig panel --mark sheets/one.csv sheets/two.csv --plot class.png
    """
    sheets = [name for name in names or [] if mark and name.endswith(".csv")]
    cams = [name for name in names or [] if name not in sheets]
    for_marks = any(given is not None for given in (tolerance, json, csv, plot))
    _require_together(cams, lab, seed or host, mark, open_browser, for_marks)
    if mark:
        return mark_sheets([*map(Path, sheets)], cams, rig, tolerance)
    room = ClassRoom(lab, tuple(seed or ()), host) if lab else None
    _serve(cams or [CAM], rig or RIG, port, out, not no_rerun, open_browser, room, lang)
    return None


class ClassRoom(NamedTuple):
    """A lab, the seeds of its groups, and the address that it is served on."""

    lab: str
    seeds: tuple[str, ...]
    host: str | None

    def pages(self, cams: list[CamConfig], rig: RigConfig, out: Path) -> dict[str, LabPages]:
        """The sheet of each group, by its place; without groups, or of one, the only one."""
        from cam_rig.panel.lab.labs import lab_sheet
        from cam_rig.panel.lab.pages import LAB, LabPages

        if len(self.seeds) < 2:
            sheet = lab_sheet(self.lab, cams, rig, next(iter(self.seeds), None))
            return {LAB: LabPages(sheet, out)}
        found: dict[str, LabPages] = {}
        for seed in self.seeds:
            if (place := f"{LAB}/{seed}") in found:
                raise ConfigError(f"--seed: {seed} is named twice; allowed: a name a group")
            found[place] = LabPages(lab_sheet(self.lab, cams, rig, seed), out, place, goes_on=True)
        return found


def _require_together(
    cams: list[str],
    lab: str | None,
    of_lab: list[str] | str | None,
    mark: bool,
    open_browser: bool,
    for_marks: bool,
) -> None:
    if len(cams) > 1 and not (mark or lab):  # which of them a lab compares, it says itself
        raise ConfigError(f"cam: is {' '.join(cams)}; allowed: one cam")
    if of_lab and lab is None:
        raise ConfigError("--seed, --host: are of a lab sheet; allowed: with --lab")
    if mark and (lab is not None or open_browser):
        raise ConfigError("--mark serves no page; allowed: without --lab, --seed and --open")
    if for_marks and not mark:
        raise ConfigError("--tolerance, --json, --csv, --plot: are of marks; allowed: with --mark")


def _serve(
    cams: list[str],
    rig: str,
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
    from cam_rig.schema import load_cam, load_rig
    from cam_rig.schema.load import cam_path, rig_path

    for library in ("starlette", "uvicorn", "websockets"):
        require(library)
    from cam_rig.live.sockets import LOOPBACK
    from cam_rig.panel.bench.pages import BenchPages
    from cam_rig.panel.bench.runner import BenchRunner
    from cam_rig.panel.board.pages import BoardPages
    from cam_rig.panel.server import PanelPages, serve
    from cam_rig.runner.resources import user_folder

    expect_many()
    named, own = [load_cam(cam_path(cam)) for cam in cams], load_rig(rig_path(rig))
    first = named[0]
    with temporary_folder("cam_rig-panel-", user_folder()) as folder:
        runner = BenchRunner(own, folder, out, rerun)
        if (size := len(os.fsencode(runner.socket))) > LONGEST:
            raise ConfigError(
                f"{runner.socket}: a socket's path of {size} bytes; allowed: {LONGEST}; remedy: a "
                "shorter XDG_RUNTIME_DIR or TMPDIR"
            )
        board = Board(first, own, out, rig)
        sheets = room.pages(named, own, out) if room else {}
        host = room.host if room else None
        pages: list[PanelPages] = [*sheets.values()]
        if host is None:  # board and bench are for who sits at this machine
            pages += [BoardPages(board), BenchPages(runner, first, board)]
        home = next(iter(sheets), "/")
        with serve(*pages, port=port, language=lang, home=home, host=host or LOOPBACK) as served:
            if len(sheets) > 1:
                for place in sheets:
                    group = place.rpartition("/")[2]
                    print(f"{group}: {served.access.address(place)}", flush=True)
            else:
                print(served.address, flush=True)
            say("Ctrl-C ends the panel")
            if open_browser:
                _open(served.address, folder)
            runner.run(served.alive)
    raise CamRigError("the panel's server ended")


def _open(address: str, folder: Path) -> None:
    """Open the browser by a file of this user's alone: every user sees a process's arguments."""
    import webbrowser

    page = folder / "panel.html"
    page.touch(mode=0o600)
    page.write_text(REDIRECT.format(address=address), encoding="utf-8")
    webbrowser.open(page.as_uri())

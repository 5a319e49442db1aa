"""Commands ``cam-rig lab`` and ``cam-rig mark``: lab sheets in a browser, and their marks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple, TypeVar

import typer

from cam_rig.errors import ConfigError
from cam_rig.panel.command import DEFAULT_CAM, Lang, NoRerun, Open, Out, Port, serve_panel
from cam_rig.show.command import RigOfCam, command
from cam_rig.show.result import Result

if TYPE_CHECKING:
    from cam_rig.panel.lab.marking import MarksResult
    from cam_rig.panel.lab.pages import LabPages
    from cam_rig.schema import CamConfig, RigConfig


File = TypeVar("File", "CamConfig", "RigConfig")

LabName = Annotated[
    str, typer.Argument(metavar="LAB", help="Lab sheet for a student: jump, vibration or noise.")
]
Cams = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="CAM",
        help=f"Cam file, or a name in config/cams, by default {DEFAULT_CAM}; two for noise.",
    ),
]
Seeds = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="Hide the rig's numbers. Repeat it for a class with one page per seed.",
    ),
]
Host = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Serve only the lab, on this address of the network."),
]


@command()
def lab(
    lab: LabName,
    cams: Cams = None,
    rig: RigOfCam = None,
    seed: Seeds = None,
    host: Host = None,
    port: Port = 0,
    out: Out = Path("out"),
    lang: Lang = None,
    no_rerun: NoRerun = False,
    open_browser: Open = False,
) -> None:
    """Serve a lab sheet to a student or a class in a browser.

    A sheet saves a student's readings and answers as CSV. Its question is the jump speed of
    springs, masses and preloads, the natural frequency of the stem, or the speed at which two cams
    are equally loud. A seed replaces the rig by one with hidden numbers. A restarted server
    continues the files of its seeds. `cam-rig mark` compares the answers with the true values.

    Examples
    --------
    cam-rig lab jump --rig tm21 --open

    cam-rig lab jump --rig tm21 --seed group-3 --out sheets

    cam-rig lab vibration --seed group-1 --seed group-2 --host 192.168.1.20 --out sheets

    cam-rig lab noise poly345 arcs_convex --rig tm21
    """
    room = ClassRoom(lab, tuple(seed or ()), host)
    serve_panel(cams or [DEFAULT_CAM], rig, port, out, not no_rerun, open_browser, room, lang)


class ClassRoom(NamedTuple):
    """Class of students: its lab, the seeds of its groups, and the server's address."""

    lab: str
    seeds: tuple[str, ...]
    host: str | None

    def pages(self, cams: list[CamConfig], rig: RigConfig, out: Path) -> dict[str, LabPages]:
        """Return the lab pages by URL path, one entry per group of students.

        Each group has one seed, and its path is `LAB`/seed. With fewer than two seeds, the only
        path is `LAB`. A sheet with a seed continues its file. Raises ConfigError if a seed is
        repeated.
        """
        from cam_rig.panel.lab.labs import lab_sheet
        from cam_rig.panel.lab.pages import LAB, LabPages

        if len(self.seeds) < 2:
            sheet = lab_sheet(self.lab, cams, rig, next(iter(self.seeds), None))
            return {LAB: LabPages(sheet, out, resumes=bool(self.seeds))}
        pages: dict[str, LabPages] = {}
        for seed in self.seeds:
            if (path := f"{LAB}/{seed}") in pages:
                raise ConfigError(f"--seed: {seed} is repeated; allowed: one seed per group")
            pages[path] = LabPages(lab_sheet(self.lab, cams, rig, seed), out, path, resumes=True)
        return pages


Sheets = Annotated[list[Path], typer.Argument(help="Lab sheets, the .csv files of cam-rig lab.")]
CamsOfSheets = Annotated[
    list[str] | None,
    typer.Option("--cam", help="File of a user-defined cam of the sheets. It may be repeated."),
]
RigOfSheets = Annotated[
    str | None,
    typer.Option("--rig", help="Rig file (default: a shipped rig of the name on each sheet)."),
]
Tolerance = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        min=0.0,
        max=100.0,
        help="Tolerance of an answer (default: that of the lab, 1, or 2 for noise).",
    ),
]


@command("json", "csv", "plot")
def mark(
    sheets: Sheets,
    cam: CamsOfSheets = None,
    rig: RigOfSheets = None,
    tolerance: Tolerance = None,
) -> Result:
    """Mark lab sheets: the differences between the answers and the true values.

    True values are computed from the numbers of the rig, which a seed on the sheet may have hidden
    from the student.

    Examples
    --------
    cam-rig mark sheets/lab_jump_group-3.csv --json -

    cam-rig mark sheets/one.csv sheets/two.csv --plot class.png

    cam-rig mark sheet.csv --cam mine/cams/lug.yaml --rig mine/rigs/bench.yaml
    """
    return mark_sheets(sheets, cam or [], rig, tolerance)


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
        raise ConfigError("sheets: is an empty list; allowed: .csv files of cam-rig lab")
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

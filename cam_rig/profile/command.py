"""cam-rig profile: the cam's shape, checked, drawn, measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.show.command import command
from cam_rig.show.result import Result

if TYPE_CHECKING:
    from cam_rig.profile.check_table import CheckedCam


Cams = Annotated[
    list[str] | None,
    typer.Argument(help="Cam files, or names in config/cams; or one scene: its cams."),
]
Every = Annotated[bool, typer.Option("--all", help="Check every cam of config/cams.")]
Out = Annotated[
    Path | None, typer.Option(help="Write the contour: .dxf, .svg or .csv (lengths in mm).")
]
Positions = Annotated[
    int | None,
    typer.Option(
        min=3, max=720, help="Positions of the follower around the cam in --plot; else 24."
    ),
]
Pitch = Annotated[
    bool, typer.Option("--pitch", help="Write the pitch curve instead of the contour.")
]
Cutter = Annotated[
    float | None,
    typer.Option(metavar="MM", help="Write the path of a cutter of this radius instead."),
]
Tolerance = Annotated[float, typer.Option(metavar="UM", help="Chord error of DXF and SVG, in µm.")]
Points = Annotated[
    int, typer.Option(min=36, max=1_000_000, help="Rows of a CSV file, over one turn.")
]
Source = Annotated[
    Path | None,
    typer.Option("--from", help="Measure this contour (.csv, .dxf) with the cam's follower."),
]
Force = Annotated[bool, typer.Option("--force", help="Draw a cam even though it cannot exist.")]


@command("json", "csv", "plot")
def profile(
    cams: Cams = None,
    every: Every = False,
    out: Out = None,
    positions: Positions = None,
    pitch: Pitch = False,
    cutter: Cutter = None,
    tolerance: Tolerance = 1.0,
    points: Points = 3600,
    source: Source = None,
    force: Force = False,
    *,
    plot: Path | None,
) -> Result:
    """Check a cam's contour: undercut, curvature, pressure angle, reach. Draw it, or measure one.

    The code is 1 when a check fails; with --all a cam does not count whose file says that it
    cannot_be_made, and why. With --from the cam's follower is put on the contour of a
    file and read at every angle; --out then writes that law as CSV. --positions are those of the
    graphical method: the follower's places around the standing cam.

    Examples
    --------
    cam-rig profile --all

    cam-rig profile quick

    cam-rig profile oscillating_roller --plot out/cam.png

    cam-rig profile point --plot out/point.png --positions 10

    cam-rig profile conjugate --out out/conjugate.dxf --tolerance 0.5

    cam-rig profile poly345 --cutter 6 --out out/cutter.csv

    cam-rig profile poly345 --from out/cam.dxf --out out/law.csv
    """
    from cam_rig.errors import ConfigError, ProfileError
    from cam_rig.profile import command_files
    from cam_rig.profile.check_table import POSITIONS, ProfileResult

    if positions is not None and plot is None:
        raise ConfigError("--positions: are of the picture; needed: --plot PATH")
    request = command_files.Request(out, pitch, cutter, tolerance, points, source)
    cams_checked = _checked(_paths(cams or [], every))
    request.require(len(cams_checked), drawing=plot is not None)
    first, drawn = cams_checked[0], out is not None or plot is not None
    if source is not None:
        return command_files.measure(request, first.cam, first.law)
    for check in first.failed if drawn and not force else ():
        if check.vital:
            raise ProfileError(f"{first.cam.name}: {check}; or draw it with --force")
    if out is not None:
        command_files.write(request, first.cam, first.law, force)
    return ProfileResult(tuple(cams_checked), positions or POSITIONS, drawn, every)


def _paths(cams: list[str], every: bool) -> list[Path]:
    from cam_rig.errors import ConfigError
    from cam_rig.schema import load

    if (scene := load.one_scene(cams)) is not None:
        path = load.scene_path(scene)
        library = load.Library.beside(path)
        paths = [library.path("cams", name) for name in load.load_scene(path).cams]
    else:
        paths = [load.cam_path(cam) for cam in cams]
    if every:
        paths += sorted((load.config_root() / "cams").glob("*.yaml"))
    if not paths:
        raise ConfigError("no cam is named; allowed: cam files, names in config/cams, or --all")
    return paths


def _checked(paths: list[Path]) -> list[CheckedCam]:
    from cam_rig.errors import LawError, ProfileError
    from cam_rig.laws import build_law
    from cam_rig.profile.check_table import CheckedCam
    from cam_rig.schema import load_cam

    found = []
    for path in paths:
        cam = load_cam(path)
        try:
            found.append(CheckedCam.of(cam, build_law(cam)))
        except (LawError, ProfileError) as error:
            raise type(error)(f"{path}: {error}") from None
    return found

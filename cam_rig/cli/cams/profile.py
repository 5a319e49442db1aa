"""cam-rig profile: the cam's shape, checked, drawn, measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import user_errors
from cam_rig.cli.common.names import cam_path
from cam_rig.cli.common.options import Json
from cam_rig.cli.common.outputs import check_outputs, write_json, write_plot

if TYPE_CHECKING:
    from cam_rig.cli.cams.profile_files import Request
    from cam_rig.laws import Law
    from cam_rig.profile.checks.check import Check
    from cam_rig.schema import CamConfig

    Found = list[tuple[CamConfig, Law, list[Check]]]


Cams = Annotated[list[str] | None, typer.Argument(help="Cam files, or names in config/cams.")]
Every = Annotated[bool, typer.Option("--all", help="Check every cam of config/cams.")]
Out = Annotated[
    Path | None, typer.Option(help="Write the contour: .dxf, .svg or .csv (lengths in mm).")
]
Plot = Annotated[Path | None, typer.Option(help="Draw the cam (PNG, SVG, PDF).")]
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


def profile(
    cams: Cams = None,
    every: Every = False,
    out: Out = None,
    plot: Plot = None,
    positions: Positions = None,
    pitch: Pitch = False,
    cutter: Cutter = None,
    tolerance: Tolerance = 1.0,
    points: Points = 3600,
    source: Source = None,
    force: Force = False,
    json_target: Json = None,
) -> None:
    """Check a cam's contour: undercut, curvature, pressure angle, reach. Draw it, or measure one.

    The code is 1 when a check fails; with --all a cam does not count whose file says that it
    cannot_be_made, and why. With --from the cam's follower is put on the contour of a
    file and read at every angle; --out then writes that law as CSV. --positions are those of the
    graphical method: the follower's places around the standing cam.

    Examples
    --------
    cam-rig profile --all

    cam-rig profile oscillating_roller --plot out/cam.png

    cam-rig profile point --plot out/point.png --positions 10

    cam-rig profile conjugate --out out/conjugate.dxf --tolerance 0.5

    cam-rig profile poly345 --cutter 6 --out out/cutter.csv

    cam-rig profile poly345 --from out/cam.dxf --out out/law.csv
    """
    with user_errors():
        from cam_rig.cli.cams import profile_files, profile_measure, profile_report
        from cam_rig.errors import ConfigError

        check_outputs(json_target, plot)
        if positions is not None and plot is None:
            raise ConfigError("--positions: are of the picture; needed: --plot PATH")
        request = profile_files.Request(out, pitch, cutter, tolerance, points, source)
        found = _checked(_paths(cams or [], every))
        request.require(len(found), drawing=plot is not None)
        if source is not None:
            profile_measure.run(request, found[0][0], found[0][1], json_target)
            return
        if out is not None or plot is not None:
            _draw(request, found, plot, force, positions)
        write_json(profile_report.to_json(found), json_target)
        if out is None and plot is None:
            profile_report.show_checks(found)
            if _any_fails(found, every):
                raise typer.Exit(1)


def _any_fails(found: Found, every: bool) -> bool:
    """Whether a check fails; of all cams, one that is not meant to: see ``cannot_be_made``."""
    asked = [checks for cam, _, checks in found if not (every and cam.cannot_be_made)]
    return not all(check.passed for checks in asked for check in checks)


def _draw(
    request: Request, found: Found, plot: Path | None, force: bool, positions: int | None
) -> None:
    from cam_rig.cli.cams import profile_files, profile_report

    cam, law, checks = found[0]
    profile_report.warn(cam, checks, force)
    if request.out is not None:
        profile_files.write(request, cam, law, force)
    if plot is not None:
        from cam_rig.plots.profile import POSITIONS, draw

        write_plot(plot, lambda part: draw(cam, law, checks, part, positions or POSITIONS))


def _paths(cams: list[str], every: bool) -> list[Path]:
    from cam_rig.errors import ConfigError
    from cam_rig.schema.load import config_root

    paths = [cam_path(cam) for cam in cams]
    if every:
        paths += sorted((config_root() / "cams").glob("*.yaml"))
    if not paths:
        raise ConfigError("no cam is named; allowed: cam files, names in config/cams, or --all")
    return paths


def _checked(paths: list[Path]) -> Found:
    from cam_rig.errors import LawError, ProfileError
    from cam_rig.laws import build_law
    from cam_rig.profile.checks.all_checks import check_cam
    from cam_rig.schema import load_cam

    found = []
    for path in paths:
        cam = load_cam(path)
        try:
            law = build_law(cam)
            found.append((cam, law, check_cam(cam, law)))
        except (LawError, ProfileError) as error:
            raise type(error)(f"{path}: {error}") from None
    return found

"""cam-rig profile: the cam's shape, checked, drawn, measured."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from cam_rig.show.command import command
from cam_rig.show.result import Result

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
Tolerance = Annotated[
    float | None,
    typer.Option(metavar="UM", help="Chord error of DXF and SVG, in µm; default 1."),
]
Points = Annotated[
    int | None,
    typer.Option(min=36, max=1_000_000, help="Rows of a CSV file, over one turn; default 3600."),
]
Source = Annotated[
    Path | None,
    typer.Option("--from", help="Measure this contour (.csv, .dxf) with the cam's follower."),
]
Unit = Annotated[
    Literal["mm", "cm", "m", "in"] | None,
    typer.Option(help="Unit of a file that states none (default of a table: mm)."),
]
Axis = Annotated[
    str, typer.Option(metavar="X,Y", help="Axis of the cam in the file of --from, in mm.")
]
Zero = Annotated[
    float,
    typer.Option(
        metavar="DEG",
        help="Direction of the follower at cam angle 0 in that file, from +x counter-clockwise.",
    ),
]
Mirrored = Annotated[
    bool, typer.Option("--mirrored", help="That file shows the cam from the other side.")
]
Layer = Annotated[str | None, typer.Option(help="Only layer of a DXF drawing that is read.")]
Align = Annotated[
    bool, typer.Option("--align", help="Find the zero direction and the side that fit the law.")
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
    tolerance: Tolerance = None,
    points: Points = None,
    source: Source = None,
    unit: Unit = None,
    axis: Axis = "0,0",
    zero: Zero = 90.0,
    mirrored: Mirrored = False,
    layer: Layer = None,
    align: Align = False,
    force: Force = False,
    *,
    plot: Path | None,
) -> Result:
    """Check a cam's contour: undercut, curvature, pressure angle, reach. Draw it, or measure one.

    The code is 1 when a check fails; with --all a cam does not count whose file says that it
    cannot_be_made, and why. With --from the cam's follower is put on the contour of a file and
    read at every angle; --out then writes that law as CSV. A DXF drawing may consist of lines,
    arcs, circles, ellipses, splines, polylines and blocks; a table has points x, y or angle,
    radius. --positions are those of the graphical method: the follower's places around the
    stationary cam.

    In Python: cam_rig.check_contours(cams, every)

    Examples
    --------
    cam-rig profile --all

    cam-rig profile quick

    cam-rig profile oscillating_roller --plot out/cam.png

    cam-rig profile point --plot out/point.png --positions 10

    cam-rig profile conjugate --out out/conjugate.dxf --tolerance 0.5

    cam-rig profile poly345 --cutter 6 --out out/cutter.csv

    cam-rig profile poly345 --from out/cam.dxf --out out/law.csv

    cam-rig profile poly345 --from part.dxf --unit mm --axis 120,80 --align
    """
    from cam_rig.errors import ConfigError, ProfileError
    from cam_rig.studies.profile import command_files
    from cam_rig.studies.profile.study import POSITIONS, ProfileResult, checked_cams

    if positions is not None and plot is None:
        raise ConfigError("--positions: are of the picture; needed: --plot PATH")
    placement = command_files.placement(unit, axis, zero, mirrored)
    request = command_files.Request(
        out, pitch, cutter, tolerance, points, source, placement, layer, align
    )
    cams_checked = checked_cams(cams or [], every)
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

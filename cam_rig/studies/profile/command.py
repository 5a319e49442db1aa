"""Command ``cam-rig profile``: checks, drawings and measurements of a cam's contour."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from cam_rig.show.command import command
from cam_rig.show.result import Result

Cams = Annotated[
    list[str] | None,
    typer.Argument(help="Cam files, or names in config/cams, or one scene for its cams."),
]
Every = Annotated[bool, typer.Option("--all", help="Check every cam of config/cams.")]
Out = Annotated[
    Path | None, typer.Option(help="Write the contour: .dxf, .svg or .csv (lengths in mm).")
]
Positions = Annotated[
    int | None,
    typer.Option(
        min=3,
        max=720,
        help="Positions of the follower around the cam in --plot (default: 24).",
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
    typer.Option(metavar="UM", help="Chord error of DXF and SVG in µm (default: 1)."),
]
Points = Annotated[
    int | None,
    typer.Option(min=36, max=1_000_000, help="Rows of a CSV file over one turn (default: 3600)."),
]
Source = Annotated[
    Path | None,
    typer.Option("--from", help="Measure this contour (.csv, .dxf) with the cam's follower."),
]
Unit = Annotated[
    Literal["mm", "cm", "m", "in"] | None,
    typer.Option(help="Unit of a file without a unit (default for tables: mm)."),
]
Axis = Annotated[
    str, typer.Option(metavar="X,Y", help="Axis of the cam in the file of --from, in mm.")
]
Zero = Annotated[
    float,
    typer.Option(
        metavar="DEG",
        help="Direction of the follower at cam angle 0 in the file of --from, from +x "
        "counter-clockwise.",
    ),
]
Mirrored = Annotated[
    bool, typer.Option("--mirrored", help="The file of --from shows the cam from the other side.")
]
Layer = Annotated[str | None, typer.Option(help="Layer of a DXF drawing to read (default: all).")]
Align = Annotated[
    bool, typer.Option("--align", help="Find the zero direction and the side that fit the law.")
]
Force = Annotated[bool, typer.Option("--force", help="Draw a cam even if it cannot exist.")]


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

    The exit code is 1 if a check fails. With --all, a cam whose file has cannot_be_made does not
    count. With --from the cam's follower is put on the contour of a file, and its lift is measured
    at each cam angle. --out then writes this law as CSV. A DXF drawing can consist of lines, arcs,
    circles, ellipses, splines, polylines and blocks. A table has points x, y or angle, radius.
    --positions sets the number of positions of the follower around the stationary cam, as in the
    graphical method.

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
        raise ConfigError("--positions requires --plot PATH")
    placement = command_files.make_placement(unit, axis, zero, mirrored)
    request = command_files.Request(
        out, pitch, cutter, tolerance, points, source, placement, layer, align
    )
    results = checked_cams(cams or [], every)
    request.validate(len(results), drawing=plot is not None)
    first, is_drawn = results[0], out is not None or plot is not None
    if source is not None:
        return command_files.measure(request, first.cam, first.law)
    for check in first.failed if is_drawn and not force else ():
        if check.is_fatal:
            raise ProfileError(f"{first.cam.name}: {check}; or draw it with --force")
    if out is not None:
        command_files.write(request, first.cam, first.law, force)
    return ProfileResult(tuple(results), positions or POSITIONS, is_drawn, every)

"""cam-rig fit: numbers of the rig from what was measured; ``fit cam`` from gauge readings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.measured.cam_fit.command import FitRequest
from cam_rig.measured.options import (
    BaseOption,
    ColumnOption,
    FlankOption,
    FollowerOption,
    ReverseOption,
    RollerOption,
    Shape,
    ShapeOption,
    ToleranceOption,
)
from cam_rig.measured.rig_fit.command import fit_rig
from cam_rig.show.command import (
    Command,
    Csv,
    Json,
    Plot,
    check_outputs,
    say_assumed,
    user_errors,
    write_csv,
    write_json,
    write_new,
    write_plot,
)
from cam_rig.show.terminal import say

fit = typer.Typer(
    help="Find the numbers of a cam, or of a rig, from what was measured.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
)

Tables = Annotated[list[Path], typer.Argument(help="Table of cam angles and gauge readings.")]

Out = Annotated[
    Path | None, typer.Option(metavar="CAM.yaml", help="Write the cam's file, and its points.")
]


@fit.callback()
def _group() -> None:
    """Find the numbers of a cam, or of a rig, from what was measured."""


fit.command("rig", cls=Command)(fit_rig)


@fit.command("cam", cls=Command)
def fit_cam(
    tables: Tables,
    shape: ShapeOption = Shape.spline,
    follower: FollowerOption = None,
    column: ColumnOption = None,
    tolerance: ToleranceOption = None,
    reverse: ReverseOption = False,
    roller_radius: RollerOption = None,
    base_radius: BaseOption = None,
    flank: FlankOption = None,
    out: Out = None,
    plot: Plot = None,
    csv: Csv = None,
    json_target: Json = None,
) -> None:
    """Fit a cam to gauge readings: a spline with exact dwells, or tangent arcs.

    Any separator, decimal comma, unit and language of headings. Says how near the law is, which
    readings look like outliers, and what was assumed. A --tolerance below the readings' scatter is
    not followed. Arcs take all columns and files at once, and say which was read with a flat
    follower.

    Examples
    --------
    cam-rig fit cam lifts.csv --tolerance 0.005 --plot out/fit.png

    cam-rig fit cam gl110.csv --shape arcs --out mine/cams/gl110.yaml
    """
    with user_errors():
        from cam_rig.errors import ConfigError

        check_outputs(json_target, plot, csv)
        if out is not None and out.suffix != ".yaml":
            raise ConfigError(f"--out: is {out}; allowed: a name that ends in .yaml")
        request = FitRequest(
            shape,
            tuple(follower or ()),
            column,
            tolerance,
            reverse,
            roller_radius,
            base_radius,
            flank,
        )
        found = request.run(tables)
        found.tell()
        write_csv(found.tables(), csv)
        write_json(found.to_json(), json_target)
        if plot is not None:
            from cam_rig.measured.cam_fit.figures import fit_figure

            write_plot(plot, lambda: fit_figure(found.fit))
        if out is not None:
            files = found.files(out.stem)
            write_new(out.parent, files.texts)
            say_assumed(files.assumed)
            say(f"cam: {out}")

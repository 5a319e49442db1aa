"""Commands ``cam-rig law`` (laws of cams or rises) and ``cam-rig laws`` (list of all laws)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.show.command import check_outputs, check_recording, command, write_outputs
from cam_rig.show.result import Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.studies.laws.rises import RisesResult
    from cam_rig.studies.laws.study import CamLawsResult


Save = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Also write the curves as a Rerun recording (.rrd)."),
]


@command("json", "csv")
def law(
    names: Annotated[
        list[str],
        typer.Argument(
            help="Cam files, names in config/cams, or names of rises as `cam-rig laws` lists them."
        ),
    ],
    rises: Annotated[
        bool,
        typer.Option("--rises", help="Treat names of both a cam and a rise as the rise."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="File of the plot: PNG, SVG or PDF (default: out/law_NAMES.png)."
        ),
    ] = None,
    save: Save = None,
    *,
    csv: Path | None,
    json: str | None,
) -> None:
    """Plot lift, velocity, acceleration and jerk over the cam angle; list peaks, tasks and joints.

    Peaks are computed from the roots of the next derivative, not from samples. Derivatives are with
    respect to the cam angle in rad. Multiplied by powers of the cam's speed in rad/s, they are
    derivatives with respect to time.

    The task of a segment has the letters of its ends: R rest, G constant velocity, U reversal, B
    motion with velocity and acceleration.

    Several laws are drawn in one plot: as cams over the turn if every name is that of a cam,
    otherwise as bare rises of unit lift over a unit span. CSV and JSON contain the curves. With
    them a plot is drawn only if --out is given.

    In Python: cam_rig.law_summary(names, rises)

    Examples
    --------
    cam-rig law poly345

    cam-rig law poly345 cycloidal bezier9 --out out/rises.png

    cam-rig law poly345 cycloidal bezier15 --csv out/cams.csv

    cam-rig law poly345 bezier8_start --rises

    cam-rig law poly345 cycloidal bezier15 --save out/laws.rrd

    cam-rig law bezier15 --csv - > bezier15.csv
    """
    check_outputs(None, out)
    if save is not None:
        check_recording(save)
    from cam_rig.studies.laws import study

    result = study.law_summary(names, rises=rises)
    if out is None and csv is None and json is None:
        out = Path("out") / f"law_{'_'.join(result.labels)[:MAX_LETTERS]}.png"
    write_outputs(result, out, csv, json)
    if save is not None:
        record(result, save)


@command("json", "csv", "plot")
def laws(
    family: Annotated[
        str | None,
        typer.Option(
            help="Family of rises: polynomial, start or end (half-rises), classical, handbook, "
            "motion (default: all)."
        ),
    ] = None,
) -> Result:
    """List the laws with their peaks per unit rise and unit span, and how smoothly they join.

    The continuity Ck is the order of the highest derivative without a jump at the end of the rise.
    There a rise meets a dwell, and a half-rise meets a dwell or constant velocity.

    A second table has the names of laws in controllers and handbooks. Files and commands accept
    them too. The rises of the handbooks have the defaults of their parameters.

    The plot shows the rises of each family of the sources in a column, s to s''' from top to
    bottom. With --family it shows one family.

    In Python: cam_rig.list_laws(family)

    Examples
    --------
    cam-rig laws

    cam-rig laws --plot out/laws.png

    cam-rig laws --family start --plot out/half_rises.pdf

    cam-rig laws --json -
    """
    from cam_rig.studies.laws.rises import list_laws

    return list_laws(family)


#: Largest number of letters of the laws' names in the default file name of a plot.
MAX_LETTERS = 60


def record(result: RisesResult | CamLawsResult, path: Path) -> None:
    """Write a Rerun recording of the curves of cams or rises.

    The lift of cams is in the unit of their files.
    """
    from cam_rig.laws.catalogue import cam_curves, common_unit, rise_curves
    from cam_rig.show.looks import PER_RADIAN
    from cam_rig.studies.laws.chart import save_laws
    from cam_rig.studies.laws.rises import RisesResult

    if isinstance(result, RisesResult):
        curves = [rise_curves(name) for name in result.names]
        save_laws(curves, "u", ("h", "h/β", "h/β²", "h/β³"), path)
    else:
        unit, factor = common_unit(cam for cam, _ in result.cams)
        curves = [cam_curves(cam.name, law) for cam, law in result.cams]
        curves = [replace(curve, motion=curve.motion / factor) for curve in curves]
        units = tuple(f"{unit}{per}" for per in PER_RADIAN)
        save_laws(curves, "°", units, path, {cam.name: cam.title for cam, _ in result.cams})
    say(f"recording: {path}")

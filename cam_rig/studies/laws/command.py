"""cam-rig law, one cam's law or several over each other; cam-rig laws, all side by side."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.show.command import check_outputs, check_recording, command, write_outputs
from cam_rig.show.result import Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.studies.laws.study import CamLawsResult, RisesResult


Save = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write the curves as a Rerun recording (.rrd) too."),
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
        typer.Option("--rises", help="Names that a cam and a rise have in common mean the rise."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The plot (PNG, SVG, PDF); out/law_NAMES.png if not given."
        ),
    ] = None,
    save: Save = None,
    *,
    csv: Path | None,
    json: str | None,
) -> None:
    """Plot lift, velocity, acceleration and jerk over the cam angle; list peaks and joints.

    Peaks come from the roots of the next derivative, not from samples. Derivatives are in the
    cam angle, per rad: times the cam's speed in rad/s they are those in time.

    Several laws are laid over each other: as cams over the turn if every name is a cam's, else
    as bare rises of unit lift over a unit span. The curves are in CSV
    and JSON, with which nothing is drawn unless --out is given.

    In Python: cam_rig.law(names, rises)

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

    found = study.law(names, rises=rises)
    if out is None and csv is None and json is None:
        out = Path("out") / f"law_{'_'.join(found.called)[:MAX_LETTERS]}.png"
    write_outputs(found, out, csv, json)
    if save is not None:
        record(found, save)


@command("json", "csv", "plot")
def laws(
    family: Annotated[
        str | None,
        typer.Option(help="Only this family of rises: polynomial, start, end (half), classical."),
    ] = None,
) -> Result:
    """List the laws with their peaks per unit rise and unit span, and how smoothly they join.

    Continuity Ck: the highest derivative that goes on without a jump where the rise meets a
    dwell (a half-rise: a dwell and constant velocity).

    The plot lays the rises of each family over each other, s to s''' one below the other.

    In Python: cam_rig.list_laws(family)

    Examples
    --------
    cam-rig laws

    cam-rig laws --plot out/laws.png

    cam-rig laws --family start --plot out/half_rises.pdf

    cam-rig laws --json -
    """
    from cam_rig.studies.laws.study import list_laws

    return list_laws(family)


#: Letters of the names in the name of a plot.
MAX_LETTERS = 60


def record(found: RisesResult | CamLawsResult, path: Path) -> None:
    """Write the curves of cams, in their unit of lift, or of bare rises, for Rerun."""
    from cam_rig.laws.catalogue import cam_curves, common_unit, rise_curves
    from cam_rig.show.looks import PER_RADIAN
    from cam_rig.studies.laws.chart import save_laws
    from cam_rig.studies.laws.study import RisesResult

    if isinstance(found, RisesResult):
        curves = [rise_curves(name) for name in found.names]
        save_laws(curves, "u", ("h", "h/β", "h/β²", "h/β³"), path)
    else:
        unit, factor = common_unit(cam for cam, _ in found.cams)
        curves = [cam_curves(cam.name, law) for cam, law in found.cams]
        curves = [replace(curve, motion=curve.motion / factor) for curve in curves]
        units = tuple(f"{unit}{per}" for per in PER_RADIAN)
        save_laws(curves, "°", units, path, {cam.name: cam.title for cam, _ in found.cams})
    say(f"recording: {path}")

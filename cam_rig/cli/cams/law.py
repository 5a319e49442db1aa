"""cam-rig law: one cam's law, or several over each other, as a plot, a table and CSV."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import say, show, user_errors
from cam_rig.cli.common.names import cam_path
from cam_rig.cli.common.outputs import check_outputs, write_plot

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.tables import DataTable

Save = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write the curves as a Rerun recording (.rrd) too."),
]


def law(
    names: Annotated[
        list[str],
        typer.Argument(
            help="Cam files, names in config/cams, or names of rises as `cam-rig laws` lists them.",
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
    as_csv: Annotated[
        bool, typer.Option("--csv", help="CSV to stdout; no plot unless --out is given.")
    ] = False,
    save: Save = None,
) -> None:
    """Plot lift, velocity, acceleration and jerk over the cam angle; list peaks and joints.

    Peaks come from the roots of the next derivative, not from samples. Derivatives are in the
    cam angle, per rad: times the cam's speed in rad/s they are those in time.

    Several laws are laid over each other: as cams over the turn if every name is a cam's, else
    as bare rises of unit lift over a unit span.

    Examples
    --------
    cam-rig law poly345

    cam-rig law poly345 cycloidal bezier9 --out out/rises.png

    cam-rig law poly345 cycloidal bezier15 --csv > cams.csv

    cam-rig law poly345 bezier8_start --rises

    cam-rig law poly345 cycloidal bezier15 --save out/laws.rrd

    cam-rig law config/cams/worked_example_quintic.yaml --out quintic.pdf

    cam-rig law bezier15 --csv > bezier15.csv
    """
    with user_errors():
        from cam_rig.cli.cams import law_overlay

        check_outputs(None, out)
        if save is not None:
            law_overlay.require_recording(save)
        if law_overlay.are_rises(names, rises):
            law_overlay.show_rises(names, out, as_csv)
        elif len(names) > 1:
            law_overlay.show_cams(names, out, as_csv)
        else:
            _show_one(names[0], out, as_csv)
        if save is not None:
            law_overlay.record(names, law_overlay.are_rises(names, rises), save)


def _show_one(name: str, out: Path | None, as_csv: bool) -> None:
    """One cam with its extremes, joints and segments."""
    from cam_rig import load_cam
    from cam_rig.cli.cams import law_overlay
    from cam_rig.simulation.cam_files import law_of

    config = load_cam(name)
    built = law_of(cam_path(name), config)
    show(_peaks(built, config.lift.unit, config.lift.factor))
    say(_joints(built))
    if as_csv:
        law_overlay.print_csv(law_overlay.CAM_HEADINGS, [((), *law_overlay.cam_rows(built))])
    if out is not None or not as_csv:
        from cam_rig.plots.laws.one_law import draw

        target = out or Path("out") / f"law_{config.name}.png"
        write_plot(target, lambda part: draw(config, built, part))


def _peaks(law: Law, unit: str, factor: float) -> DataTable:
    """Largest and smallest values in the unit of the file's lift."""
    from cam_rig.laws.peaks import extremes
    from cam_rig.tables import Column, tabulate

    units = {"lift s": "", "velocity s'": "/rad", "acceleration s''": "/rad²", "jerk s'''": "/rad³"}
    rows = [(name, unit + per, extremes(law, i)) for i, (name, per) in enumerate(units.items())]
    return tabulate(
        f"Extremes of {law.name}",
        rows,
        (
            (Column("quantity"), lambda row: row[0]),
            (Column("unit"), lambda row: row[1]),
            (Column("largest", "", ".6g"), lambda row: row[2][1].value / factor),
            (Column("at", "°", ".4g"), lambda row: math.degrees(row[2][1].angle)),
            (Column("smallest", "", ".6g"), lambda row: row[2][0].value / factor),
            (Column("at", "°", ".4g"), lambda row: math.degrees(row[2][0].angle)),
        ),
    )


def _joints(law: Law) -> str:
    """The joints that are not smooth, in one line."""
    from cam_rig.laws.continuity import SMOOTHEST, joints

    rough = [joint for joint in joints(law) if joint.continuity < SMOOTHEST]
    if not rough:
        return f"joins C{SMOOTHEST} or smoother everywhere"
    places = ", ".join(f"{math.degrees(j.angle):.5g}° C{j.continuity}" for j in rough)
    return f"joints (others C{SMOOTHEST}): {places}"

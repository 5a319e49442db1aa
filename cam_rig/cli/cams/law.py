"""cam-rig law: one cam's law over the turn, as a plot, a table and CSV."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import say, show, user_errors
from cam_rig.cli.common.names import cam_path
from cam_rig.cli.common.outputs import check_outputs, write_plot

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.tables import DataTable

#: Rows of the CSV, one every so many degrees.
CSV_STEP_DEG = 0.5


def law(
    cam: Annotated[str, typer.Argument(help="Cam file, or a name in config/cams.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The plot (PNG, SVG, PDF); out/law_CAM.png if not given."
        ),
    ] = None,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="CSV to stdout; no plot unless --out is given.")
    ] = False,
) -> None:
    """Plot lift, velocity, acceleration and jerk over the cam angle; list peaks and joints.

    Peaks come from the roots of the next derivative, not from samples. Derivatives are in the
    cam angle, per rad: times the cam's speed in rad/s they are those in time.

    Examples
    --------
    cam-rig law poly345

    cam-rig law config/cams/worked_example_quintic.yaml --out quintic.pdf

    cam-rig law bezier15 --csv > bezier15.csv
    """
    with user_errors():
        from cam_rig import load_cam
        from cam_rig.simulation.cam_files import law_of

        check_outputs(None, out)
        config = load_cam(cam)
        built = law_of(cam_path(cam), config)
        show(_peaks(built, config.lift.unit, config.lift.factor))
        say(_joints(built))
        if as_csv:
            _print_csv(built)
        if out is not None or not as_csv:
            from cam_rig.plots.law import draw

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


def _print_csv(law: Law) -> None:
    import numpy as np

    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["angle_deg", "lift_m", "velocity_m_rad", "acceleration_m_rad2", "jerk_m_rad3"])
    degrees = np.arange(0.0, 360.0, CSV_STEP_DEG)
    motion = [law(np.radians(degrees), order) for order in range(4)]
    for row in zip(degrees, *motion, strict=True):
        writer.writerow([f"{value:.12g}" for value in row])

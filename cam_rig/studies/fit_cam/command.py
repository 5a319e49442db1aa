"""Commands ``cam-rig fit cam`` and ``cam-rig new``: cams from gauge readings.

``fit cam`` fits a cam. ``new`` also writes a rig, and a scene that can be simulated.
"""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from cam_rig.files import write_new
from cam_rig.show.command import Rig, command, echo_assumptions
from cam_rig.show.result import Result
from cam_rig.show.terminal import say, show


def _in_mm(help_text: str, least: float | None = None) -> Any:
    """Return a command-line option in mm, whose value the command receives in m.

    ``help_text`` is its help, and ``least`` the smallest allowed value in mm.
    """
    return typer.Option(
        metavar="MM", min=least, help=help_text, callback=lambda x: None if x is None else 1e-3 * x
    )


Tables = Annotated[list[Path], typer.Argument(help="Table of cam angles and gauge readings.")]
Out = Annotated[
    Path | None,
    typer.Option(metavar="CAM.yaml", help="Write the cam file, and the table of its points."),
]
Shape = Annotated[
    Literal["spline", "arcs"],
    typer.Option(help="A smooth spline with exact dwells, or one contour of tangent arcs."),
]


class FollowerChoice(Enum):
    """Kind of follower with which the readings were taken.

    It is an enum because typer does not accept a list of literals.
    """

    roller = "roller"
    flat = "flat"
    point = "point"


Follower = Annotated[
    list[FollowerChoice] | None,
    typer.Option(
        help="Follower of the readings and of the cam's file (default: a roller for a spline; with "
        "arcs, the kind that fits each column). For several columns: once for the file alone, or "
        "once for each column in their order."
    ),
]
Flank = Annotated[
    Literal["straight", "curved"] | None,
    typer.Option(
        help="Known shape of the flanks of arcs (default: straight if the readings do not exclude "
        "it)."
    ),
]
GaugeColumn = Annotated[
    str | None, typer.Option(help="Heading of the only column of lifts that is read.")
]
AngleColumn = Annotated[str | None, typer.Option(help="Heading of the column of angles.")]
Angle = Annotated[
    Literal["cam", "crank"] | None,
    typer.Option(
        help="Shaft whose angle the table has; the crank turns twice as fast (default: by the "
        "heading, otherwise cam)."
    ),
]
Counts = Annotated[
    float | None,
    typer.Option(
        metavar="N", min=1.0, help="Counts of an encoder per turn, for a column of counts."
    ),
]
Mirror = Annotated[
    bool, typer.Option("--mirror", help="The table has half a lobe: add its mirror image.")
]
RockerRatio = Annotated[
    float, typer.Option(metavar="RATIO", help="Lift of the valve per lift of the cam.")
]
Lash = Annotated[float, _in_mm("Clearance of the valve.", 0.0)]
CheckingHeight = Annotated[
    list[float] | None,
    typer.Option(
        metavar="MM",
        help="Lift of the valve at which opening and closing are reported, can be repeated "
        "(default: 1 and 1.27 mm).",
    ),
]
Recognise = Annotated[
    bool, typer.Option("--recognise", help="List the named laws that explain the readings.")
]
Tolerance = Annotated[
    float | None, _in_mm("Error of the gauge (default: the scatter of the readings).")
]
Reverse = Annotated[
    bool, typer.Option("--reverse", help="The cam was turned in the other sense: use -angle.")
]
RollerRadius = Annotated[float | None, _in_mm("Radius of the roller (default: assumed).", 0.0)]
BaseRadius = Annotated[
    float | None,
    _in_mm("Radius of the base circle (default: stated in the table, otherwise assumed).", 0.0),
]


def _kinds(follower: list[FollowerChoice] | None) -> tuple[Any, ...]:
    """Return the names of the follower kinds of an option."""
    return tuple(choice.value for choice in follower or ())


@command("json", "csv", "plot")
def fit_cam(
    tables: Tables,
    shape: Shape = "spline",
    follower: Follower = None,
    column: GaugeColumn = None,
    angle_column: AngleColumn = None,
    angle: Angle = None,
    counts: Counts = None,
    tolerance: Tolerance = None,
    reverse: Reverse = False,
    mirror: Mirror = False,
    roller_radius: RollerRadius = None,
    base_radius: BaseRadius = None,
    flank: Flank = None,
    rocker_ratio: RockerRatio = 1.0,
    lash: Lash = 0.0,
    checking_height: CheckingHeight = None,
    recognise: Recognise = False,
    out: Out = None,
) -> Result:
    """Fit a cam to gauge readings: a spline with exact dwells, or tangent arcs.

    Reads any separator, decimal comma, unit and language of headings, such as Lift (0.001 in),
    crank_deg or cycle [%]. Reports the residual of the law, readings that look like outliers, and
    assumptions. A --tolerance below the readings' scatter is not followed. Arcs are fitted to all
    columns and files at once, and the result reports which was read with a flat follower.

    With --recognise the named laws are fitted to each event between two dwells and ranked by their
    likelihood, with the standard errors of start, span and rise. A law that is not significantly
    worse than the best is named too.

    In Python: cam_rig.fit_cam(tables, shape, follower, column, tolerance, …, out)

    Examples
    --------
    cam-rig fit cam lifts.csv --tolerance 0.005 --plot out/fit.png

    cam-rig fit cam lifts.csv --recognise

    cam-rig fit cam gl110.csv --shape arcs --out mine/cams/gl110.yaml

    cam-rig fit cam card.csv --angle crank --rocker-ratio 1.5 --lash 0.25 --checking-height 1.27
    """
    from cam_rig.studies.fit_cam import study
    from cam_rig.studies.fit_cam.valve_events import CHECKING_HEIGHTS

    result = study.fit_cam(
        tables,
        shape=shape,
        follower=_kinds(follower),
        column=column,
        angle_column=angle_column,
        angle=angle,
        counts=counts,
        tolerance=tolerance,
        reverse=reverse,
        mirror=mirror,
        roller_radius=roller_radius,
        base_radius=base_radius,
        flank=flank,
        rocker_ratio=rocker_ratio,
        lash=lash,
        checking_height=[1e-3 * h for h in checking_height or ()] or CHECKING_HEIGHTS,
        recognise=recognise,
        out=out,
    )
    if out is not None:
        say(f"cam: {out}")
    return result


@command()
def new(
    name: Annotated[str, typer.Argument(help="Name of the cam, its rig and its scene.")],
    from_csv: Annotated[
        list[Path],
        typer.Option("--from-csv", help="Table of cam angles and readings, several for arcs."),
    ],
    folder: Annotated[
        Path | None, typer.Option(help="Folder for cams/, rigs/ and scenes/ (default: NAME).")
    ] = None,
    shape: Shape = "spline",
    follower: Follower = None,
    column: GaugeColumn = None,
    angle_column: AngleColumn = None,
    angle: Angle = None,
    counts: Counts = None,
    tolerance: Tolerance = None,
    reverse: Reverse = False,
    mirror: Mirror = False,
    roller_radius: RollerRadius = None,
    base_radius: BaseRadius = None,
    flank: Flank = None,
    rig: Rig = "tm21",
) -> None:
    """Write cam, rig and scene files from a table of lifts; they run as they are.

    The cam is fitted as by `cam-rig fit cam`. The rig has another rig's numbers, all marked as
    assumed; the scene goes from 40 to 110 % of the jump speed of a rigid follower.

    Examples
    --------
    cam-rig new mycam --from-csv lifts.csv

    cam-rig new gl110 --from-csv gl110.csv --shape arcs --folder mine
    """
    from cam_rig.schema.load import load_rig, rig_path
    from cam_rig.studies.fit_cam.gauge_table import TableOptions
    from cam_rig.studies.fit_cam.new_files import default_rig, default_scene
    from cam_rig.studies.fit_cam.study import FitRequest

    target, like = folder or Path(name), load_rig(rig_path(rig))
    request = FitRequest(
        shape=shape,
        followers=_kinds(follower),
        table=TableOptions(column, angle_column, angle, counts),
        tolerance=tolerance,
        reverse=reverse,
        mirror=mirror,
        roller_radius=roller_radius,
        base_radius=base_radius,
        flank=flank,
        take_first=True,
    )
    fit = request.run(from_csv)
    files = request.files(fit, name)
    scene, speeds = default_scene(name, files.law, like)
    texts = {f"cams/{file}": text for file, text in files.texts.items()}
    texts |= {f"rigs/{name}.yaml": default_rig(name, like), f"scenes/{name}.yaml": scene}
    write_new(target, texts)
    show(*fit.to_display())
    say(*fit.summary())
    rpm = ", ".join(f"{speed:g}" for speed in speeds)
    echo_assumptions(
        (
            *files.assumed,
            f"rig: mass, spring, damping and sound of {like.name}, none of them measured here",
            f"speeds {rpm} rpm, one turn to settle and two to measure",
        )
    )
    say(*(f"wrote {target / file}" for file in texts))
    say(f"run it: cam-rig simulate {target / 'scenes' / name}.yaml")

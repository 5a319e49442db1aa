"""cam-rig new: a cam of one's own with a rig and a scene that run as they are."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.cli.cams.fit_options import (
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
from cam_rig.cli.cams.fitting import FitRequest, say_assumed, write_new
from cam_rig.cli.common.console import say, user_errors
from cam_rig.cli.common.names import rig_path
from cam_rig.cli.common.options import Rig


def new(
    name: Annotated[str, typer.Argument(help="Name of the cam, its rig and its scene.")],
    from_csv: Annotated[
        list[Path],
        typer.Option("--from-csv", help="Table of cam angles and readings; several for arcs."),
    ],
    folder: Annotated[
        Path | None, typer.Option(help="Where cams/, rigs/ and scenes/ go; by default NAME.")
    ] = None,
    shape: ShapeOption = Shape.spline,
    follower: FollowerOption = None,
    column: ColumnOption = None,
    tolerance: ToleranceOption = None,
    reverse: ReverseOption = False,
    roller_radius: RollerOption = None,
    base_radius: BaseOption = None,
    flank: FlankOption = None,
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
    with user_errors():
        from cam_rig.schema.load import load_rig
        from cam_rig.studies.cam_fit.scene_file import own_rig, own_scene

        kinds = tuple(follower or ())
        request = FitRequest(
            shape, kinds, column, tolerance, reverse, roller_radius, base_radius, flank, True
        )
        like = load_rig(rig_path(rig))
        found = request.run(from_csv)
        files = found.files(name)
        scene, speeds = own_scene(name, files.law, like)
        texts = {f"cams/{file}": text for file, text in files.texts.items()}
        texts |= {f"rigs/{name}.yaml": own_rig(name, like), f"scenes/{name}.yaml": scene}
        place = folder or Path(name)
        write_new(place, texts)
        found.tell()
        say_assumed(files.assumed)
        say_assumed(
            (
                f"rig: mass, spring, damping and sound of {like.name}, none of them measured here",
                f"speeds {', '.join(f'{speed:g}' for speed in speeds)} rpm, one turn to settle and "
                "two to measure",
            )
        )
        say(*(f"wrote {place / file}" for file in texts))
        say(f"run it: cam-rig simulate {place / 'scenes' / name}.yaml")

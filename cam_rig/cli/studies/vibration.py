"""cam-rig vibration: residual and torsional vibration of cams, and what the paper says of them."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.cli.common.console import progress_bar, user_errors
from cam_rig.cli.common.names import cam_path, rig_path, tables_path
from cam_rig.cli.common.options import Json, Plot, Rig, TableCams
from cam_rig.cli.common.outputs import check_outputs, write_json, write_plot

#: The jump speed of the first of the paper's laws is 389 rpm.
SPEEDS = [200.0, 250.0, 300.0, 350.0]


def vibration(
    cams: TableCams = None,
    rig: Rig = "paper_table2",
    rpm: Annotated[list[float] | None, typer.Option(help="Speed; may be given often.")] = None,
    json_target: Json = None,
    plot: Plot = None,
) -> None:
    """Measure what vibrates: the stem in the low dwell, the follower's acceleration, the shaft.

    Eq. 5 and eq. 10 of the paper, in steady state. Ringing is free vibration, what the joints of a
    law have kicked; a law without a low dwell is read within 31.25° of its lowest lift. The plot
    shows the last speed. † marks cams that are left below a speed: the model holds the follower on
    them, and what the paper says is tried without that speed. By default 200, 250, 300 and
    350 rpm, below every jump speed of the paper's laws.

    Examples
    --------
    cam-rig vibration --plot out/vibration.png

    cam-rig vibration poly345 poly4567 --rig tm21 --rpm 300 --json -
    """
    with user_errors():
        from cam_rig.cli.studies import vibration_tables
        from cam_rig.schema import load_tables
        from cam_rig.studies.cam_set import open_cam_set
        from cam_rig.studies.vibration.comparison import vibration_table

        check_outputs(json_target, plot)
        names = cams or list(load_tables(tables_path()).table_2_jump)
        cam_set = open_cam_set(map(cam_path, names), rig_path(rig))
        with progress_bar() as bar:
            task = bar.add_task("", total=len(cam_set.cams), completed=-1)
            speeds = tuple(rpm or SPEEDS)  # a speed given twice is one
            found = vibration_table(
                cam_set, speeds, lambda cam: bar.update(task, advance=1, description=cam)
            )
        vibration_tables.show(found, cam_set)
        if plot is not None:
            from cam_rig.plots.vibration import draw

            write_plot(plot, lambda part: draw(cam_set, speeds[-1], part))
        write_json(vibration_tables.to_json(found), json_target)

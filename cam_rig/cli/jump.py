"""cam-rig jump: the lowest speed at which the follower leaves each cam."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.cli.console import (
    cam_path,
    check_outputs,
    console,
    progress_bar,
    rig_path,
    tables_path,
    user_errors,
    write_json,
    writing,
)

Cams = Annotated[
    list[str] | None,
    typer.Argument(help="Cam files, or names in config/cams; by default those of Table 2."),
]


def jump(
    cams: Cams = None,
    rig: Annotated[str, typer.Option(help="Rig file, or a name in config/rigs.")] = "paper_table2",
    from_rest: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="Length of the run from rest, at one speed, to 60 s."),
    ] = 1.7,
    steady: Annotated[bool, typer.Option("--steady", help="In steady state instead.")] = False,
    ramp: Annotated[
        float | None,
        typer.Option(metavar="RPM/S", help="Along a ramp instead, 1 to 1e5."),
    ] = None,
    refit: Annotated[
        bool, typer.Option("--refit", help="Fit the rig's unprinted numbers anew (a minute).")
    ] = False,
    json_target: Annotated[
        str | None, typer.Option("--json", metavar="FILE", help="Write JSON; - for stdout.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Write the plot (PNG, SVG, PDF).")] = None,
) -> None:
    """Find the jump speed of cams to 0.01 rpm, beside the paper's Table 2.

    The two-mass follower starts from rest at cam angle 0, or is in its steady state, or goes along
    a ramp. Angle and time are those of the first lift-off.

    Examples
    --------
    cam-rig jump --plot out/jump.png

    cam-rig jump poly345 bezier15 --steady --json -

    cam-rig jump --ramp 350
    """
    with user_errors():
        from cam_rig.cli import jump_tables
        from cam_rig.dynamics import TwoMassParameters
        from cam_rig.errors import ConfigError
        from cam_rig.experiment.jump_table import find_jumps
        from cam_rig.experiment.lineup import open_lineup
        from cam_rig.experiment.references import references
        from cam_rig.schema import load_tables

        check_outputs(json_target, plot)
        if steady and ramp is not None:
            raise ConfigError("--steady and --ramp; allowed: one of them")
        published = load_tables(tables_path())
        names = cams or list(published.table_2_jump)
        lineup = open_lineup(map(cam_path, names), rig_path(rig))
        parameters = TwoMassParameters.from_rig(lineup.rig)
        if refit:
            jump_tables.show_refit(lineup, published, parameters, from_rest)
            return
        known, duration = references(lineup, published), None if steady else from_rest
        with progress_bar() as bar:
            task = bar.add_task("", total=len(lineup.cams), completed=-1)
            rows = find_jumps(
                lineup.laws,
                parameters,
                known,
                duration,
                ramp,
                lambda cam: bar.update(task, advance=1, description=cam),
            )
        console.print(jump_tables.table(rows, lineup.rig.name))
        console.print(jump_tables.words(rows), soft_wrap=True)
        if plot is not None:
            from cam_rig.view.jump_plot import draw

            with writing(plot) as part:
                draw(rows, lineup, duration, part)
            console.print(f"plot: {plot}", soft_wrap=True)
        if json_target is not None:
            write_json(jump_tables.to_json(rows), json_target)

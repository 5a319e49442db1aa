"""cam-rig jump: the lowest speed at which the follower leaves each cam."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import console, progress_bar, user_errors
from cam_rig.cli.common.names import cam_path, rig_path, tables_path
from cam_rig.cli.common.options import Json, Plot, Rig, TableCams
from cam_rig.cli.common.outputs import check_outputs, write_json, write_plot

if TYPE_CHECKING:
    from cam_rig.studies.cam_set import CamSet
    from cam_rig.studies.jump.comparison import JumpRow
    from cam_rig.studies.jump.published import Reference


def jump(
    cams: TableCams = None,
    rig: Rig = "paper_table2",
    from_rest: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Length of the run from rest, at one speed: 1.7, to 60 s."
        ),
    ] = None,
    steady: Annotated[bool, typer.Option("--steady", help="In steady state instead.")] = False,
    ramp: Annotated[
        float | None,
        typer.Option(metavar="RPM/S", help="Along a ramp instead, 1 to 1e5."),
    ] = None,
    refit: Annotated[
        bool, typer.Option("--refit", help="Fit the rig's unprinted numbers anew (a minute).")
    ] = False,
    json_target: Json = None,
    plot: Plot = None,
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
        from cam_rig.cli.studies import jump_tables
        from cam_rig.schema import load_tables
        from cam_rig.studies.cam_set import open_cam_set
        from cam_rig.studies.jump.contact_limit import FROM_REST
        from cam_rig.studies.jump.published import references

        check_outputs(json_target, plot)
        _require_apart(steady, ramp, from_rest, refit, bool(plot), bool(json_target))
        published = load_tables(tables_path())
        names = cams or list(published.table_2_jump)
        cam_set = open_cam_set(map(cam_path, names), rig_path(rig))
        if refit:
            jump_tables.show_refit(
                cam_set, published, FROM_REST if from_rest is None else from_rest
            )
            return
        duration = None if steady else FROM_REST if from_rest is None else from_rest
        known = references(cam_set, published)
        rows = _find(cam_set, known, duration, ramp)
        console.print(jump_tables.table(rows, cam_set.rig.name))
        console.print(jump_tables.words(rows), soft_wrap=True)
        if plot is not None:
            from cam_rig.plots.jump import draw

            write_plot(plot, lambda part: draw(rows, cam_set, duration, part))
        write_json(jump_tables.to_json(rows), json_target)


def _require_apart(
    steady: bool, ramp: float | None, from_rest: float | None, refit: bool, plot: bool, json: bool
) -> None:
    """Refuse options that do not go together, rather than pass one over."""
    from cam_rig.errors import ConfigError

    if sum((steady, ramp is not None, from_rest is not None)) > 1:
        raise ConfigError("--steady, --ramp and --from-rest; allowed: one of them")
    if ramp is not None and plot:
        raise ConfigError(
            "--plot shows the least force of speeds that are held, and --ramp holds none; "
            "allowed: one of them"
        )
    if refit and (steady or ramp is not None or plot or json):
        raise ConfigError("--refit is of runs from rest, and prints; allowed: --refit alone")


def _find(
    cam_set: CamSet, known: dict[str, Reference], duration: float | None, ramp: float | None
) -> list[JumpRow]:
    """Every cam's jump, behind a bar."""
    from cam_rig.dynamics import TwoMassParameters
    from cam_rig.studies.jump.comparison import find_jumps

    follower = TwoMassParameters.from_rig(cam_set.rig)
    with progress_bar() as bar:
        task = bar.add_task("", total=len(cam_set.cams), completed=-1)

        def done(cam: str) -> None:
            bar.update(task, advance=1, description=cam)

        return find_jumps(cam_set.laws, follower, known, duration, ramp, done)

"""cam-rig jump: the lowest speed at which the follower loses contact with each cam."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.show.command import (
    CamsOrScene,
    Csv,
    Json,
    Plot,
    RigOfScene,
    check_outputs,
    progress_bar,
    user_errors,
    write_csv,
    write_json,
    write_plot,
)
from cam_rig.show.terminal import console, say, show

if TYPE_CHECKING:
    from pathlib import Path

    from cam_rig.dynamics.jump.any_follower import JumpRow
    from cam_rig.laws.cam import CamSet
    from cam_rig.paper.jump.comparison import Reference
    from cam_rig.schema import PublishedTables


def jump(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
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
    csv: Csv = None,
    plot: Plot = None,
) -> None:
    """Find the jump speed of cams to 0.01 rpm, beside the paper's Table 2.

    The follower is two masses where the rig says how they split, else one rigid mass: from rest at
    cam angle 0, in steady state, or along a ramp. Angle and time are of the first lift-off.

    Examples
    --------
    cam-rig jump --plot out/jump.png

    cam-rig jump poly345 bezier15 --steady --json -

    cam-rig jump quick --rig tm21 --ramp 350
    """
    with user_errors():
        from cam_rig.dynamics.jump.any_follower import described, follower_of
        from cam_rig.dynamics.jump.jump_speed import FROM_REST
        from cam_rig.paper.jump import tables
        from cam_rig.paper.jump.comparison import references
        from cam_rig.schema.load import load_tables, tables_path
        from cam_rig.simulation.asked import asked_cams

        check_outputs(json_target, plot, csv)
        _require_apart(steady, ramp, from_rest, refit, plot, any((plot, json_target, csv)))
        published, cam_set = load_tables(tables_path()), asked_cams(cams, rig)
        seconds = FROM_REST if from_rest is None else from_rest
        if refit:
            return _refit(cam_set, published, seconds)
        duration = None if steady else seconds
        follower = described(follower_of(cam_set.rig))
        rows = _find(cam_set, references(cam_set, published), duration, ramp)
        shown = tables.jump_table(rows, f"Jump speed on rig {cam_set.rig.name}: {follower}")
        show(shown)
        say(conclusion(rows))
        write_csv([shown], csv)
        write_json(tables.to_json(rows, cam_set.rig.name, follower), json_target)
        if plot is not None:
            from cam_rig.dynamics.jump.figures import figure

            write_plot(plot, lambda: figure(rows, cam_set, duration))


def conclusion(rows: list[JumpRow]) -> str:
    """What the comparison with Table 2 comes to, in a line."""
    from cam_rig.paper.jump.comparison import compare

    if any(row.ramp is not None for row in rows):
        return "along a ramp: the speeds of Table 2 are constant ones, so nothing is compared"
    found = compare(rows)
    if found is None:
        return "nothing is published of these cams"
    cams = f"{found.cams} cam{'' if found.cams == 1 else 's'}"
    of = "that identified the rig" if found.fitted else "not used to identify the rig"
    ranking = f"; ranking {'as' if found.same_ranking else 'not as'} published"
    ours, theirs = (
        f"{low:.1f}" if low == high else f"{low:.1f} to {high:.1f}"
        for low, high in (found.turns, found.published_turns)
    )
    return (
        f"{100.0 * found.rms:.2f} % r.m.s. from Table 2 on {cams} {of}"
        f"{ranking if len(rows) > 1 else ''}; contact first lost after {ours} turns, published "
        f"{theirs}"
    )


def _require_apart(
    steady: bool,
    ramp: float | None,
    from_rest: float | None,
    refit: bool,
    plot: Path | None,
    files: bool,
) -> None:
    """Refuse options that do not go together, rather than pass one over."""
    from cam_rig.errors import ConfigError

    if sum((steady, ramp is not None, from_rest is not None)) > 1:
        raise ConfigError("--steady, --ramp and --from-rest; allowed: one of them")
    if ramp is not None and plot is not None:
        raise ConfigError(
            "--plot shows the least force of speeds that are held, and --ramp holds none; "
            "allowed: one of them"
        )
    if refit and (steady or ramp is not None or files):
        raise ConfigError("--refit is of runs from rest, and prints; allowed: --refit alone")


def _find(
    cam_set: CamSet, known: dict[str, Reference], duration: float | None, ramp: float | None
) -> list[JumpRow]:
    """Every cam's jump, behind a bar."""
    from cam_rig.dynamics.jump.any_follower import follower_of
    from cam_rig.paper.jump.comparison import find_jumps

    follower = follower_of(cam_set.rig)
    with progress_bar() as bar:
        task = bar.add_task("", total=len(cam_set.cams), completed=-1)

        def done(cam: str) -> None:
            bar.update(task, advance=1, description=cam)

        return find_jumps(cam_set.laws, follower, known, duration, ramp, done)


def _refit(cam_set: CamSet, published: PublishedTables, duration: float) -> None:
    """Fit the rig's four unprinted numbers anew, and try them on all cams.

    Raises
    ------
    ConfigError, DynamicsError : the cams are not those of the table; the run is too long
    """
    from cam_rig.dynamics import TwoMassParameters
    from cam_rig.dynamics.jump.jump_speed import require_run
    from cam_rig.errors import ConfigError
    from cam_rig.paper.jump import tables
    from cam_rig.paper.jump.comparison import Reference, find_jumps
    from cam_rig.paper.jump.refit import refit, refitted

    require_run(duration)
    parameters = TwoMassParameters.from_rig(cam_set.rig)
    fitted = {cam: published.table_2_jump[cam].rpm for cam in published.table_2_defined}
    if not set(fitted) <= set(cam_set.cams):
        raise ConfigError(
            f"--refit: cams are {', '.join(cam_set.cams)}; needed: {', '.join(fitted)}"
        )
    with console.status("searching") as status:
        found = refit(
            cam_set.cams,
            fitted,
            parameters,
            duration,
            lambda rms: status.update(f"best {100 * rms:.3f} % r.m.s."),
        )
    before, after = found.rms
    show(tables.refit_table(found), tables.solutions_table(found))
    say(
        f"rig as it is: {100 * before:.2f} % r.m.s.; refitted: {100 * after:.2f} % r.m.s.; "
        f"rounding of Table 2 alone: {100 * found.rounding:.2f} %"
    )
    if before - after < found.rounding:
        say("the two solutions differ by less than the rounding: Table 2 does not tell them apart")
    known = {
        cam: Reference(row.rpm, row.time_s, "fitted" if cam in fitted else "test")
        for cam, row in published.table_2_jump.items()
    }
    rows = find_jumps(*refitted(cam_set.cams, parameters, found.numbers), known, duration)
    show(tables.jump_table(rows, "Jump speed on the refitted rig"))
    say(conclusion(rows))

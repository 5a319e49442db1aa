"""cam-rig design: the best law of a class between a cam's dwells, and the bound that proves it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import INTERRUPTED, ConfigError
from cam_rig.files import writing
from cam_rig.show.command import (
    Csv,
    Json,
    Plot,
    check_outputs,
    progress_bar,
    user_errors,
    write_csv,
    write_json,
    write_plot,
)
from cam_rig.show.terminal import console, say, show

if TYPE_CHECKING:
    from cam_rig.law_design.request import DesignConfig
    from cam_rig.law_design.tables import LawDesign

Second = Annotated[
    str | None,
    typer.Option(metavar="QUANTITY", help="A front: the goal's best for values of another."),
]

Keep = Annotated[
    str, typer.Option(help="What stays as the start has it; or dwells,lift; or lift alone.")
]

Starts = Annotated[int, typer.Option(help="Where it is not convex: laws, or spans, to begin from.")]

Seed = Annotated[int, typer.Option(help="Of the random ones among them.")]


def design(
    start: Annotated[
        str, typer.Argument(help="Cam file, or a name in config/cams; or a design file.")
    ],
    minimise: Annotated[
        str | None, typer.Option(metavar="QUANTITY", help="Goal, such as peak_acceleration.")
    ] = None,
    maximise: Annotated[
        str | None, typer.Option(metavar="QUANTITY", help="Goal, such as jump_speed.")
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(help="Limit, such as 'peak_acceleration<=start'; as often as needed."),
    ] = None,
    keep: Keep = "events,dwells,lift",
    pieces: Annotated[int, typer.Option(help="Pieces of each event, 1 to 200.")] = 16,
    joints: Annotated[str, typer.Option(help="Continuity at joints, C1 to C6.")] = "C3",
    degree: Annotated[int | None, typer.Option(help="To 15; by default joints + 2.")] = None,
    starts: Starts = 8,
    seed: Seed = 1,
    pareto: Second = None,
    points: Annotated[int, typer.Option(help="Points of the front, 3 to 200.")] = 25,
    rig: Annotated[str, typer.Option(help="Rig file, or a name in config/rigs.")] = "paper_table2",
    out: Annotated[
        Path | None, typer.Option(metavar="CAM.yaml", help="Write the cam's file.")
    ] = None,
    plot: Plot = None,
    csv: Csv = None,
    json_target: Json = None,
) -> None:
    """Design the law that is best by a goal, and bound what any law of its class could reach.

    The law is a B-spline in each event of the start; dwells, events and lift stay. Goals:
    jump_speed, jump_speed_steady, jump_speed_rigid, least_contact_force_rigid@450rpm (maximise);
    residual_vibration@200-400rpm, sound_level_rigid@200-400rpm, peak_velocity, peak_acceleration,
    peak_jerk, rms_acceleration, peak_contact_force_rigid@450rpm (minimise). Without a bound, as
    the best of several searches: shaft_torque@300rpm, sound_level_with_jumps@450-550rpm,
    pressure_angle (minimise), radius_of_curvature (maximise). Limits: any of these, lift@90deg,
    velocity@90deg, acceleration@80-100deg, event_angle@1. Ctrl-C keeps the best.

    Examples
    --------
    cam-rig design poly345 --maximise jump_speed --limit 'peak_acceleration<=start' --out fast.yaml

    cam-rig design poly345 --minimise residual_vibration@200-400rpm --pieces 28 --plot out/calm.png

    cam-rig design poly345 --maximise jump_speed_rigid --keep dwells,lift --starts 3
    """
    with user_errors():
        _check(out)
        check_outputs(json_target, plot, csv)
        asked = {"minimise": minimise, "maximise": maximise, "limits": limit or []}
        law_class = {"pieces": pieces, "joints": joints, "degree": degree}
        search = {"starts": starts, "seed": seed, "keep": keep.split(",")}
        config = _config(start, rig, asked, law_class, search)
        if pareto is None:
            _write(_solve(config, out), out, plot, csv, json_target)
        else:
            _require_no_file(out, json_target)
            _front(config, pareto, points, plot, csv)


def _require_no_file(out: Path | None, json: str | None) -> None:
    """Refuse one cam's outputs beside a front."""
    if out is not None or json is not None:
        raise ConfigError(
            "--pareto: is of many cams; allowed beside it: --csv and --plot, no --out or --json"
        )


def _front(
    config: DesignConfig, other: str, points: int, plot: Path | None, csv: Path | None
) -> None:
    """Solve, show and write a front, behind a bar.

    Raises
    ------
    CamRigError : what is asked for cannot be
    """
    from cam_rig.law_design.pareto_front import front, front_table
    from cam_rig.law_design.request import DesignRequest
    from cam_rig.law_design.terms import parse_second
    from cam_rig.schema import load_cam, load_rig
    from cam_rig.schema.load import cam_path, rig_path

    request, second = DesignRequest.of_config(config), parse_second(other)
    cam, rig = load_cam(cam_path(config.start)), load_rig(rig_path(config.rig))
    with progress_bar() as bar:
        task = bar.add_task(request.words, total=points + 2)
        found = front(cam, rig, request, second, points, lambda: bar.update(task, advance=1))
    table = front_table(found)
    show(table)
    write_csv([table], csv)
    if plot is not None:
        from cam_rig.law_design.figures import front_figure

        write_plot(plot, lambda: front_figure(found))
    if not found.ended:
        say(f"interrupted: {len(found.designs)} of {points} points")
        raise typer.Exit(INTERRUPTED)


def _config(
    start: str,
    rig: str,
    asked: dict[str, Any],
    law_class: dict[str, Any],
    search: dict[str, Any],
) -> DesignConfig:
    """What the command line asks for, or a design file.

    Raises
    ------
    ConfigError : a design file beside a goal, or something wrong in it
    """
    from cam_rig.law_design.request import ClassConfig, DesignConfig, is_design, load_design
    from cam_rig.schema.load import cam_path

    path = cam_path(start)
    if not is_design(path):
        own = ClassConfig(**law_class)
        return DesignConfig.model_construct(start=start, rig=rig, class_=own, **asked, **search)
    if any(asked.values()):
        raise ConfigError(
            f"{path}: has a goal and limits of its own; allowed beside it: no --minimise, "
            "--maximise, --limit"
        )
    own_file = load_design(path)
    beside = path.parent / own_file.start, path.parent / own_file.rig
    files = (own_file.start, own_file.rig)
    start, rig = (
        str(one) if one.is_file() else name for one, name in zip(beside, files, strict=True)
    )
    return own_file.model_copy(update={"start": start, "rig": rig})


def _check(out: Path | None) -> None:
    """Refuse what could not be written."""
    from cam_rig.show.command import require_new

    if out is not None:
        if out.suffix != ".yaml":
            raise ConfigError(f"--out: is {out}; allowed: a name that ends in .yaml")
        require_new(out)


def _write(
    design: LawDesign, out: Path | None, plot: Path | None, csv: Path | None, json: str | None
) -> None:
    """Show and write a design, also one whose search was interrupted.

    Raises
    ------
    OutputError : a place cannot be written
    """
    from cam_rig.law_design.tables import design_table, to_json

    table = design_table(design)
    show(table)
    write_csv([table], csv)
    write_json(to_json(design), json)
    if out is not None:
        with writing(out) as part:
            part.write_text(design.text, encoding="utf-8")
        say(f"cam: {out}")
    if plot is not None:
        from cam_rig.law_design.figures import figure

        write_plot(plot, lambda: figure(design))
    if not design.ended:
        raise typer.Exit(INTERRUPTED)


def _solve(config: DesignConfig, out: Path | None) -> LawDesign:
    """Solve it, behind a line with the best so far, which Ctrl-C keeps.

    Raises
    ------
    CamRigError : what is asked for cannot be
    """
    from cam_rig.law_design.design import search_design as solve
    from cam_rig.law_design.request import DesignRequest
    from cam_rig.schema import load_cam, load_rig
    from cam_rig.schema.load import cam_path, rig_path

    request = DesignRequest.of_config(config)
    cam, rig = load_cam(cam_path(config.start)), load_rig(rig_path(config.rig))
    name = config.name or (out.stem if out is not None else None)
    unit, factor = request.goal.quantity.unit, request.goal.quantity.shown
    found: list[Callable[[], LawDesign]] = []
    with console.status(request.words) as status:

        def told(better: Callable[[], LawDesign], value: float) -> None:
            found[:] = [better]
            status.update(f"{request.words}: {value / factor:.5g} {unit} so far")

        try:
            return solve(cam, rig, request, name, told)
        except KeyboardInterrupt:
            if not found:
                raise
            return found[0]()

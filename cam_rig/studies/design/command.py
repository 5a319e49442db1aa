"""Command ``cam-rig design``, which designs the best motion law of a class."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import ConfigError
from cam_rig.files import atomic_write, new_yaml
from cam_rig.show.command import RigOfCam, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from collections.abc import Callable

    from cam_rig.schema import CamConfig, RigConfig
    from cam_rig.studies.design.request import DesignConfig, DesignRequest
    from cam_rig.studies.design.result import LawDesign

Limits = Annotated[
    list[str] | None,
    typer.Option(help="Limit, such as 'peak_acceleration<=start', can be repeated."),
]
Keep = Annotated[
    str,
    typer.Option(help="Parts of the start to keep: events,dwells,lift or dwells,lift or lift."),
]
Starts = Annotated[
    int, typer.Option(help="Number of start laws or spans of a search that is not convex.")
]
Second = Annotated[
    str | None,
    typer.Option(metavar="QUANTITY", help="Compute a front: the best goal over this quantity."),
]


@command("plot", "csv", "json")
def design(
    start: Annotated[
        str, typer.Argument(help="Cam file, or a name in config/cams, or a design file.")
    ],
    minimise: Annotated[
        str | None, typer.Option(metavar="QUANTITY", help="Goal, such as peak_acceleration.")
    ] = None,
    maximise: Annotated[
        str | None, typer.Option(metavar="QUANTITY", help="Goal, such as jump_speed.")
    ] = None,
    limit: Limits = None,
    keep: Keep = "events,dwells,lift",
    pieces: Annotated[int, typer.Option(help="Pieces of each event, 1 to 200.")] = 16,
    joints: Annotated[str, typer.Option(help="Continuity at joints, C1 to C6.")] = "C3",
    degree: Annotated[
        int | None, typer.Option(help="Degree, up to 15 (default: joints + 2).")
    ] = None,
    starts: Starts = 8,
    seed: Annotated[int, typer.Option(help="Seed of the random starts.")] = 1,
    pareto: Second = None,
    points: Annotated[int, typer.Option(help="Points of the front, 3 to 200.")] = 25,
    rig: RigOfCam = None,
    out: Annotated[
        Path | None, typer.Option(metavar="CAM.yaml", help="Write the cam's file.")
    ] = None,
    *,
    progress: Progress,
) -> Result:
    """Design the law that is best by a goal, with a bound for all laws of its class.

    The law is a B-spline in each event of the start. Dwells, events and lift are kept. Goals:
    jump_speed, jump_speed_steady, jump_speed_rigid, least_contact_force_rigid@450rpm (maximise);
    residual_vibration@200-400rpm, sound_level_rigid@200-400rpm, peak_velocity, peak_acceleration,
    peak_jerk, rms_acceleration, peak_contact_force_rigid@450rpm (minimise). Goals without a bound,
    by several searches: shaft_torque@300rpm, sound_level_with_jumps@450-550rpm, pressure_angle
    (minimise), radius_of_curvature (maximise). Limits: any of these, lift@90deg, velocity@90deg,
    acceleration@80-100deg, event_angle@1. Ctrl-C keeps the best law so far.

    In Python: cam_rig.design(cam, rig, minimise, maximise, limits, …, pareto, points)

    Examples
    --------
    cam-rig design poly345 --maximise jump_speed --limit 'peak_acceleration<=start' --out fast.yaml

    cam-rig design poly345 --minimise residual_vibration@200-400rpm --pieces 28 --plot out/calm.png

    cam-rig design poly345 --maximise jump_speed_rigid --keep dwells,lift --starts 3
    """
    if out is not None and pareto is not None:
        raise ConfigError("--pareto cannot be combined with --out, because it designs many cams")
    new_yaml(out)
    goals = {"minimise": minimise, "maximise": maximise, "limits": limit or []}
    others = {"starts": starts, "seed": seed, "keep": keep.split(",")}
    law_class = {"pieces": pieces, "joints": joints, "degree": degree}
    return _run_design(
        _config(start, goals, rig=rig, class_=law_class, **others), pareto, points, out, progress
    )


def _config(start: str, goals: dict[str, Any], **others: Any) -> DesignConfig:
    """Return the design options of the command line, or of a design file.

    ``start`` is a cam file or a design file. A design file's cam and rig are files in the same
    folder, or else shipped files.
    """
    from cam_rig.schema.load import cam_path, load
    from cam_rig.simulation.inputs import default_rig
    from cam_rig.studies.design.request import ClassConfig, DesignConfig, is_design

    path = cam_path(start)
    if not is_design(path):
        others["rig"] = str(default_rig([path])) if others["rig"] is None else others["rig"]
        others["class_"] = ClassConfig(**others["class_"])
        return DesignConfig.model_construct(start=start, **goals, **others)
    if any(goals.values()):
        raise ConfigError(
            f"{path}: has a goal and limits; it cannot be combined with --minimise, "
            "--maximise or --limit"
        )
    file = load(path, DesignConfig)
    neighbours = {
        key: path.parent / name for key, name in (("start", file.start), ("rig", file.rig))
    }
    return file.model_copy(update={key: str(p) for key, p in neighbours.items() if p.is_file()})


def _run_design(
    config: DesignConfig, pareto: str | None, points: int, out: Path | None, progress: Progress
) -> Result:
    from cam_rig.simulation.inputs import resolve_cam, resolve_rig
    from cam_rig.studies.design.request import DesignRequest, parse_second
    from cam_rig.studies.design.study import front

    request = DesignRequest.of_config(config)
    second = None if pareto is None else parse_second(pareto)
    cam, rig = resolve_cam(config.start), resolve_rig(config.rig, config.start)
    if second is not None:
        return front(cam, rig, request, second, points, progress)
    name = config.name or (None if out is None else out.stem)
    result = _best(cam, rig, request, name, progress)
    if out is not None:
        with atomic_write(out) as part:
            part.write_text(result.text, encoding="utf-8")
        say(f"cam: {out}")
    return result


def _best(
    cam: CamConfig, rig: RigConfig, request: DesignRequest, name: str | None, progress: Progress
) -> LawDesign:
    """Search for the best law of a design request, and report progress.

    Ctrl-C ends the search and returns the best law so far, or raises `KeyboardInterrupt` if no law
    was found yet. ``name`` is the name of the designed cam, or None for a default name.
    """
    from cam_rig.studies.design import study

    quantity = request.goal.quantity
    best: list[Callable[[], LawDesign]] = []

    def on_better(better: Callable[[], LawDesign], value: float) -> None:
        best[:] = [better]
        value /= quantity.factor
        progress.describe(f"{request.words}: {value:.5g} {quantity.unit} so far")

    progress.start(None, request.words)
    try:
        return study.search_design(cam, rig, request, name, on_better)
    except KeyboardInterrupt:
        if not best:
            raise
        return best[0]()

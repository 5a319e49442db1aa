"""Command ``cam-rig bounce``, which classifies the motion of a bouncing follower."""

from __future__ import annotations

import math
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import ConfigError
from cam_rig.show.command import Dask, Jobs, command
from cam_rig.show.result import Progress, Result

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from cam_rig.laws import Law
    from cam_rig.schema import RigConfig

#: Number of cam speeds of a bounce map if the option --rpm is omitted.
DEFAULT_SPEEDS = 121
#: Lowest speed if the option --rpm is omitted, as a multiple of the jump speed.
MIN_JUMP_RATIO = 0.9
#: Highest speed if the option --rpm is omitted, as a multiple of the jump speed.
MAX_JUMP_RATIO = 1.8


#: Choices of the options --model, --parameter and --from.
Masses = Enum("Masses", {"ONE_MASS": "one_mass", "TWO_MASS": "two_mass"})
Parameter = Enum(
    "Parameter", {"RPM": "rpm", "RESTITUTION": "restitution", "PRELOAD": "preload", "MASS": "mass"}
)
Start = Enum("Start", {"REST": "rest", "BELOW": "below", "ABOVE": "above"})

RigOption = Annotated[
    str | None,
    typer.Option(
        "--rig",
        help="Rig file, or a name in config/rigs (default: the only one next to the cam, else that "
        "of the cam's name; for shipped cams tm21).",
    ),
]
OneCam = Annotated[str, typer.Argument(help="Cam file, or a name in config/cams.")]
Speeds = Annotated[
    str | None,
    typer.Option(help="Speeds: 420, or 420,450, or 350:600:2 (default: around the jump speed)."),
]
Restitution = Annotated[
    float | None,
    typer.Option(help="Restitution of a landing, 0 to below 1 (default: the rig's value)."),
]
Follower = Annotated[
    Masses,
    typer.Option("--model", help="One rigid mass, or a roller and an end mass on an elastic stem."),
]
SweptParameter = Annotated[
    Parameter,
    typer.Option("--parameter", help="Swept quantity. All but rpm need one speed and --values."),
]
Values = Annotated[
    str | None,
    typer.Option(
        "--values",
        help="Values of the swept quantity at one speed, such as 0:0.9:0.01. Preload in N, "
        "mass in kg.",
    ),
]
Kept = Annotated[int, typer.Option(min=20, help="Number of kept turns.")]
TransientTurns = Annotated[int, typer.Option(min=0, help="Number of turns before the kept turns.")]
From = Annotated[
    Start,
    typer.Option(
        "--from",
        help="Start of each row: on the cam (rest), or the end state of the row below or above.",
    ),
]
Continuation = Annotated[
    bool,
    typer.Option(
        "--continuation",
        help="Follow the periodic motions of the rows, stable or unstable, and find their "
        "bifurcations. More rows find more motions.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Store rows in Parquet files in this folder."),
]
Resume = Annotated[
    bool, typer.Option("--resume", help="Compute only the rows that the folder does not contain.")
]
BasinsToo = Annotated[
    bool,
    typer.Option("--basins", help="Find the motion in which each start ends, at one speed."),
]


@command("json", "csv", "plot")
def bounce(
    cam: OneCam = "tm21",
    rig: RigOption = None,
    rpm: Speeds = None,
    restitution: Restitution = None,
    model: Follower = Masses.ONE_MASS,
    parameter: SweptParameter = Parameter.RPM,
    values: Values = None,
    turns: Kept = 200,
    transient_turns: TransientTurns = 300,
    start: From = Start.REST,
    continuation: Continuation = False,
    basins: BasinsToo = False,
    out: Out = None,
    resume: Resume = False,
    jobs: Jobs = None,
    dask: Dask = None,
    *,
    progress: Progress,
) -> Result:
    """Find how a follower bounces at each speed: at rest, periodic or irregular.

    The Lyapunov exponent comes from the exact derivative of each turn, not from a time series. The
    level is that of a sound-level meter, with its range from turn to turn. Starts from below and
    from above differ if two motions are possible. --parameter sweeps another number at one speed.

    In Python: cam_rig.bounce_map(law, rig, rpm, restitution, model, parameter, values, turns,
    transient_turns, start, continuation, out, resume)

    Examples
    --------
    cam-rig bounce tm21 --restitution 0.7 --plot out/bounce.png

    cam-rig bounce tm21 --restitution 0.7 --rpm 380:500:1 --from above --csv out/bounce.csv

    cam-rig bounce tm21 --rpm 450 --parameter preload --values 5:40:0.25 --continuation

    cam-rig bounce poly345 --rig paper_table2 --model two_mass --rpm 400:600:1 --out out/two

    cam-rig bounce tm21 --restitution 0.7 --rpm 420 --basins --plot out/basins.png
    """
    from cam_rig.simulation.inputs import parse_speeds
    from cam_rig.studies.bounce.study import bounce_map
    from cam_rig.workers import check_executor_options, executor_pool

    check_executor_options(jobs, dask)
    law, config = _law_and_rig(cam, rig)
    speeds = _around_jump(law, config, model) if rpm is None else parse_speeds(rpm)
    if basins:
        if model != Masses.ONE_MASS or out is not None:
            raise ConfigError("--basins requires one mass, and cannot be combined with --out")
        with executor_pool(jobs, dask) as pool:
            return _find_basins(law, config, speeds, restitution, pool.executor, progress)
    find = partial(
        bounce_map,
        law,
        config,
        rpm=speeds,
        restitution=restitution,
        model=model.value,
        parameter=parameter.value,
        values=None if values is None else _parse_values(values),
        turns=turns,
        transient_turns=transient_turns,
        start=start.value,
        continuation=continuation,
        out=out,
        resume=resume,
        progress=progress,
    )
    if start != Start.REST or (parameter == Parameter.RPM and len(speeds) == 1):
        return find()
    with executor_pool(jobs, dask) as pool:
        return find(executor=pool.executor, workers=pool.count)


def _find_basins(
    law: Law,
    rig: RigConfig,
    speeds: list[float],
    restitution: float | None,
    executor: Executor | None,
    progress: Progress,
) -> Result:
    from cam_rig.studies.bounce.basins import basins

    if len(speeds) > 1:
        raise ConfigError(f"--basins requires one speed, such as --rpm 420; got {len(speeds)}")
    options: dict[str, Any] = {"executor": executor, "progress": progress}
    return basins(law, rig, rpm=speeds[0], restitution=restitution, **options)


def _law_and_rig(cam: str, rig: str | None) -> tuple[Law, RigConfig]:
    from cam_rig.laws.cam import law_of, require_sprung
    from cam_rig.schema import load_cam
    from cam_rig.schema.load import cam_path
    from cam_rig.simulation.inputs import default_rig, resolve_rig

    path = cam_path(cam)
    loaded = load_cam(path)
    require_sprung(path, loaded)
    chosen = default_rig([path], "tm21") if rig is None else rig
    return law_of(path, loaded), resolve_rig(chosen, path)


def _parse_values(text: str) -> list[float]:
    """Return the numbers in the text of the option --values.

    Raises a `ConfigError` if the text has no numbers.
    """
    from cam_rig.simulation.inputs import parse_numbers

    if not (values := parse_numbers(text)):
        raise ConfigError(
            f"--values must be 0.5, or 0.3,0.5, or 0:0.9:0.01 (from:to:step), got {text}"
        )
    return values


def _around_jump(law: Law, rig: RigConfig, model: Masses) -> list[float]:
    """Return the default cam speeds (rpm), from below the jump speed to far above it."""
    from cam_rig.studies.bounce.motion import bouncing
    from cam_rig.studies.bounce.sweep import OperatingPoint, Sweep
    from cam_rig.units import RPM

    any_speed = OperatingPoint(bouncing(rig, 0.0, model.value), RPM)
    jump = Sweep(any_speed).lift_off(law, ()) / RPM
    if not 0.0 < jump < math.inf:
        raise ConfigError(
            f"cam {law.name!r} has a jump speed of {jump:g} rpm, around which there is no range "
            "of speeds; set --rpm"
        )
    step = jump * (MAX_JUMP_RATIO - MIN_JUMP_RATIO) / (DEFAULT_SPEEDS - 1)
    return [MIN_JUMP_RATIO * jump + i * step for i in range(DEFAULT_SPEEDS)]

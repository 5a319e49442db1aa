"""Command ``cam-rig bounce``: bouncing of a follower above its jump speed."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import ConfigError
from cam_rig.show.command import Dask, Jobs, command
from cam_rig.show.result import Progress, Result

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.schema import RigConfig
    from cam_rig.workers import Workplace

    Place = AbstractContextManager[Workplace]

#: Default number of speeds.
SPEEDS = 121
#: Lowest default speed, as a multiple of the jump speed.
FROM = 0.9
#: Highest default speed, as a multiple of the jump speed.
TO = 1.8


#: Choices of the options --model, --over and --from.
Masses = Enum("Masses", {"ONE_MASS": "one_mass", "TWO_MASS": "two_mass"})
Over = Enum(
    "Over", {"RPM": "rpm", "RESTITUTION": "restitution", "PRELOAD": "preload", "MASS": "mass"}
)
Start = Enum("Start", {"REST": "rest", "BELOW": "below", "ABOVE": "above"})

OwnRig = Annotated[
    str | None,
    typer.Option(
        "--rig",
        help="Rig file, or a name in config/rigs (default: the only one in rigs beside "
        "the cam, else tm21).",
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
Swept = Annotated[
    Over, typer.Option("--over", help="Swept quantity. All but rpm need one speed and --range.")
]
Range = Annotated[
    str | None,
    typer.Option(
        "--range",
        help="Values of the swept quantity at one speed, such as 0:0.9:0.01. Preload in N, "
        "mass in kg.",
    ),
]
Kept = Annotated[int, typer.Option(min=20, help="Number of kept turns.")]
Settle = Annotated[int, typer.Option(min=0, help="Number of turns before the kept turns.")]
From = Annotated[
    Start,
    typer.Option(
        "--from",
        help="Start of each row: on the cam (rest), or the end state of the row below or above.",
    ),
]
Follow = Annotated[
    bool,
    typer.Option(
        "--follow",
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
    rig: OwnRig = None,
    rpm: Speeds = None,
    restitution: Restitution = None,
    model: Follower = Masses.ONE_MASS,
    over: Swept = Over.RPM,
    values: Range = None,
    turns: Kept = 200,
    settle: Settle = 300,
    start: From = Start.REST,
    follow: Follow = False,
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
    from above differ if two motions are possible. --over sweeps another number at one speed.

    In Python: cam_rig.bounce_map(law, rig, rpm, restitution, model, over, values, turns, settle,
    start, follow, out, resume)

    Examples
    --------
    cam-rig bounce tm21 --restitution 0.7 --plot out/bounce.png

    cam-rig bounce tm21 --restitution 0.7 --rpm 380:500:1 --from above --csv out/bounce.csv

    cam-rig bounce tm21 --rpm 450 --over restitution --range 0.3:0.9:0.005 --follow --csv out/e.csv

    cam-rig bounce poly345 --rig paper_table2 --model two_mass --rpm 400:600:1 --out out/two

    cam-rig bounce tm21 --restitution 0.7 --rpm 420 --basins --plot out/basins.png
    """
    from cam_rig.simulation.asked import speeds_in
    from cam_rig.studies.bounce.study import bounce_map
    from cam_rig.workers import check_workplace, workplace

    check_workplace(jobs, dask)
    law, config = _law_and_rig(cam, rig)
    speeds = _around_jump(law, config, model) if rpm is None else speeds_in(rpm)
    if basins:
        if model != Masses.ONE_MASS or out is not None:
            raise ConfigError("--basins: are of one mass, and keep no rows; allowed: without both")
        pool = workplace(jobs, dask)
        return _basins(law, config, speeds, pool, restitution=restitution, progress=progress)
    find = partial(bounce_map, law, config, rpm=speeds, restitution=restitution, progress=progress)
    find = partial(find, model=model.value, over=over.value, values=_values(values), turns=turns)
    find = partial(find, settle=settle, start=start.value, follow=follow, out=out, resume=resume)
    if start != Start.REST or (over == Over.RPM and len(speeds) == 1):
        return find()
    with workplace(jobs, dask) as place:
        return find(executor=place.executor, workers=place.count)


def _law_and_rig(cam: str, rig: str | None) -> tuple[Law, RigConfig]:
    from cam_rig.laws.cam import law_of, require_sprung
    from cam_rig.schema import load_cam, load_rig
    from cam_rig.schema.load import cam_path, rig_path
    from cam_rig.simulation.asked import own_rig

    path = cam_path(cam)
    loaded = load_cam(path)
    require_sprung(path, loaded)
    return law_of(path, loaded), load_rig(own_rig([path], "tm21") if rig is None else rig_path(rig))


def _values(text: str | None) -> list[float] | None:
    """Return the numbers of --range."""
    from cam_rig.simulation.asked import numbers_in

    if text is None:
        return None
    if not (values := numbers_in(text)):
        raise ConfigError(f"--range {text}: allowed: 0.5, or 0.3,0.5, or 0:0.9:0.01 (from:to:step)")
    return values


def _around_jump(law: Law, rig: RigConfig, model: Masses) -> list[float]:
    """Return speeds (rpm) from below the jump speed to far above it."""
    from cam_rig.studies.bounce.motion import bouncing
    from cam_rig.studies.bounce.sweep import OperatingPoint, Sweep
    from cam_rig.units import RPM

    any_speed = OperatingPoint(bouncing(rig, 0.0, model.value), RPM)
    jump = Sweep(any_speed).lift_off(law, ()) / RPM
    if not 0.0 < jump < math.inf:
        raise ConfigError(
            f"cam {law.name!r}: has a jump speed of {jump:g} rpm, around which there are no "
            "speeds; allowed: --rpm"
        )
    step = jump * (TO - FROM) / (SPEEDS - 1)
    return [FROM * jump + i * step for i in range(SPEEDS)]


def _basins(law: Law, rig: RigConfig, speeds: list[float], pool: Place, **how: Any) -> Result:
    from cam_rig.studies.bounce.basins import basins

    if len(speeds) > 1:
        raise ConfigError(f"--basins: of {len(speeds)} speeds; allowed: one, as --rpm 420")
    with pool as place:
        return basins(law, rig, rpm=speeds[0], executor=place.executor, **how)

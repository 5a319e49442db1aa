"""The commands of the paper's experiments; those of noise, which write files, stand with it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.show.command import (
    DEFAULT_SCENE,
    Dask,
    Jobs,
    RigOfCam,
    SceneOption,
    TableCams,
    command,
)
from cam_rig.show.result import Progress, Result

Millimetres = Annotated[
    float | None, typer.Option(help="Radius in mm, instead of the cam's own.", show_default=False)
]


@command("json", "csv", "plot")
def as_cut(
    cams: TableCams = None,
    rig: RigOfCam = None,
    scene: SceneOption = DEFAULT_SCENE,
    base: Millimetres = None,
    roller: Millimetres = None,
    *,
    progress: Progress,
) -> Result:
    """Drive a roller on the contour of a point, as fig. 12 of the paper draws it.

    The paper plots R_b + s over the angle: the contour of a point follower. A roller on it touches
    beside its guide and stands above s. Its lift, jump speed and noise beside those of s itself.
    The scene gives the follower, sound and speeds of the noise. The plot shows the first cam.

    In Python: cam_rig.as_cut(cams, rig, scene, base, roller)

    Examples
    --------
    cam-rig as-cut

    cam-rig as-cut bezier15 --base 80 --roller 20 --plot out/as_cut.png
    """
    from cam_rig.paper.as_cut import study

    base_m, roller_m = (None if mm is None else 1e-3 * mm for mm in (base, roller))
    return study.as_cut(cams, rig, scene, base=base_m, roller=roller_m, progress=progress)


@command("plot", "json", "csv")
def timing(cams: TableCams = None, *, plot: Path | None) -> Result:
    """List the cam angles of 1, 50 and 99 % of the lift; of one cam, what each ordinate moves.

    Angles are roots of the law. Their change with an ordinate is exact, by implicit
    differentiation. A cam of one Bézier curve is put beside a B-spline of the same lift and events,
    which has local control. The plot shows the first cam.

    In Python: cam_rig.timing(cams)

    Examples
    --------
    cam-rig timing

    cam-rig timing bezier15 --plot out/timing.png --csv out/timing.csv
    """
    from cam_rig.paper.timing import study

    found = study.timing(cams)
    first = found.timings[0]
    if plot is not None and not first.ordinates:
        raise ConfigError(
            f"cam {first.cam.name!r} has no ordinates to plot; allowed: a Bézier curve, a "
            "B-spline or a polynomial rise"
        )
    return found


@command("json", "csv")
def readings(
    search: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Seek the identified numbers of a reading anew."),
    ] = None,
    with_times: Annotated[
        bool, typer.Option("--with-times", help="Of --search: by the printed times too.")
    ] = False,
    nearby: Annotated[
        bool,
        typer.Option(
            "--nearby", help="Of --search: contact need hold 5 rpm below each speed, no slower."
        ),
    ] = False,
    generations: Annotated[
        int, typer.Option(min=1, max=10_000, help="Of --search: how long to seek.")
    ] = 60,
    seed: Annotated[int, typer.Option(min=0, help="Of --search.")] = 1,
    *,
    progress: Progress,
) -> Result:
    """Read Table 2 of the paper in several ways: which rig shows its speeds, and its times.

    The paper prints neither the event angles nor all of the rig. Each reading takes some numbers
    as given and identifies the rest. It is looked at as the table is printed, every 5 rpm.

    In Python: cam_rig.readings(search, with_times, nearby, generations, seed)

    Examples
    --------
    cam-rig readings

    cam-rig readings --search shipped --generations 20
    """
    from cam_rig.paper.readings import study

    return study.readings(
        search=search,
        with_times=with_times,
        nearby=nearby,
        generations=generations,
        seed=seed,
        progress=progress,
    )


@command("json", "csv", "plot")
def factorial(
    study: Annotated[
        str, typer.Argument(help="Study file, or a name in config/factorials.")
    ] = "continuity",
    jobs: Jobs = None,
    dask: Dask = None,
    *,
    progress: Progress,
) -> Result:
    """Give laws of every continuity the same angles, then the same acceleration; analyse variance.

    Jump speed, peak acceleration, residual vibration and noise of each, and what of Bézier 15's
    advantage is in its slopes. Some 20 s on two cores.

    In Python: cam_rig.factorial(study, executor)

    Examples
    --------
    cam-rig factorial --plot out/factorial.png

    cam-rig factorial --json - | jq .conclusions
    """
    from cam_rig.paper.factorial import study as runs
    from cam_rig.workers import check_workplace, workplace

    check_workplace(jobs, dask)
    with workplace(jobs, dask) as place:
        return runs.factorial(study, executor=place.executor, progress=progress)

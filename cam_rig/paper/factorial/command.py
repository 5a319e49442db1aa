"""cam-rig factorial: continuity or lower slopes, the question the paper leaves open."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import Dask, Jobs, command
from cam_rig.show.result import Progress, Result


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

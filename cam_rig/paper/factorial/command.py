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

    Examples
    --------
    cam-rig factorial --plot out/factorial.png

    cam-rig factorial --json - | jq .conclusions
    """
    from cam_rig.laws.cam import open_cam_set
    from cam_rig.paper.factorial.design import Bench, open_factorial
    from cam_rig.paper.factorial.study import run_factorial
    from cam_rig.schema import load_rig, load_tables
    from cam_rig.schema.load import cam_path, named_path, rig_path, tables_path
    from cam_rig.workers import check_workplace, workplace

    check_workplace(jobs, dask)
    config = open_factorial(named_path("factorials", study))
    others = [cam for cam in load_tables(tables_path()).table_2_jump if cam != config.proposed]
    cam_set = open_cam_set(map(cam_path, [config.proposed, *others]), rig_path(config.rig))
    bench = Bench.of(config, cam_set.rig, load_rig(rig_path(config.noise_rig)))
    with workplace(jobs, dask) as place:
        return run_factorial(config, bench, cam_set.laws, place.executor, progress)

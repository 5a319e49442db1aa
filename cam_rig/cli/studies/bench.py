"""cam-rig bench: the rig's speed and error on this machine, beside other solvers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import progress_bar, say, show, user_errors
from cam_rig.cli.common.options import Csv, Json, Plot
from cam_rig.cli.common.outputs import check_outputs, write_csv, write_json, write_plot

if TYPE_CHECKING:
    from cam_rig.bench.result import WorkPrecisionStudy


def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer settings, about a minute.")] = False,
    json_target: Json = None,
    csv: Csv = None,
    plot: Plot = None,
) -> None:
    """Measure error against time for the rig, scipy's solvers and SUNDIALS CVODE.

    One core; set OMP_NUM_THREADS=1 for the same in numpy. Then a campaign's points a second beside
    the same study with joblib and solve_ivp, on all cores. CVODE and joblib need the extra 'bench'.

    Examples
    --------
    cam-rig bench --quick

    cam-rig bench --json out/bench.json --plot out/bench.png
    """
    with user_errors():
        from cam_rig.bench.cases.campaign import campaign_table
        from cam_rig.bench.report import notes, table, to_json

        check_outputs(json_target, plot, csv)
        study = measure(quick)
        shown = [table(study), campaign_table(study.campaign)]
        show(*shown)
        say(*notes(study))
        write_csv(shown, csv)
        if plot is not None:
            from cam_rig.plots.work_precision import draw

            write_plot(plot, lambda part: draw(study, part))
        write_json(to_json(study), json_target)


def measure(quick: bool) -> WorkPrecisionStudy:
    """Run the study behind a progress bar."""
    import os

    from cam_rig.bench.peers.peers import PEERS
    from cam_rig.bench.study import ORDER, run

    with progress_bar() as bar:
        task = bar.add_task("bench", total=len(ORDER) * len(PEERS) + 1)

        def advance(what: str) -> None:
            bar.update(task, description=what, advance=1)

        return run(quick, advance, cores=os.cpu_count() or 1)

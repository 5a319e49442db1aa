"""cam-rig bench: the rig's speed and error on this machine, beside other solvers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import console, progress_bar, user_errors
from cam_rig.cli.common.options import Json, Plot
from cam_rig.cli.common.outputs import check_outputs, write_json, write_plot

if TYPE_CHECKING:
    from rich.table import Table

    from cam_rig.bench.result import WorkPrecisionStudy

#: Columns of the table, which is not cut where a terminal has fewer.
WIDTH = 110


def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer settings, under 50 s.")] = False,
    json_target: Json = None,
    plot: Plot = None,
) -> None:
    """Measure error against time for the rig, scipy's solvers and SUNDIALS CVODE.

    One core; set OMP_NUM_THREADS=1 for the same in numpy. CVODE needs the extra 'bench'.

    Examples
    --------
    cam-rig bench --quick

    cam-rig bench --json out/bench.json --plot out/bench.png
    """
    with user_errors():
        from cam_rig.bench.report import notes, to_json

        check_outputs(json_target, plot)
        study = measure(quick)
        console.print(table(study), width=max(console.width, WIDTH), crop=False)
        for note in notes(study):
            console.print(f"  {note}", markup=False)
        if plot is not None:
            from cam_rig.bench.plot import draw

            write_plot(plot, lambda part: draw(study, part))
        write_json(to_json(study), json_target)


def measure(quick: bool) -> WorkPrecisionStudy:
    """Run the study behind a progress bar."""
    import os

    from cam_rig.bench.peers.peers import PEERS
    from cam_rig.bench.study import ORDER, run

    with progress_bar() as bar:
        task = bar.add_task("bench", total=len(ORDER) * len(PEERS))

        def advance(what: str) -> None:
            bar.update(task, description=what, advance=1)

        return run(quick, advance, cores=os.cpu_count() or 1)


def table(study: WorkPrecisionStudy) -> Table:
    """The measured points, each case's rig first."""
    from rich.box import SIMPLE
    from rich.table import Table

    from cam_rig.bench.report import HEADER, KEY, rows

    rate = min(study.rates.values()) / 1e6
    title = (
        f"one of {study.cores} cores, {study.took_s:.0f} s; "
        f"{rate:.0f} million samples of lift, velocity, acceleration a second"
    )
    out = Table(title=title, caption=KEY, box=SIMPLE, padding=(0, 1, 0, 0))
    for i, name in enumerate(HEADER):
        out.add_column(name, justify="right" if i > 1 else "left", no_wrap=True)
    for row in rows(study):
        if row[0]:
            out.add_section()
        out.add_row(*row)
    return out

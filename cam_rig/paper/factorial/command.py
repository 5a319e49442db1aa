"""cam-rig factorial: continuity or lower slopes, the question the paper leaves open."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.show.command import (
    Csv,
    Dask,
    Jobs,
    Json,
    Plot,
    check_outputs,
    progress_bar,
    user_errors,
    write_csv,
    write_json,
    write_plot,
)
from cam_rig.show.terminal import say, show

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from cam_rig.laws import Law
    from cam_rig.paper.factorial.conclusions import Conclusions
    from cam_rig.paper.factorial.study import Factorial, FactorialConfig, Measures


def factorial(
    study: Annotated[
        str, typer.Argument(help="Study file, or a name in config/factorials.")
    ] = "continuity",
    jobs: Jobs = None,
    dask: Dask = None,
    json_target: Json = None,
    csv: Csv = None,
    plot: Plot = None,
) -> None:
    """Give laws of every continuity the same angles, then the same acceleration; analyse variance.

    Jump speed, peak acceleration, residual vibration and noise of each, and what of Bézier 15's
    advantage is in its slopes. Some 20 s on two cores.

    Examples
    --------
    cam-rig factorial --plot out/factorial.png

    cam-rig factorial --json - | jq .conclusions
    """
    from cam_rig.schema.load import study_path

    with user_errors():
        from cam_rig.paper.factorial import tables
        from cam_rig.paper.factorial.conclusions import conclusions
        from cam_rig.paper.factorial.study import open_factorial
        from cam_rig.workers import check_workplace

        check_outputs(json_target, plot, csv)
        check_workplace(dask)
        found = measure(open_factorial(study_path(study)), jobs, dask)
        shown = tables.tables(found)
        show(*shown)
        say(*conclusion_lines(conclusions(found)))
        write_csv(shown, csv)
        if plot is not None:
            from cam_rig.paper.factorial.figures import figure

            write_plot(plot, lambda: figure(found))
        write_json(tables.to_json(found), json_target)


def measure(config: FactorialConfig, jobs: int | None, dask: str | None) -> Factorial:
    """Run the study in so many processes, or on a cluster, behind a bar.

    Raises
    ------
    ConfigError, DynamicsError : as the study raises them
    RunError : no cluster answers
    """
    from cam_rig.laws.cam import open_cam_set
    from cam_rig.paper.factorial.study import Bench, run_factorial
    from cam_rig.schema import load_rig, load_tables
    from cam_rig.schema.load import cam_path, rig_path, tables_path
    from cam_rig.workers import workplace

    others = [cam for cam in load_tables(tables_path()).table_2_jump if cam != config.proposed]
    cam_set = open_cam_set(map(cam_path, [config.proposed, *others]), rig_path(config.rig))
    bench = Bench.of(config, cam_set.rig, load_rig(rig_path(config.noise_rig)))
    with progress_bar() as bar, workplace(jobs, dask) as place:

        def each(function: Callable[[Law], Measures], laws: Iterable[Law]) -> Iterable[Measures]:
            todo = list(laws)
            return bar.track(
                place.executor.map(function, todo), total=len(todo), description=config.name
            )

        return run_factorial(config, bench, cam_set.laws, each)


def conclusion_lines(found: Conclusions) -> list[str]:
    """The study in short: where the advantage comes from, and what governs residual vibration."""
    lines = [f"advantage of {found.proposed}: {found.advantage} ({found.classes})"]
    if found.jump_share is not None:
        low, high = (f"{100.0 * share:.0f} %" for share in found.jump_share)
        lines[0] += f"; {low} to {high} of its higher jump speed from the slopes"
    residual = found.same_acceleration["residual"]
    lines.append(f"residual vibration at the same acceleration: {residual.governed_by}")
    if residual.lost:
        lines[1] += (
            f"; {sum(residual.lost.values())} of {residual.cells} cells lose contact below "
            f"{residual.fastest_rpm:g} rpm"
        )
    return lines

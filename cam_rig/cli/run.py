"""cam-rig run: the scene through the live node graph, into a bag."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.cli.console import DEFAULT_SCENE, console, progress_bar, scene_path, user_errors


def run(
    scene: Annotated[str, typer.Argument(help="Scene file, or a name in config/scenes.")] = (
        DEFAULT_SCENE
    ),
    bag: Annotated[
        Path | None, typer.Option(help="Folder to record into; must not exist yet.")
    ] = None,
    analyze: Annotated[
        bool, typer.Option("--analyze", help="Analyse the bag afterwards, with a plot beside it.")
    ] = False,
) -> None:
    """Run a scene through the node graph and record it.

    Five nodes, each its own process, run as fast as the slowest of them and are all ended, on
    Ctrl-C too. Exit codes: 0 done, 1 a node failed, 2 the scene is wrong, 130 interrupted.

    Examples
    --------
    cam-rig run

    cam-rig run config/scenes/quick.yaml --bag bags/mine --analyze
    """
    with user_errors():
        from cam_rig.errors import BagError, RunError

        path = scene_path(scene)
        target = bag or Path(time.strftime(f"bags/{path.stem}_%Y-%m-%d_%H-%M-%S"))
        if target.exists():
            raise BagError(f"{target}: exists already, not overwriting; name another with --bag")
        try:
            _run(path, target)
        except RunError:
            if target.is_dir():
                console.print(f"what was recorded so far is in {target}")
            raise
        if analyze:
            from cam_rig.cli.analyze import analyze_bag

            analyze_bag(target, None, target / "noise.png")


def _run(path: Path, target: Path) -> None:
    from cam_rig.bag.complete import require_complete
    from cam_rig.cli.domain import own_domain
    from cam_rig.cli.graph import Graph
    from cam_rig.experiment.program import tick_count
    from cam_rig.experiment.stage import open_stage

    stage = open_stage(path)
    begun = time.perf_counter()
    with own_domain(), progress_bar() as bar, Graph(path, target) as graph:
        task = bar.add_task("starting the nodes", total=tick_count(stage.scene))
        for report in graph.progress():
            words = f"{report['cam']} {report['rpm']:.0f} rpm"
            bar.update(task, completed=int(report["tick"]), description=words)
    counts = require_complete(target, stage.scene)
    took = time.perf_counter() - begun
    console.print(
        f"{tick_count(stage.scene)} ticks, {sum(counts.values())} messages, none missing, "
        f"in {took:.1f} s: {target}"
    )

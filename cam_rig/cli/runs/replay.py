"""cam-rig replay: a recorded run through the live follower and microphone, and compared."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import progress_bar, show, user_errors
from cam_rig.cli.common.names import scene_path
from cam_rig.cli.common.options import SceneOfBag

if TYPE_CHECKING:
    from cam_rig.bag.compare import Difference
    from cam_rig.tables import DataTable


def replay(
    bag: Annotated[Path, typer.Argument(help="Bag whose cam states and laws are played.")],
    tolerance: Annotated[
        float, typer.Option(help="Largest difference allowed, over the largest value.", min=0.0)
    ] = 1e-12,
    output: Annotated[
        Path | None,
        typer.Option("--out", "--output", help="Keep the new recording here; must not exist yet."),
    ] = None,
    scene: SceneOfBag = None,
) -> None:
    """Feed recorded cam states and laws to live nodes, and compare their messages with the bag.

    A regression test for any change of follower or microphone: code 1 when a number differs.

    Examples
    --------
    cam-rig replay bags/golden

    cam-rig replay bags/mine --tolerance 1e-9 --out bags/mine_again
    """
    with user_errors():
        from cam_rig.bag.recording.place import require_new_bag
        from cam_rig.errors import BagError
        from cam_rig.files import temporary_folder

        if output is not None:
            require_new_bag(output)
        with temporary_folder("cam_rig-replay-") as folder:
            found = _replay(bag, folder, scene, output)
        show(_table(found))
        worst = max(found, key=lambda entry: entry.relative)
        if not worst.relative <= tolerance:
            raise BagError(
                f"{bag}: {worst.topic} {worst.quantity} differs by {worst.difference:.3g}, "
                f"{worst.relative:.3g} of its largest value; allowed: {tolerance:g}"
            )


def _replay(bag: Path, folder: Path, scene: str | None, output: Path | None) -> list[Difference]:
    from cam_rig.bag.attached import unpack
    from cam_rig.bag.compare import compare
    from cam_rig.bag.reader import read_counts
    from cam_rig.errors import BagError
    from cam_rig.messages.topics import CAM_STATE
    from cam_rig.runner.domain_lock import own_domain
    from cam_rig.runner.graph import Graph
    from cam_rig.runner.nodes_of_run import replayed

    total = read_counts(bag).get(CAM_STATE.name, 0)
    if total < 2:
        raise BagError(f"{bag}: has {total} states of the cam; allowed: two at least")
    path = scene_path(scene) if scene else unpack(bag, folder)
    again = folder / "again" / (output.name if output else "bag")  # not among the bag's own files
    with own_domain(), progress_bar() as bar, Graph(replayed(path, again, bag)) as graph:
        task = bar.add_task("replaying", total=total - 1)
        for report in graph.progress():
            bar.update(task, completed=int(report["tick"]))
    graph.require_closed()
    found = compare(bag, again)
    if output is not None:
        shutil.move(again, output)
    return found


def _table(found: list[Difference]) -> DataTable:
    from cam_rig.tables import Column, tabulate

    return tabulate(
        "Recorded against replayed",
        found,
        (
            (Column("topic"), lambda entry: entry.topic),
            (Column("quantity"), lambda entry: entry.quantity),
            (Column("numbers", "", "d"), lambda entry: entry.count),
            (Column("difference", "", ".3g"), lambda entry: entry.difference),
            (Column("relative", "", ".2g"), lambda entry: entry.relative),
        ),
    )

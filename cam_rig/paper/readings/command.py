"""cam-rig readings: the paper's Table 2 read in several ways."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import command
from cam_rig.show.result import Progress, Result


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
